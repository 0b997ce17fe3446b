"""Controllers' files: poses, tools and frames with their lines, what is applied, what is refused and why."""

import gzip
import io
import json
import random
import zipfile
from typing import Any

import numpy as np
import pytest
from controller_mutations import BRANDS as BRANDS_MUTATED
from controller_mutations import judged, mutated

from calib_core.errors import InputError
from calib_core.robots import BRANDS, CONVENTIONS, parse_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.controller_file import ControllerFile
from server.cli import main
from tests.core.robot_dialects import (
    AS,
    CONFIG,
    DAT,
    DTX,
    DTX_6,
    JBI,
    LS,
    RAPID,
    SCRIPT,
    SRC,
    TOOL_CND,
    UFRAME_CND,
    VA,
)  # fmt: skip


def read(brand: str | None = None, as_written: bool = False, /, **files: str) -> ControllerFile:
    named = {name.replace("__", "."): text.encode() for name, text in files.items()}
    return read_controller_files(named, brand, as_written)


def pose(found: ControllerFile, name: str) -> Any:
    return next(p for p in found.poses if p.name == name)


def placed(found: ControllerFile, name: str) -> list[float]:
    one = pose(found, name)
    return parse_pose(one.convention, one.pose).translation_mm.tolist()


def reasons(found: ControllerFile, line: int) -> str:
    return " ".join(row.reason for row in found.skipped if row.line == line)


def test_rapid() -> None:
    found = read(a__mod=RAPID)
    assert found.brand == "abb"
    # wTable turns by 90° about z: (551, 613, 25) comes to (100 − 613, 551, 30), and the tool is 184 mm long.
    np.testing.assert_allclose(placed(found, "pA"), [-513, 551, 25 + 5 - 184], atol=1e-6)
    assert (pose(found, "pA").tool, pose(found, "pA").frame, pose(found, "pA").line) == ("tGrip", "wTable", 6)
    assert pose(found, "pArray{1}").external == {"eax_a": 45.0}
    assert pose(found, "pArray{1}").pose == (1, 2, 3, 1, 0, 0, 0)
    assert (pose(found, "pArray{2}").line, pose(found, "pArray{2}").external) == (8, None)
    assert pose(found, "line 15").pose == (7, 8, 9, 1, 0, 0, 0)
    assert pose(found, "jHome").joints_deg == (0, 0, 0, 0, 30, 0)
    assert pose(found, "jHome").pose is None
    assert "joints alone" in reasons(found, 10)
    assert "no value" in reasons(found, 9)
    assert "tUnknown" in reasons(found, 6)
    assert "calculated" in reasons(found, 14)
    assert "robhold" in reasons(found, 17)
    assert "STN1" in reasons(found, 18)
    assert [t.name for t in found.tools] == ["tGrip", "tStand"]


def test_krl() -> None:
    found = read(_config__dat=CONFIG, style1__dat=DAT)
    assert pose(found, "XP1").pose == (214.5, 193.6, 1005.8, 6.6, -23.4, 9.8)
    assert pose(found, "XP1").external["E1"] == 45.0
    assert (pose(found, "XP2").tool, pose(found, "XP2").frame) == (1, 1)
    base, tool = parse_pose("kuka", found.frames[0].pose), parse_pose("kuka", found.tools[0].pose)
    expected = base.matrix @ parse_pose("kuka", (1, 2, 3, 0, 0, 0)).matrix @ tool.inverse().matrix
    np.testing.assert_allclose(parse_pose("kuka", pose(found, "XP2").pose).matrix, expected, atol=1e-9)
    assert found.tools[0].name == "GUN"
    assert "brackets" in reasons(found, 8)
    assert "TOOL_TYPE[2] is #TCP" in reasons(found, 9)
    assert "#TCP" in reasons(found, 11)
    alone = read(style1__dat=DAT)
    assert [p.name for p in alone.poses] == ["XP1", "XHOME"]
    assert "$config.dat" in reasons(alone, 5)
    assert pose(read(None, True, style1__dat=DAT), "XP2").pose == (1, 2, 3, 0, 0, 0)


def test_krl_program() -> None:
    found = read(moves__src=SRC)
    np.testing.assert_allclose(placed(found, "line 4"), [6, 1.5, 287], atol=1e-9)
    assert pose(found, "line 8").joints_deg == (0, -90, 90, 0, 0, 0)
    assert "missing" in reasons(found, 5)
    assert "relative" in reasons(found, 6)
    assert "calculated" in reasons(found, 7)
    assert "frame 7" in reasons(found, 10)


