"""Every oddity of a dialect by itself: the right numbers, or a sentence with the line; nothing silently wrong."""

import re

import pytest

from calib_core.robots.backup import read_controller_files
from tests.core.robot_oddities import ODDITIES, Expected

CASES = [(brand, *piece) for brand, dialect in ODDITIES.items() for piece in dialect.pieces]


@pytest.mark.parametrize(("brand", "body", "expected"), CASES, ids=[f"{c[0]}-{k}" for k, c in enumerate(CASES)])
def test_an_oddity(brand: str, body: str, expected: Expected) -> None:
    name, around, _ = ODDITIES[brand]
    for ends in ("\n", "\r\n"):
        data = around(body).replace("\n", ends).encode()
        found = read_controller_files({name: data}, brand)
        if isinstance(expected, str):
            told = [row for row in found.skipped if re.search(expected, row.reason)]
            assert told, (ends, [row.reason for row in found.skipped])
            assert all(1 <= row.line <= data.count(b"\n") for row in told)
            assert [p.as_written for p in found.poses if p.pose is not None] == [], ends
        else:
            assert {p.name: p.as_written for p in found.poses if p.pose is not None} == expected, ends


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


_JOB = """/JOB
//NAME A
//POS
///NPOS 0,0,0,2,0,0
///TOOL 1
///POSTYPE BASE
///RECTAN
P00004=0.000,0.000,2.500,0.0000,0.0000,0.0000
P00006=-800.000,900.000,400.000,180.0000,0.0000,120.0000
//INST
NOP
MOVL P006 PL=0
SUB P006 P004
END
//TOOL 1
///NAME A
0.000,0.000,0.000,0.0000,0.0000,0.0000
"""
_TP = """/PROG A
/MN
   1:L P[1] 100mm/sec FINE Offset,PR[1:fixture]    ;
   2:L PR[10] 100mm/sec FINE    ;
/POS
P[1]{
 GP1:
 UF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',
X = 1 mm, Y = 2 mm, Z = 3 mm, W = 10 deg, P = 20 deg, R = 30 deg
};
/END
"""
_RAPID = """MODULE a
 PERS wobjdata wT:=[FALSE,TRUE,"",[[1,2,3],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
 CONST robtarget p1:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
 PROC m()
  wT.uframe:=peFound;
  MoveL p1,v5,fine,tool0\\WObj:=wT;
  MoveL p2,v5,fine,tool0;
 ENDPROC
ENDMODULE
"""
_URSCRIPT = """def a():
  global tmp=p[0,0,0.1,0,0,0]
  $ 2 "tmp≔p[0,0,0,0,0,0]"
  tmp[0] = read_input_float_register(0)
  movel(tmp, a=1.2, v=0.25)
  ready = [0,-0.78,-1.57,-2.35,1.57,0]
  movej(ready, 1.5, 1)
  movel(elsewhere, a=1.2, v=0.25)
end
"""


@pytest.mark.parametrize(
    ("name", "text", "doubted", "told"),
    [
        ("A.JBI", _JOB, {"P00006": "line 13"}, {8: "shift"}),
        ("a.ls", _TP, {"P[1]": "offset to it (line 3)"}, {4: "PR[10]: a move goes there"}),
        ("a.mod", _RAPID, {"p1": "changes the work object wT (line 5)"}, {7: "p2: a move goes there"}),
        (
            "a.script",
            _URSCRIPT,
            {"tmp": "changes it (line 4)"},
            {6: "joints alone", 8: "elsewhere: a move goes there"},
        ),
    ],
)
def test_what_a_program_does_with_its_positions(
    name: str, text: str, doubted: dict[str, str], told: dict[int, str]
) -> None:
    """Shifts are no places, changed positions are doubtful, and a place that no file holds is told."""
    found = read_controller_files({name: text.encode()})
    poses = {pose.name: pose.doubt for pose in found.poses if pose.pose is not None}
    assert poses.keys() == doubted.keys()
    assert all(part in poses[key] for key, part in doubted.items()), poses
    assert {row.line for row in found.skipped} == told.keys(), found.skipped
    assert all(told[row.line] in row.reason for row in found.skipped)


def test_a_program_without_its_list_of_points_says_what_is_missing() -> None:
    program = b"DEF a()\nPTP XP1 C_PTP\nSLIN point[n]\nLIN lift(XP1, 3)\nSPTP $AXIS_ACT\nCIRC XP2, XP3\nEND\n"
    points = (
        b"DEFDAT a\nDECL E6POS XP1={X 1,Y 2,Z 3,A 0,B 0,C 0}\nDECL E6POS XP2\nDECL E6POS XP3={X 1,Y 2\nENDDAT\n"
    )
    alone = read_controller_files({"a.src": program}, "kuka")
    assert [(row.line, row.reason.partition(":")[0]) for row in alone.skipped] == [
        (2, "XP1"), (3, "SLIN point[n]"), (4, "LIN lift(XP1, 3)"), (6, "XP2"), (6, "XP3"),
    ]  # fmt: skip
    together = read_controller_files({"a.src": program, "a.dat": points}, "kuka")
    assert [pose.name for pose in together.poses] == ["XP1"]
    assert {row.reason.partition(":")[0] for row in together.skipped} == {
        "XP3", "SLIN point[n]", "LIN lift(XP1, 3)", "XP2",
    }  # fmt: skip


