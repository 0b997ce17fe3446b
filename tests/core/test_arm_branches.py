"""Joints from poses: every way an arm stands in a pose, and the one that a controller's file tells."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from calib_core.arms.branches import branches_of_pose
from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.errors import InputError
from calib_core.frames import RigidTransform
from calib_core.library.new_session import new_session
from calib_core.poses.numbers import to_pose
from calib_core.robots.backup import read_controller_files
from calib_core.robots.file_hints import Told
from calib_core.robots.yaskawa.pulses import per_degree_of

ZERO, KUKA, STRAIGHT = (0.0,) * 6, (0.0, -90.0, 90.0, 0.0, 0.0, 0.0), (0.0, 0.0, 90.0, 0.0, 0.0, 0.0)
UPRIGHT = {"kr": KUKA, "tx": STRAIGHT, "vs": STRAIGHT, "rs": STRAIGHT}
WITH_WRIST = [name for name in NAMED_ARMS if not name.startswith("ur")]


def drawn(seed: int, count: int) -> list[list[float]]:
    """Joints anywhere, but for wrists that are straight."""
    joints = np.random.default_rng(seed).uniform(-175, 175, (count, 6))
    joints[:, 4] += np.where(np.abs(joints[:, 4]) < 2, 5, 0)
    return joints.tolist()


@pytest.mark.thorough(keep=8)
@pytest.mark.parametrize("name", WITH_WRIST)
def test_every_branch_puts_the_flange_there_and_one_is_the_arm_s(name: str) -> None:
    arm, upright = NAMED_ARMS[name], UPRIGHT.get(name[:2], ZERO)
    assert arm.source
    for joints in drawn(1, 25):
        pose = flange_of_joints(arm, joints)
        branches = branches_of_pose(arm, pose, upright)
        kinds = {(one.front, one.up, one.joints_deg[4] > 0) for one in branches}
        assert len(branches) in (4, 8)
        assert len(kinds) == len(branches)
        for one in branches:
            assert np.abs(flange_of_joints(arm, one.joints_deg).matrix - pose.matrix).max() < 1e-6
        apart = [(np.subtract(one.joints_deg, joints) + 180) % 360 - 180 for one in branches]
        assert min(float(np.abs(one).max()) for one in apart) < 1e-6


def test_a_pose_out_of_reach_has_no_branch_and_other_arms_are_asked_for_their_joints() -> None:
    far = RigidTransform.of(np.eye(3), [5000.0, 0.0, 0.0], "base", "tool0")
    assert branches_of_pose(NAMED_ARMS["irb120"], far, ZERO) == []
    with pytest.raises(InputError, match="Record the joints"):
        branches_of_pose(NAMED_ARMS["ur10e"], far, ZERO)


def wrist_of(name: str, joints: list[float]) -> tuple[bool, bool]:
    """Whether the wrist is in front of axis 1, and before the line of the arm: by lengths as makers draw them."""
    lengths = {
        "irb2600-12/1.65": (150, 700, 115, 795), "kr10-r1100-sixx": (25, 560, 35, 515),
        "m-20ia": (150, 790, 250, 835), "gp25": (150, 760, 200, 795),
    }  # fmt: skip
    a1, a2, a3, d4 = lengths[name]
    lean = joints[1] + (90 if name[0] == "k" else 0)
    fold = {"i": joints[1] + joints[2], "k": joints[1] + joints[2], "m": -joints[2], "g": joints[1] - joints[2]}[
        name[0]
    ]
    upper = a2 * np.array([np.sin(np.deg2rad(lean)), np.cos(np.deg2rad(lean))])
    c, s = np.cos(np.deg2rad(fold)), np.sin(np.deg2rad(fold))
    fore = np.array([d4 * c + a3 * s, -d4 * s + a3 * c])
    return bool(a1 + upper[0] + fore[0] > 0), bool(upper[0] * fore[1] - upper[1] * fore[0] < 0)


def abb_file(rows: list[tuple[str, list[float], RigidTransform]]) -> dict[str, bytes]:
    text = "MODULE m\nPERS tooldata tl:=[TRUE,[[0,0,0],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
    moves = "PROC main()\n"
    for name, joints, pose in rows:
        x, y, z, *q = to_pose("abb", pose)
        front, up = wrist_of("irb2600-12/1.65", joints)
        kind = int(joints[4] < 0) + 2 * (not up) + 4 * (not front)
        cf = [int(np.floor(joints[k] / 90)) for k in (0, 3, 5)]
        numbers = (
            f"[[{x:.3f},{y:.3f},{z:.3f}],[{','.join(f'{v:.8f}' for v in q)}],[{cf[0]},{cf[1]},{cf[2]},{kind}]"
        )
        text += f"CONST robtarget {name}:={numbers},[9E9,9E9,9E9,9E9,9E9,9E9]];\n"
        moves += f"MoveJ {name},v100,fine,tl;\n"
    return {"m.mod": f"{text}{moves}ENDPROC\nENDMODULE\n".encode()}


def kuka_file(rows: list[tuple[str, list[float], RigidTransform]]) -> dict[str, bytes]:
    text = "DEFDAT p\n"
    for name, joints, pose in rows:
        front, up = wrist_of("kr10-r1100-sixx", joints)
        status, turn = int(not front) + 2 * up + 16, sum(1 << k for k in range(6) if joints[k] < 0)
        pairs = zip("XYZABC", to_pose("kuka", pose), strict=True)
        numbers = ",".join(f"{axis} {v:.4f}" for axis, v in pairs)
        text += f"DECL E6POS X{name}={{{numbers},S {status},T {turn}}}\n"
        text += f"DECL FDAT F{name}={{TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE}}\n"
    return {"p.dat": f"{text}ENDDAT\n".encode()}


def fanuc_file(rows: list[tuple[str, list[float], RigidTransform]]) -> dict[str, bytes]:
    text = "/PROG P\n/MN\n/POS\n"
    for k, (_, joints, pose) in enumerate(rows, start=1):
        front, up = wrist_of("m-20ia", joints)
        turns = ", ".join(f"{int(np.ceil((joints[n] - 180) / 360))}" for n in (0, 3, 5))
        letters = f"{'N' if joints[4] < 0 else 'F'} {'U' if up else 'D'} {'T' if front else 'B'}"
        x, y, z, w, p, r = to_pose("fanuc", pose)
        text += f"P[{k}]{{\n   GP1:\n\tUF : 0, UT : 0,\t\tCONFIG : '{letters}, {turns}',\n"
        text += f"\tX = {x:.3f}  mm,\tY = {y:.3f}  mm,\tZ = {z:.3f}  mm,\n"
        text += f"\tW = {w:.4f} deg,\tP = {p:.4f} deg,\tR = {r:.4f} deg\n}};\n"
    return {"p.ls": f"{text}/END\n".encode()}


def yaskawa_file(rows: list[tuple[str, list[float], RigidTransform]]) -> dict[str, bytes]:
    text = f"/JOB\n//NAME A\n//POS\n///NPOS {len(rows)},0,0,0,0,0\n///TOOL 0\n///POSTYPE BASE\n///RECTAN\n"
    for k, (_, joints, pose) in enumerate(rows):
        front, up = wrist_of("gp25", joints)
        flip = abs((joints[3] + 180) % 360 - 180) < 90
        beyond = [int(abs(joints[n]) > 180) for n in (3, 5, 0)]
        stands = [int(not flip), int(not up), int(not front), *beyond, 0, 0]
        text += f"///RCONF {','.join(map(str, stands))}\n"
        text += f"C{k:05d}={','.join(f'{v:.4f}' for v in to_pose('yaskawa', pose))}\n"
    tools = "//TOOL 0\n///NAME \n0.000,0.000,0.000,0.0000,0.0000,0.0000\n"
    return {"a.jbi": f"{text}//INST\nEND\n".encode(), "tool.cnd": tools.encode()}


FILES: dict[str, Any] = {
    "irb2600-12/1.65": abb_file, "kr10-r1100-sixx": kuka_file, "m-20ia": fanuc_file, "gp25": yaskawa_file,
}  # fmt: skip


def rows_of(name: str, seed: int = 3, count: int = 40) -> list[tuple[str, list[float], RigidTransform]]:
    joints = np.array(drawn(seed, count))
    joints[:, 5] += np.random.default_rng(seed).choice([0.0, 0.0, 360.0, -360.0], count)
    joints[:, 5] = np.clip(joints[:, 5], -350, 350)
    return [
        (f"p{k}", row.tolist(), flange_of_joints(NAMED_ARMS[name], row.tolist())) for k, row in enumerate(joints)
    ]


@pytest.mark.parametrize("name", FILES)
def test_joints_follow_from_poses_and_what_the_file_says(name: str) -> None:
    rows = rows_of(name)
    read = read_controller_files(FILES[name](rows), told=Told(arm=name))
    assert len(read.poses) == len(rows)
    known = [(pose.joints_deg, row[1]) for pose, row in zip(read.poses, rows, strict=True) if pose.joints_deg]
    assert len(known) >= 0.95 * len(rows)  # of two in one quadrant, and of poses at an edge, neither is taken
    assert max(float(np.abs(np.subtract(*pair)).max()) for pair in known) < 0.3  # poses are written with 3 digits
    assert any(name in note and "nominal lengths" in note for note in read.notes)


@pytest.mark.parametrize(
    ("name", "smaller"), [("irb2600-12/1.65", "irb120"), ("m-20ia", "lrmate-200id"), ("gp25", "gp8")]
)
def test_poses_that_another_arm_cannot_reach_give_no_joints(name: str, smaller: str) -> None:
    read = read_controller_files(FILES[name](rows_of(name)), told=Told(arm=smaller))
    assert all(pose.joints_deg is None for pose in read.poses)
    assert any("Make sure that it is this arm" in note for note in read.notes)


GP25_GEARS = (19, -3, 1, -10, 3, -80), (2240, 503, 140, 899, 260, 3773)
"""Denominators and numerators of a public backup; below, its soft limits in pulses and the data sheet's, deg."""
GP25_LIMITS = (241449, 295690, 254863, 204573, 147912, 244156), (180, 155, 160, 200, 150, 455)