def test_fanuc() -> None:
    found = read(test1__ls=LS, sysframe__va=VA)
    assert [(t.number, t.name, t.group) for t in found.tools] == [(1, "Grip", 1), (1, None, 2)]
    tool = parse_pose("fanuc", (0, 0.14, 150, 0, 0, 0))
    written = parse_pose("fanuc", (-464.787, -676.745, 0.14, 142.55, 72.302, -130.575))
    np.testing.assert_allclose(placed(found, "P[1]"), (written.matrix @ tool.inverse().matrix)[:3, 3], atol=1e-9)
    assert pose(found, "P[1]").external == {"GP2.J1": 100.0}
    assert "INC" in reasons(found, 15)
    assert pose(found, "P[3]").external == {"E1": 20.0}
    assert "does not say" in pose(found, "P[3]").doubt
    assert pose(found, "P[4]").joints_deg == (0, -30, 0, 0.5, -90, 180)
    assert "not taught" in reasons(found, 34)
    assert "Uninitialized" in reasons(found, 5)
    inches = LS.replace("-464.787  mm", "-464.787  in")
    assert "'in' instead of mm" in reasons(read(test1__ls=inches), 6)


def test_universal_robots() -> None:
    found = read(a__script=SCRIPT)
    np.testing.assert_allclose(placed(found, "Waypoint_1_p"), [420, -250, 400], atol=1e-3)
    assert pose(found, "Waypoint_1_p").joints_deg[0] == pytest.approx(-91.7133, abs=1e-3)
    assert "millimetres" in reasons(found, 6)
    np.testing.assert_allclose(placed(found, "line 7"), [400, 200, 100], atol=1e-9)
    assert "calculation" in reasons(found, 8)
    assert "degrees" in reasons(found, 9)
    program = b"""<URProgram name="a"><children><Waypoint type="Fixed" name="Waypoint_1"><position>
        <JointAngles angles="-1.6007, -1.7271, -2.2030, -0.8080, 1.5951, -0.0310"/>
        <TCPOffset pose="0.0, 0.0, 0.12, 0.0, 0.0, 0.0"/></position></Waypoint></children></URProgram>"""
    zipped = read_controller_files({"a.urp": gzip.compress(program)})
    assert [(p.name, p.pose) for p in zipped.poses] == [("Waypoint_1", None)]
    recorded = (
        "timestamp actual_TCP_pose_0 actual_TCP_pose_1 actual_TCP_pose_2 actual_TCP_pose_3 actual_TCP_pose_4 \
actual_TCP_pose_5\n1 0.1 0.2 0.3 0 0 0\n2 0.1 0.2 x 0 0 0\n"
    )
    rows = read(r__csv=recorded)
    assert [(p.pose, p.line) for p in rows.poses] == [((0.1, 0.2, 0.3, 0, 0, 0), 2)]
    assert "no number" in reasons(rows, 3)


def test_yaskawa() -> None:
    found = read(TEST__JBI=JBI, TOOL__CND=TOOL_CND, UFRAME__CND=UFRAME_CND)
    np.testing.assert_allclose(placed(found, "C00000"), [100, 200, 400], atol=1e-9)
    np.testing.assert_allclose(placed(found, "C00001"), [8, 1, -97], atol=1e-9)
    # Tool 0 of this backup is turned by 90° about y: it is applied like any other.
    assert pose(found, "C00002").pose[4] == pytest.approx(-90)
    assert "pulses alone" in reasons(found, 18)
    assert pose(found, "C00000").external == {"EC1": 1000.0}
    alone = read(TEST__JBI=JBI)
    assert [p.name for p in alone.poses] == ["C00002"]
    assert "not always the flange" in alone.poses[0].doubt


def test_kawasaki() -> None:
    found = read(save__as=AS)
    np.testing.assert_allclose(placed(found, "p1"), [100, 200, 150], atol=1e-9)
    assert pose(found, "p[2]").external == {"JT7": 30.0}
    assert [t.name for t in found.tools] == ["t1"]
    assert "compound" in reasons(found, 6)
    assert "no .END" in reasons(found, 14)


