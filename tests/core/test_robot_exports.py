"""Exports: what is written is read back by our own readers, and a backup is patched in one entry alone."""

import gzip
import io
import json
import re
import zipfile
from typing import Any

import numpy as np
import pytest

from calib_core.errors import ConflictError, InputError
from calib_core.exports.export import export
from calib_core.exports.registry import all_exports
from calib_core.frames import RigidTransform
from calib_core.records import Session, parse_session
from calib_core.robots import BRANDS, parse_pose, to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.fanuc.check import tool_check
from tests.core.robot_dialects import AS, CONFIG, DTX, RAPID, SCRIPT, TOOL_CND, UFRAME_CND, VA

TOOL = RigidTransform.of([0.3, -1.1, 0.7], [149.61234567891, -709.5, 487.25], "tool0", "laser")
LOCKED = RigidTransform.of([0.0, np.pi / 2, 0.0], [-1e-7, 0.125, 300.0], "tool0", "laser")
TABLE = RigidTransform.of([0.01, -0.02, 2.0], [1200.125, -35.5, 410.75], "base", "turntable")
COVARIANCE = (np.diag([1e-5, 1e-5, 2e-5, 0.02, 0.02, 0.03]) ** 2).tolist()
DIGITS = {  # of the format: position in mm, rotation in rad
    "fanuc": (6e-4, 2e-5), "yaskawa": (6e-4, 2e-6), "kuka": (1e-9, 1e-12), "abb": (1e-9, 1e-12),
    "ur": (1e-9, 1e-12), "kawasaki": (1e-9, 1e-12), "staubli": (1e-9, 1e-12),
    "mitsubishi": (1e-6, 1e-9), "denso": (1e-6, 1e-9), "epson": (1e-6, 1e-9), "comau": (1e-6, 1e-9),
}  # fmt: skip
BACKUPS = {
    "kuka": (CONFIG, {"tool": 1}), "abb": (RAPID, {"tool": "tGrip"}), "fanuc": (VA, {"tool": 1}),
    "ur": ("def p():\n  x=1\n  set_tcp(p[0,0,0.1,0,0,0]) # old\n  movej(q)\nend\n", {}),
    "yaskawa": (TOOL_CND, {"tool": 1}),
    "kawasaki": (AS, {"tool": "t1"}), "staubli": (DTX, {"tool": "tTool[0]"}),
    "mitsubishi": ("' Tool (1,2,3,4,5,6)\n10 Tool (0,0,100.5,0,0,0) ' old\n20 Mov P1\n"
                   "P1=(1,2,3,4,5,6)(7,0)\n", {}),
    "denso": ("' Tool 1, P(9,9,9,0,0,0)\nTakeArm\n  Tool 1, P(0, 0, 120, 0, 0, 0)\nTool 2, P(1,2,3,4,5,6)\n"
              "Work 1, P(7,7,7,0,0,0)\n", {"tool": 1}),
    "epson": ("Function main\n  TLSet 1, XY(0, 0, 120, 0, 0, 0)\n  TLSet 2, XY(1,2,3,4,5,6)\n"
              "  Local 1, XY(7,7,7,0,0,0)\nFend\n", {"tool": 1}),
    "comau": ("PROGRAM a NOHOLD\nBEGIN\n  -- $TOOL := POS(9, 9, 9, 0, 0, 0, '')\n"
              "  $TOOL := POS(0, 0, 120, 0, 0, 0, '') -- old\n  $UFRAME := POS(1,2,3,4,5,6,'')\nEND a\n", {}),
}  # fmt: skip
SESSION: Session = parse_session(
    {
        "format": "scancell-session/1",
        "name": "Zelle „4“",
        "cell": {"pose_convention": "kuka", "robot": {"arm": "ur10e"}},
    }
)