def test_a_remote_tool_is_no_pose_of_this_robot() -> None:
    text = """/PROG A
/POS
P[1]{
 GP1:
 UF : 1, UT : 2, KONFIG : 'N U T, 0, 0, 0',
 RX = 96.1 mm, RY = 710.3 mm, RZ = -.3 mm,
 RW = 24.7 deg, RP = 43.6 deg, RR = 155.5 deg
};
/END
"""
    found = read_controller_files({"a.ls": text.encode()}, "fanuc")
    assert found.poses == ()
    assert [(row.line, "remote TCP" in row.reason) for row in found.skipped] == [(3, True)]


_POINT = b"DEFDAT a\nDECL E6POS XP1={X 1,Y 2,Z 3,A 10,B 20,C 30}\nDECL FDAT FP1={TOOL_NO 1,BASE_NO 1}\nENDDAT\n"
_CONFIG = b"TOOL_DATA[1]={X 0,Y 0,Z 100,A 0,B 0,C 0}\nBASE_DATA[1]={X 9,Y 0,Z 0,A 0,B 0,C 0}\n"
_FANUC_FRAME = b"""[*SYSTEM*]$MNUFRAME  Storage: CMOS
      [1,1] =
  Group: 1   Config: N D B, 0, 0, 0
  X:  1000.000   Y:      .000   Z:      .000
  W:      .000   P:      .000   R:      .000

"""

FANUC_POINT = """P[1]{
 GP1:
 UF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',
X = 1 mm, Y = 2 mm, Z = 3 mm, W = 10 deg, P = 20 deg, R = 30 deg
};"""
_SETS_FRAME = b"/PROG B\n/MN\n 1: UFRAME[1]=PR[5] ;\n/POS\n/END\n"
_TEACHES_FRAME = b"/PROG B\n/MN\n 1: UFRAME[1]=LPOS ;\n/POS\n/END\n"


def _ls(program: str, frame: int = 0) -> bytes:
    point = FANUC_POINT.replace("UF : 0", f"UF : {frame}")
    return f"/PROG A\n/MN\n{program}\n/POS\n{point}\n/END\n".encode()


def _jbi(program: str) -> bytes:
    return f"""/JOB
//POS
///TOOL 0
///POSTYPE BASE
P00001=1.000,2.000,3.000,10.0000,20.0000,30.0000
//INST
NOP
{program}
END
""".encode()


def _displaced(program: str) -> bytes:
    point = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
    move = "MoveL p1,v5,fine,tool0;"
    return f"MODULE a\nCONST robtarget p1:={point};\nPROC m()\n{program}\n{move}\nENDPROC\nENDMODULE\n".encode()


@pytest.mark.parametrize(
    ("files", "doubt"),
    [
        ({"$config.dat": _CONFIG, "a.dat": _POINT, "a.src": b"BASE_DATA[1].X=500\nLIN XP1\n"}, "changes frame 1"),
        ({"$config.dat": _CONFIG, "a.dat": _POINT, "b.src": b"TOOL_DATA[1] = TNEW\n"}, "changes tool 1"),
        ({"$config.dat": _CONFIG, "a.dat": _POINT, "a.src": b"XP1.Z = XP1.Z+10\nLIN XP1\n"}, "changes it"),
        ({"$config.dat": _CONFIG, "a.dat": _POINT, "a.src": b"XP1={X 5,Y 2,Z 3,A 0,B 0,C 0}\n"}, "changes it"),
        ({"$config.dat": _CONFIG, "a.dat": _POINT, "b.src": b"XP1.Z = 5\n"}, ""),  # a point of its own
        ({"a.ls": _ls("   1:  P[1,3]=R[1]    ;\n   2:L P[1] 100mm/sec FINE    ;")}, "changes it"),
        ({"a.ls": _ls("   1:L P[1] 100mm/sec FINE COORD    ;")}, "another group"),
        ({"a.ls": _ls("   1:L P[1] 100mm/sec FINE RTCP    ;")}, "refused"),
        ({"a.ls": _ls(""), "b.ls": _SETS_FRAME, "SYSFRAME.VA": _FANUC_FRAME}, ""),
        ({"a.ls": _ls("", 1), "b.ls": _SETS_FRAME, "SYSFRAME.VA": _FANUC_FRAME}, "changes frame 1"),
        ({"a.ls": _ls("", 1), "b.ls": _TEACHES_FRAME, "SYSFRAME.VA": _FANUC_FRAME}, "changes frame 1"),
        ({"A.JBI": _jbi("SFTON P002\nMOVL P001\nSFTOF")}, "adds an offset"),
        ({"A.JBI": _jbi("SFTON P002\nSFTOF\nMOVL P001")}, ""),
        ({"A.JBI": _jbi("IMOV P001 V=10.0 BF")}, "refused"),
        ({"A.JBI": _jbi("SETE P001 (3) 5000\nMOVL P001")}, "changes it"),
        ({"a.mod": _displaced("PDispSet peShift;")}, "adds an offset"),
        ({"a.mod": _displaced("PDispSet peShift;\nPDispOff;")}, ""),
    ],
)
def test_what_programs_change_while_they_run_is_doubted(files: dict[str, bytes], doubt: str) -> None:
    """A point, its tool or its frame that a program sets has other numbers than the file: it was taken so."""
    found = read_controller_files(files)
    poses = [pose for pose in found.poses if pose.pose is not None and pose.as_written[0] == 1.0]
    if doubt == "refused":
        assert poses == []
        return
    (pose,) = poses
    assert doubt in pose.doubt
    assert doubt or not any(word in pose.doubt for word in ("changes", "offset", "group"))