def test_staubli() -> None:
    found = read(a__dtx=DTX)
    np.testing.assert_allclose(placed(found, "pA[0]"), [601, 2, -462], atol=1e-9)
    assert "fLost[0]" in reasons(found, 11)
    assert pose(found, "jA[0]").joints_deg == (0, 10, 0, 0, 0, 0)
    assert found.tools[0].pose == (-5.972, 209.431, 55.323, 0, 0, 90)
    sixth = read(a__dtx=DTX_6)
    np.testing.assert_allclose(placed(sixth, "pA[0]"), [601, 2, -462], atol=1e-9)
    assert "fLost[0]" in reasons(sixth, 20)
    assert pose(sixth, "jA[0]").joints_deg == (0, 10, 0, 0, 0, 0)
    assert [(tool.name, tool.pose) for tool in sixth.tools] == [("tTool[0]", found.tools[0].pose)]
    hostile = DTX.replace("<Database", '<!DOCTYPE a [<!ENTITY b "c">]><Database', 1)
    with pytest.raises(InputError, match="entity"):
        read(a__dtx=hostile)
    with pytest.raises(InputError, match="whole XML"):
        read(a__dtx=DTX[:400])


ALL = {
    "abb": {"a.mod": RAPID}, "kuka": {"$config.dat": CONFIG, "style1.dat": DAT, "moves.src": SRC},
    "fanuc": {"test1.ls": LS, "sysframe.va": VA}, "ur": {"a.script": SCRIPT},
    "yaskawa": {"TEST.JBI": JBI, "TOOL.CND": TOOL_CND, "UFRAME.CND": UFRAME_CND},
    "kawasaki": {"save.as": AS}, "staubli": {"a.dtx": DTX},
}  # fmt: skip


@pytest.mark.parametrize("brand", ALL)
def test_line_ends_encodings_and_zips_change_nothing(brand: str) -> None:
    files = {name: text.encode() for name, text in ALL[brand].items()}
    plain = read_controller_files(files).to_json()
    assert plain["brand"] == brand
    for change in (
        lambda text: text.replace("\n", "\r\n").encode(),
        lambda text: text.encode("utf-8-sig"),
        lambda text: text.encode() if brand == "staubli" else text.replace("\n", "\r").encode(),
    ):
        assert read_controller_files({n: change(t) for n, t in ALL[brand].items()}, brand).to_json() == plain
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    assert read_controller_files({"backup.zip": packed.getvalue()}).to_json() == plain


def test_what_is_no_controllers_file_is_refused() -> None:
    with pytest.raises(InputError, match="no brand's reader knows"):
        read(a__txt="nothing")
    with pytest.raises(InputError, match=r"brand.*abb, .*kuka"):
        read("robotron", a__txt="nothing")
    with pytest.raises(InputError, match="kuka and yaskawa"):
        read(a__dat=DAT, b__jbi=JBI)
    with pytest.raises(InputError, match="zip"):
        read_controller_files({"a.zip": b"PK\x03\x04 broken"})
    with pytest.raises(InputError, match="binary"):
        read_controller_files({"a.mod": b"CONST robtarget \0"}, "abb")


@pytest.mark.parametrize("brand", ALL)
def test_a_pose_or_tool_in_two_ways_is_none(brand: str) -> None:
    for name, text in ALL[brand].items():
        if brand == "staubli":
            continue  # one document, not two
        other = text.replace("100", "101").replace("551", "552").replace(".140", ".150").replace(".42", ".43")
        found = read_controller_files({name: (text + "\n" + other).encode()}, brand)
        for row in (*found.poses, *found.tools):
            assert row.line <= len(text.split("\n")) or row.name.startswith(("line", "set_tcp", "$TOOL"))


def test_the_command_prints_the_contracts_json(tmp_path: Any, capsys: Any) -> None:
    (tmp_path / "style1.dat").write_text(DAT)
    (tmp_path / "$config.dat").write_text(CONFIG)
    assert main(["poses", str(tmp_path), "--json"]) == 0
    out = json.loads(capsys.readouterr().out)
    assert out["brand"] == "kuka"
    wanted = {"name", "pose", "convention", "joints_deg", "external", "tool", "frame", "line"}
    assert all(wanted <= set(row) for row in out["poses"])
    assert all({"number", "name", "pose", "line"} <= set(row) for row in [*out["tools"], *out["frames"]])
    assert all({"line", "reason"} <= set(row) for row in out["skipped"])
    assert main(["poses", str(tmp_path / "style1.dat")]) == 0
    assert "XP1" in capsys.readouterr().out
    assert main(["poses", str(tmp_path / "none.dat")]) == 2


def test_every_brand_with_a_reader_says_what_it_reads() -> None:
    for brand in BRANDS:
        described = brand.describe()
        assert set(described["conventions"]) <= set(CONVENTIONS)
        assert bool(described["endings"]) == described["reads"]