def results(tool: RigidTransform = TOOL, verdict: str = "pass") -> dict[str, Any]:
    common = {
        "verdict": verdict,
        "warnings": [],
        "software": "test",
        "inputs_sha256": "ab" * 32,
        "covariance": COVARIANCE,
        "method": "test",
        "arm_model": {
            "names": ["joint_2_zero_deg"],
            "values": [0.1],
            "sigmas": [0.02],
            "held_out_rms_mm": [1.0, 0.5],
            "worth_it": True,
        },
        "residuals": [],
        "variance_components": {
            "point_sigma_mm": 0.02,
            "position_sigma_mm": 0.05,
            "orientation_sigma_rad": 1e-4,
            "orientation_sigma_deg": 0.006,
        },
    }
    cube = (np.eye(3) * 1e-4).tolist()
    tcp = common | {
        "stage": "tcp",
        "tool0_from_laser": tool.to_rows(),
        "sphere_center_in_base_mm": [1500.0, 20.0, 600.0],
        "sphere_center_covariance": cube,
        "two_step": {},
        "surface_rms_mm": 0.02,
        "leave_one_out_surface_rms_mm": None,
        "center_scatter_rms_mm": 0.03,
    }
    table = common | {
        "stage": "turntable", "base_from_turntable": TABLE.to_rows(), "direction": 1, "mounts": [],
        "axis_direction_in_base": TABLE.rotation[:, 2].tolist(), "axis_direction_covariance": cube,
        "axis_point_in_base_mm": TABLE.translation_mm.tolist(), "axis_point_covariance": cube,
        "axis_direction_sigma_deg": 0.01, "axis_point_sigma_mm": 0.02, "angle_sigma_deg": 0.003,
        "encoder_scale": {"error": 0.0, "sigma": 1e-4, "applied": False},
        "radial_rms_mm": 0.01, "axial_rms_mm": 0.01, "angle_rms_deg": 0.002, "tool0_from_laser": tool.to_rows(),
    }  # fmt: skip
    return {"tcp": tcp, "turntable": table}


def near(pose: RigidTransform, expected: RigidTransform, brand: str) -> None:
    position, rotation = DIGITS[brand]
    np.testing.assert_allclose(pose.translation_mm, expected.translation_mm, atol=position, rtol=0)
    np.testing.assert_allclose(pose.rotation, expected.rotation, atol=rotation, rtol=0)


@pytest.mark.parametrize("tool", [TOOL, LOCKED], ids=["any", "gimbal lock"])
@pytest.mark.parametrize("brand", sorted(DIGITS))
def test_a_brands_export_is_read_back(brand: str, tool: RigidTransform) -> None:
    content, entry = export(SESSION, results(tool), brand, date="2026-11-21")
    found = read_controller_files({f"x{entry.suffix}": content}, brand)
    assert [row.reason for row in found.skipped if "calculat" not in row.reason] == []
    assert len(found.tools) == 1
    near(parse_pose(found.tools[0].convention, found.tools[0].pose), tool, brand)
    if brand not in ("ur", "mitsubishi"):
        assert len(found.frames) == 1
        near(parse_pose(found.frames[0].convention, found.frames[0].pose), TABLE, brand)
    assert content.isascii()
    if brand != "yaskawa":  # which has a name alone
        text = " ".join(content.decode().replace("!", " ").split())
        assert "abababababababab" in text
        assert "2026-11-21" in text


@pytest.mark.parametrize("brand", sorted(BACKUPS))
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_a_backup_is_patched_in_one_entry_alone(brand: str, ends: str) -> None:
    text, chosen = BACKUPS[brand]
    backup = text.replace("\n", ends).encode() + "äöü".encode("latin-1") * (brand not in ("staubli", "ur"))
    content, _ = export(SESSION, results(), brand, settings=chosen, backup=backup)
    before, after = backup.split(ends.encode()), content.split(ends.encode())
    assert len(before) == len(after)
    changed = [i for i, (one, other) in enumerate(zip(before, after, strict=True)) if one != other]
    assert 1 <= len(changed) <= (2 if brand == "fanuc" else 1)  # its numbers stand in two lines
    found = {t.number: t for t in read_controller_files({"b": content}, brand).tools if t.group == 1}
    tool = found[chosen["tool"]] if chosen else next(iter(found.values()))
    near(parse_pose(tool.convention, tool.pose), TOOL, brand if brand != "kawasaki" else "fanuc")
    again, _ = export(SESSION, results(), brand, settings=chosen, backup=content)
    assert again == content