def parameters(group: int, lines: int) -> str:
    """Return parameters of one robot, as a controller with so many lines of them writes them."""
    values = [0] * (10 * lines)
    for start, gears in zip((1090, 1100) if lines > 200 else (972, 980), GP25_GEARS, strict=True):
        values[start : start + 6] = gears
    rows = "\n".join(",".join(map(str, values[k : k + 10])) for k in range(0, len(values), 10))
    return f"///RC{group}G\n{rows}\n"


def pulses_job(joints: np.ndarray, robot: int = 1) -> bytes:
    per_degree = 4096 * np.abs(np.divide(*reversed(GP25_GEARS))) / 360
    text = f"/JOB\n//NAME A\n//POS\n///NPOS {len(joints)},0,0,0,0,0\n///TOOL 3\n///POSTYPE PULSE\n///PULSE\n"
    rows = [
        f"C{k:05d}={','.join(map(str, row))}\n" for k, row in enumerate(np.rint(joints * per_degree).astype(int))
    ]
    return f"{text}{''.join(rows)}//INST\n///GROUP1 RB{robot}\nNOP\nEND\n".encode()


@pytest.mark.parametrize(("robot", "lines"), [(1, 301), (2, 301), (1, 110)])
def test_pulses_are_joints_where_the_backup_holds_the_gears(robot: int, lines: int) -> None:
    joints = np.array([row[1] for row in rows_of("gp25", count=6)])
    prm = f"//RC YAS\n///CRC 1\n///RCD\n0,0\n{parameters(robot, lines)}///RC9G\n0,0\n//SV YAS\n"
    files = {"a.jbi": pulses_job(joints, robot), "ALL.PRM": prm.encode()}
    read = read_controller_files(files)
    assert [one.name for one in read.poses] == [f"C{k:05d}" for k in range(6)]
    assert np.abs(np.array([one.joints_deg for one in read.poses]) - joints).max() < 1e-3
    assert [one.pose for one in read.poses] == [None] * 6
    assert all("Name the arm" in one.reason for one in read.skipped)
    read = read_controller_files(files, told=Told(arm="gp25"))
    assert not read.skipped
    for one, row in zip(read.poses, joints.tolist(), strict=True):
        right = to_pose("yaskawa", flange_of_joints(NAMED_ARMS["gp25"], row))
        assert np.abs(np.subtract(one.pose or (), right)[:3]).max() < 0.05
    assert any("6 poses follow from their joints by the nominal lengths of gp25" in note for note in read.notes)