LINES = {
    "mitsubishi": ("a.prg", "1 Tool (+0.00,+0.00,+100.00,+0.00,+0.00,+0.00)\n2 Mov P1\n"
                   "P1=(+10.00,+20.00,+300.00,+0.00,+0.00,+90.00,+5.00,+0.00)(7,0)\nJ1=(0,0,0,0,0,0)\nP2=P1*P3\n"),
    "denso": ("a.pcs", "Tool 1, P(0, 0, 100, 0, 0, 0)\nWork 2, P(1, 0, 0, 0, 0, 0)\nChangeTool 1\nChangeWork 0\n"
              "P[1] = P(10, 20, 300, 0, 0, 90, 5)\nJ[1] = J(0,0,0,0,0,0)\nP[2] = P[1] + DEV\n"),
    "epson": ("a.prg", "TLSet 1, XY(0, 0, 100, 0, 0, 0)\nTool 1\nP1 = XY(10, 20, 300, 90, 0, 0) /0\n"
              "P2 = P1 +X(10)\nP3 = XY(1, 2, 3, 0, 0, 0) /7\n"),
    "comau": ("a.pdl", "PROGRAM a\nBEGIN\n  $TOOL := POS(0, 0, 100, 0, 0, 0, '')\n"
              "  $UFRAME := POS(0,0,0,0,0,0,'')\n"
              "  p1 := POS(10, 20, 300, 0, 0, 90, '') -- taught\n  MOVE LINEAR TO POS(1,2\nEND a\n"),
    "nachi": ("a.txt", "MOVEX A=1,AC=0,SM=0,M1X,L,(10,20,300,90,0,0),S=100,H=1,MS\n"
              "MOVEX A=1,AC=0,SM=0,M1J,P,(0,0,0,0,0,0),R=5,H=1,MS\nMOVEX A=1,M1X,L,(1,2\n"),
    "doosan": ("a.drl", "p1 = posx(10, 20, 300, 0, 0, 90)\nj = posj(0,0,0,0,0,0)\n"
               "movel(posx(x, y, 0, 0, 0, 0))\n"),
}  # fmt: skip


@pytest.mark.parametrize("brand", LINES)
def test_brands_of_programs_that_say_one_thing_a_line(brand: str) -> None:
    name, text = LINES[brand]
    found = read_controller_files({name: text.encode()}, None if brand != "nachi" else brand)
    assert found.brand == brand
    first = next((p for p in found.poses if p.pose is not None), None)
    if brand == "nachi":  # its tools stand in the controller alone
        assert first is None
        assert "tool 1" in reasons(found, 1)
        first = read_controller_files({name: text.encode()}, brand, True).poses[0]
    assert first is not None
    z = {"nachi": 300, "doosan": 300}.get(brand, 200)
    np.testing.assert_allclose(parse_pose(first.convention, first.pose).translation_mm, [10, 20, z], atol=1e-9)
    turned = parse_pose(first.convention, first.pose).rotation
    np.testing.assert_allclose(turned, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-9)
    assert any("cannot be read" in row.reason for row in found.skipped)
    if brand == "epson":
        assert "frame 7" in reasons(found, 5)


@pytest.mark.parametrize("brand", BRANDS_MUTATED)
def test_a_mutated_file_is_read_right_or_says_what_is_wrong(brand: str) -> None:
    wrong = {seed: found for seed in range(40) if (found := judged(brand, mutated(brand, random.Random(seed))))}
    assert wrong == {}


SAVED = """.SYSDATA
BASE           -120.000   143.000     0.000     0.000     0.000     0.000
TOOL              0.000     0.000   100.000     0.000     0.000     0.000
.END
.PROGRAM go()
  LMOVE out
.END
.TRANS
out 10 20 300 0 0 0
.END
"""


def test_a_kawasaki_backup_has_the_tool_and_base_that_were_active() -> None:
    found = read_controller_files({"robot.as": SAVED.encode()}, "kawasaki")
    (pose,) = found.poses
    assert pose.pose == pytest.approx((-110, 163, 200, 0, 0, 0))
    assert "active in the backup" in pose.doubt
    own = SAVED.replace("  LMOVE out", "  TOOL NULL\n  BASE NULL\n  LMOVE out")
    assert read_controller_files({"robot.as": own.encode()}, "kawasaki").poses[0].pose == (10, 20, 300, 0, 0, 0)
    cut = SAVED.replace(" 143.000 ", " abc ")
    found = read_controller_files({"robot.as": cut.encode()}, "kawasaki")
    assert [(row.line, "BASE of .SYSDATA" in row.reason) for row in found.skipped] == [(2, True)]
