"""Every oddity of a dialect by itself: the right numbers, or a sentence with the line; nothing silently wrong."""

import re

import pytest

from calib_core.robots.backup import read_controller_files
from tests.core.robot_oddities import ODDITIES, Expected

CASES = [(brand, *piece) for brand, dialect in ODDITIES.items() for piece in dialect.pieces]


@pytest.mark.parametrize(("brand", "body", "expected"), CASES, ids=[f"{c[0]}-{k}" for k, c in enumerate(CASES)])
@pytest.mark.parametrize("ends", ["\n", "\r\n"], ids=["lf", "crlf"])
def test_an_oddity(brand: str, body: str, expected: Expected, ends: str) -> None:
    name, around, _ = ODDITIES[brand]
    data = around(body).replace("\n", ends).encode()
    found = read_controller_files({name: data}, brand)
    if isinstance(expected, str):
        told = [row for row in found.skipped if re.search(expected, row.reason)]
        assert told, [row.reason for row in found.skipped]
        assert all(1 <= row.line <= data.count(b"\n") for row in told)
        assert [p.as_written for p in found.poses if p.pose is not None] == []
    else:
        assert {p.name: p.as_written for p in found.poses if p.pose is not None} == expected


def test_variables_of_a_system_list_are_no_taught_points() -> None:
    """A whole $config.dat has frames without number: reference points, corrections, machines; none was taught."""
    text = """&ACCESS RV$2
DEFDAT  $CONFIG
DECL CIRC_TYPE DEF_CIRC_TYP=#BASE
REF_PT[1]={X 626.6,Y 252.5,Z 173.3,A -74.4,B 9.9,C 174.0}
REF_PT[2]={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
FRAME TOOL_CORR={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}
TOOL_DATA[1]={X 0.0,Y 0.0,Z 225.000,A 0.0,B 0.0,C 0.0}
TOOL_DATA[2]={X 900.0,Y 0.0,Z 225.000,A 0.0,B 0.0,C 0.0}
TOOL_TYPE[1]=#BASE
TOOL_TYPE[2]=#TCP
MACHINE_DEF[1]={NAME[] "KR",PARENT[] "WORLD",ROOT {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},MECH_TYPE #ROBOT}
ENDDAT
"""
    found = read_controller_files({"$config.dat": text.encode()}, "kuka")
    assert found.poses == ()
    assert [(tool.number, "stands still" in tool.moving) for tool in found.tools] == [(1, False), (2, True)]
    assert [(row.line, "variable of the system" in row.reason) for row in found.skipped] == [(4, True)]


def test_every_brand_has_twenty() -> None:
    assert {brand for brand, dialect in ODDITIES.items() if len(dialect.pieces) < 20} == set()


@pytest.mark.parametrize(
    ("brand", "line"),
    [
        ("epson", "TGo XY(0,0,10,0,0,0)"),
        ("epson", "TMove XY(0,0,10,0,0,0)"),
        ("epson", "BGo XY(0,0,10,0,0,0)"),
        ("denso", "Approach P, P(1,2,3,4,5,6), 100"),
        ("denso", "Draw L, (0,0,5,0,0,0)"),
        ("kuka", "LIN_REL {X 0,Y 0,Z 10,A 0,B 0,C 0}"),
    ],
)
def test_a_move_from_where_the_arm_is_has_no_pose_of_its_own(brand: str, line: str) -> None:
    found = read_controller_files({"a.txt": f"{line}\n".encode()}, brand)
    assert found.poses == ()
    assert [row.line for row in found.skipped] == [1]