def test_load_data_beside_a_patched_tool_stay() -> None:
    content, _ = export(SESSION, results(), "abb", settings={"tool": "tGrip"}, backup=RAPID.encode())
    assert b"[0.5,[0,0,92],[1,0,0,0],1,2,3]];" in content
    assert b"robhold TRUE" not in content
    table, _ = export(SESSION, results(), "yaskawa", settings={"frame": 2}, backup=UFRAME_CND.encode())
    near(parse_pose("yaskawa", read_controller_files({"b": table}).frames[0].pose), TABLE, "yaskawa")
    installation = b'<Installation><TCPs><tcp name="a"><tcpTransform>0,0,0,0,0,0</tcpTransform></tcp>\
<tcp name="b"><tcpTransform>0,0,0.1,0,0,0</tcpTransform></tcp></TCPs></Installation>'
    packed, _ = export(SESSION, results(), "ur", settings={"tool": "b"}, backup=gzip.compress(installation))
    tools = read_controller_files({"default.installation": packed}).tools
    near(parse_pose("ur", tools[1].pose), TOOL, "ur")
    assert tools[0].pose == (0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("brand", "chosen", "backup", "match"),
    [
        ("kuka", {"tool": 9}, CONFIG, r"TOOL_DATA\[9\]"),
        ("kuka", {"tool": 2}, CONFIG, "#TCP"),
        ("abb", {"tool": "tStand"}, RAPID, "robhold FALSE"),
        ("abb", {"tool": "tGrip", "frame": "wTurn", "part": "both"}, RAPID, "ufprog"),
        ("fanuc", {"tool": 2}, VA, "not set"),
        ("fanuc", {"tool": 7}, VA, r"MNUTOOL\[1,7\]"),
        ("ur", {}, SCRIPT + SCRIPT, "2 of them"),
        ("yaskawa", {"tool": 5}, TOOL_CND, "TOOL 5"),
        ("kawasaki", {"tool": "nothing"}, AS, "transformation nothing"),
        ("staubli", {"tool": "fTable"}, DTX, "fTable"),
        ("json", {}, "{}", "export that can change a backup"),
        ("kuka", {"tool": "x"}, CONFIG, "settings of 'kuka'"),
        ("kuka", {"color": 1}, CONFIG, "settings of 'kuka'"),
    ],
)
def test_what_cannot_be_patched_is_refused(brand: str, chosen: dict[str, Any], backup: str, match: str) -> None:
    with pytest.raises(InputError, match=match):
        export(SESSION, results(), brand, settings=chosen, backup=backup.encode())


@pytest.mark.parametrize("entry", list(all_exports()), ids=lambda e: e.name)
def test_a_stale_or_failed_answer_is_refused_unless_allowed_and_then_marked(entry: Any) -> None:
    if "check" in entry.name:
        return  # refused whatever is allowed, see below: the robot would move
    with pytest.raises(ConflictError, match="allow stale"):
        export(SESSION, results(), entry.name, stale=["tcp"], allow=())
    with pytest.raises(ConflictError, match="allow stale,fail"):
        export(SESSION, results(verdict="fail"), entry.name, allow=["stale"])
    marked, _ = export(SESSION, results(verdict="fail"), entry.name, allow=["fail"])
    fresh, _ = export(SESSION, results(), entry.name, allow=())
    assert (
        b"not_to_be_used" in marked.lower().replace(b" ", b"_").replace(b"-", b"_")
        or b"DO-NOT-USE" in marked
        or (b"DO_NOT_USE" in marked.replace(b" ", b"_"))
    )
    assert marked != fresh