def test_gears_of_a_real_arm_put_its_limits_where_its_data_sheet_has_them() -> None:
    per_degree = per_degree_of(parameters(1, 301))[1]
    assert np.divide(GP25_LIMITS[0], per_degree) == pytest.approx(GP25_LIMITS[1], abs=0.01)


def test_pulses_without_parameters_ask_for_them_and_a_job_of_another_robot_takes_none() -> None:
    job = pulses_job(np.array(drawn(1, 2)), 2)
    for files in ({"a.jbi": job}, {"a.jbi": job, "RC.PRM": parameters(1, 301).encode()}):
        read = read_controller_files(files, told=Told(arm="gp25"))
        assert not read.poses
        assert ["ALL.PRM or RC.PRM" in one.reason for one in read.skipped] == [True, True]


def test_without_a_configuration_the_joints_are_asked_for() -> None:
    text = kuka_file(rows_of("kr10-r1100-sixx", count=4))["p.dat"].decode()
    files = {"p.dat": re.sub(r",S \d+,T \d+", "", text).encode()}
    read = read_controller_files(files, told=Told(arm="kr10-r1100-sixx"))
    assert [pose.joints_deg for pose in read.poses] == [None] * 4
    assert any("4 poses stay without joints" in note for note in read.notes)
    read = read_controller_files(files, told=Told(arm="ur10e"))
    assert any("stay without joints" in note for note in read.notes)


def test_a_session_of_files_as_they_lie_has_joints_where_the_arm_is_told(tmp_path: Path) -> None:
    rows = rows_of("m-20ia", count=6)
    (tmp_path / "in").mkdir()
    for name, data in fanuc_file(rows).items():
        (tmp_path / "in" / name).write_bytes(data)
    for k in range(6):
        points = "\n".join(f"{x:.2f} 0 {300 - (x / 10) ** 2:.3f}" for x in np.linspace(-8, 8, 60))
        (tmp_path / "in" / f"scan{k + 1}.xyz").write_text(points)
    made = new_session(tmp_path / "in", tmp_path / "out", arm="m-20ia")
    record = json.loads((tmp_path / "out" / "session.json").read_text())
    assert record["cell"]["robot"]["arm"] == "m-20ia"
    found = [capture["joints_deg"] for capture in record["captures"]]
    assert np.allclose(found, [row[1] for row in rows], atol=0.3)
    assert any("nominal lengths of m-20ia" in note for note in made.notes)
    with pytest.raises(InputError, match="an arm known by its name"):
        new_session(tmp_path / "in", tmp_path / "other", arm="m-99")