def test_every_export_describes_itself() -> None:
    names = [entry.name for entry in all_exports()]
    assert len(names) == len(set(names))
    assert {"json", "kuka", "abb", "fanuc", "ur", "yaskawa", "staubli", "kawasaki"} <= set(names)
    for entry in all_exports():
        described = entry.describe()
        assert described["settings"]["type"] == "object"
        assert entry.brand == "" or entry.brand in BRANDS.names()


def test_public_parsers_read_the_exports_of_no_brand(tmp_path: Any) -> None:
    import cv2
    import yaml
    from scipy.spatial.transform import Rotation

    expected = {"laser": TOOL, "turntable": TABLE}

    def near_ros(child: str, position_m: list[float], quaternion: list[float]) -> None:
        np.testing.assert_allclose(np.array(position_m) * 1000, expected[child].translation_mm, atol=1e-9)
        rotation = Rotation.from_quat(quaternion).as_matrix()
        np.testing.assert_allclose(rotation, expected[child].rotation, atol=1e-12)

    for row in yaml.safe_load(export(SESSION, results(), "ros2-yaml")[0])["transforms"]:
        t, q = row["transform"]["translation"], row["transform"]["rotation"]
        near_ros(row["child_frame_id"], [t[a] for a in "xyz"], [q[a] for a in "xyzw"])
    for document in yaml.safe_load_all(export(SESSION, results(), "moveit")[0]):
        t = document["transform"]
        near_ros(
            document["parameters"]["tracking_base_frame"], [t[a] for a in "xyz"], [t["q" + a] for a in "xyzw"]
        )
    launch = export(SESSION, results(), "ros2-launch")[0].decode()
    compile(launch, "x.launch.py", "exec")
    for part in launch.split("arguments=")[1:]:
        words = part[part.index("[") + 1 : part.index("]")].replace("'", "").replace('"', "").split(",")
        a = dict(zip((w.strip() for w in words[::2]), (w.strip() for w in words[1::2]), strict=False))
        values = [float(a[f"--{n}"]) for n in ("x", "y", "z", "qx", "qy", "qz", "qw")]
        near_ros(a["--child-frame-id"], values[:3], values[3:])
    file = tmp_path / "x.yaml"
    file.write_bytes(export(SESSION, results(), "opencv")[0])
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_READ)
    np.testing.assert_allclose(storage.getNode("tool0_from_laser").mat(), TOOL.matrix, atol=1e-12)
    np.testing.assert_allclose(storage.getNode("base_from_turntable").mat(), TABLE.matrix, atol=1e-12)
    storage.release()
    lines = [line for line in export(SESSION, results(), "csv")[0].decode().splitlines() if line[0] != "#"]
    table = np.genfromtxt(lines, delimiter=",", names=True)
    np.testing.assert_allclose([table["x_mm"][0], table["qw"][1]], [TOOL.translation_mm[0], _w(TABLE)], atol=1e-12)


def _w(frame: RigidTransform) -> float:
    from scipy.spatial.transform import Rotation

    return float(abs(Rotation.from_matrix(frame.rotation).as_quat()[3]))


def test_urdf_joints_are_the_frames() -> None:
    from xml.etree import ElementTree

    from scipy.spatial.transform import Rotation

    root = ElementTree.fromstring(export(SESSION, results(), "urdf", settings={"scanner": 'l"&<a'})[0])
    joints = {joint.find("child").attrib["link"]: joint.find("origin").attrib for joint in root.iter("joint")}  # type: ignore[union-attr]
    for child, expected in (('l"&<a', TOOL), ("turntable", TABLE)):
        place = np.array(joints[child]["xyz"].split(), dtype=float) * 1000
        angles = np.array(joints[child]["rpy"].split(), dtype=float)
        np.testing.assert_allclose(place, expected.translation_mm, atol=1e-9)
        np.testing.assert_allclose(Rotation.from_euler("xyz", angles).as_matrix(), expected.rotation, atol=1e-12)


_ACTIVE = ("ur", "mitsubishi", "comau")  # whose check moves use the tool that is active
_CHECKS = [entry.name for entry in all_exports() if entry.name.endswith("-check-move")]


def test_every_brand_with_an_export_has_a_check_move() -> None:
    assert {name.removesuffix("-check-move") for name in _CHECKS} == set(DIGITS)


@pytest.mark.parametrize("name", _CHECKS)
def test_a_check_move_brings_the_light_plane_to_the_sphere(name: str, turntable_results: Any) -> None:
    session, solved = turntable_results
    brand = name.removesuffix("-check-move")
    stage = "chain" if "chain" in solved else "tcp"
    tool = RigidTransform.from_rounded(solved[stage]["tool0_from_laser"], "tool0", "laser")
    plan = json.loads(export(session, solved, "check-move")[0])
    content, entry = export(session, solved, name)
    chosen: dict[str, Any] = {"tool": "tScanner"} if brand in ("abb", "kawasaki", "staubli") else {"tool": 1}
    tool_file, tool_entry = export(
        session, solved, brand, settings={"part": "tool"} if brand in _ACTIVE else chosen
    )
    files = {f"check{entry.suffix}": content, f"tool{tool_entry.suffix}": tool_file}
    if brand in _ACTIVE:  # the tool is set before
        lines = [
            line for line in tool_file.splitlines() if b"set_tcp" in line or re.match(rb"\s*\$?tool\b", line, re.I)
        ]
        files = {f"check{entry.suffix}": lines[-1] + b"\n" + content}
    found = read_controller_files(files, brand)
    assert len(found.poses) == (9 if brand in ("kuka", "ur", "denso", "epson", "comau") else 6)
    assert not any(pose.doubt and "tool" in pose.doubt for pose in found.poses)
    center, point = np.array(plan["sphere_center_in_base_mm"]), np.array(plan["point_in_laser_mm"])
    np.testing.assert_allclose(center, solved[stage]["sphere_center_in_base_mm"])
    assert point[1] == 0
    assert np.linalg.norm(point) > 50
    tolerance = {"fanuc": 0.02, "yaskawa": 0.01}.get(brand, 1e-4)
    distances = []
    for pose in found.poses:  # read back as flange poses: the tool is applied by our reader
        assert pose.pose is not None
        base_from_laser = parse_pose(pose.convention, pose.pose).matrix @ tool.matrix
        distances.append(float(np.linalg.norm(base_from_laser[:3, :3] @ point + base_from_laser[:3, 3] - center)))
    on = sorted(distances)
    assert max(on[:3]) < tolerance
    np.testing.assert_allclose(on[3:], 150.0, atol=tolerance)
    if entry.suffix == ".zip":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            content = b"\n".join(archive.read(file) for file in archive.namelist())
    said = " ".join(re.sub(r"[!;'\r\n]|\d+:", " ", content.decode()).split())
    assert "reduced speed" in said
    assert "the scanner should show a circle" in said
    stops = r"\bHALT\b|\bStop;|\bPAUSE\b|\bpopup\(|\bHlt\b|\bHold \"|\bget\(\)"
    of_tool = {"ur": 2, "kuka": 2, "abb": 1, "denso": 6, "kawasaki": 1, "mitsubishi": 1}.get(
        brand, 0
    )  # where the controller's tool is not the answer
    assert len(re.findall(stops, content.decode(), re.IGNORECASE)) == 9 + of_tool
    assert "the tool that must be active" in said


@pytest.mark.parametrize(
    ("name", "asked"),
    [
        ("ur-check-move", "get_tcp_offset()"),
        ("kuka-check-move", "ABS(TOOL_DATA[1].X-("),
        ("abb-check-move", "Distance(tScanner.tframe.trans,["),
        ("comau-check-move", "POS_INV($TOOL)"),
        ("denso-check-move", "PosX(ToolPos(1))"),
        ("epson-check-move", "CX(TLSet(1))"),
        ("kawasaki-check-move", "DECOMPOSE sc_off[0] = -tScanner+TRANS("),
        ("mitsubishi-check-move", "POFF = P_Tool\r\nPOFF = Inv(POFF)\r\nPOFF = POFF * PTOOL"),
    ],
)
def test_a_check_move_ends_where_the_controllers_tool_is_another(
    name: str, asked: str, turntable_results: Any
) -> None:
    session, solved = turntable_results
    program = export(session, solved, name)[0].decode()
    moves = r"movel\(|MoveL |^LIN |^ *MOVE LINEAR|^ *Move |^ *LMOVE|^Mvs "
    first_move = re.search(moves, program, re.MULTILINE)
    assert first_move is not None
    before = program[: first_move.start()]
    assert asked in before
    assert re.search(r"is not the calibrated|calibrated tool is|goes on with no other", before)
    assert re.search(r"\bhalt\b|\bRETURN\b|\bExit (Sub|Function)|\bELSE\b|GoTo \*CHECK", before, re.IGNORECASE)
    numbers = np.array(re.findall(r"-?\d+\.\d+", re.sub(r"(?m)^ *(--|;|!|'|#).*$", "", before)), dtype=float)
    tool_mm = np.array(solved["chain" if "chain" in solved else "tcp"]["tool0_from_laser"])[:3, 3]
    scale = 1e-3 if name.startswith("ur") else 1.0
    assert all(np.abs(numbers - scale * place).min() < 1e-6 for place in tool_mm)  # it is held against the answer


def test_fanucs_check_move_ends_at_another_tool(turntable_results: Any) -> None:
    """Its conditions are worked out here for the tool as entered, and for others that are off by a little."""
    session, solved = turntable_results
    program = export(session, solved, "fanuc-check-move")[0].decode()
    before = program[: re.search(r"^ *\d+:L ", program, re.MULTILINE).start()]  # type: ignore[union-attr]
    assert "PR[100]=UTOOL[1]" in before
    conditions = re.findall(r"IF \((.*)\),JMP LBL\[99\]", before)
    label = program.index("LBL[99] ;", len(before))
    assert program.index("ABORT", label) < program.index("/POS")
    tool = RigidTransform.from_rounded(
        solved["chain" if "chain" in solved else "tcp"]["tool0_from_laser"], "tool0", "laser"
    )
    entered = np.round(to_pose("fanuc", tool), 3)

    def ends(numbers: np.ndarray) -> bool:
        values = {f"PR[100,{axis}]": f"({number})" for axis, number in enumerate(numbers, start=1)}
        said = [re.sub(r"PR\[100,\d\]", lambda found: values[found[0]], one) for one in conditions]
        return any(eval(one.replace("AND", "and")) for one in said)

    assert not ends(entered)
    for axis in range(6):
        for by in (-0.1, 0.1):
            off = entered + by * np.eye(6)[axis]
            off[3:] = (off[3:] + 180.0) % 360.0 - 180.0
            assert ends(off)
    for turned in (179.999, -179.999, 180.0, -180.0):
        lines = tool_check(1, 100, [1.0, 2.0, 3.0, turned, 0.0, 0.0])
        conditions = [one for line in lines for one in re.findall(r"IF \((.*)\),JMP", line)]
        assert not any(ends(np.array([1.0, 2.0, 3.0, other, 0.0, 0.0])) for other in (179.99, -179.99))
        assert ends(np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0]))
        assert ends(np.array([1.0, 2.0, 3.0, -179.9, 0.0, 0.0]))
        assert ends(np.array([1.0, 2.0, 3.0, 179.9, 0.0, 0.0]))


def test_a_check_move_is_refused_for_what_nobody_should_move_by(turntable_results: Any) -> None:
    session, solved = turntable_results
    with pytest.raises(ConflictError):
        export(session, solved, "check-move", stale=["tcp", "chain"], allow=["stale"])
    with pytest.raises(InputError, match="settings"):
        export(session, solved, "check-move", settings={"approach_mm": 5})
    few = session.model_copy(update={"captures": []})
    with pytest.raises(InputError, match="captures"):
        export(few, solved, "check-move")
