"""Rows of captures that are kept and not used."""

from typing import Any

import numpy as np

from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.captures.contradictions import unfit
from calib_core.captures.lost_rays import lost_rays
from calib_core.findings import Finding
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.robots import to_pose
from calib_core.stages.pipeline import solve_stage
from tests.every_code.made import CELL, TCP, Case, changed, check, session_of
from tests.plates import reflected

JOINTS = [[10.0 * k, -80.0 + 5 * k, 95.0 - 3 * k, -100.0, 85.0 + k, 20.0 * k] for k in range(6)]


def again(**fields: Any) -> list[dict[str, Any]]:
    """Return the captures of the still sphere, and the third of them once more."""
    return [*TCP, {**TCP[2], "id": "again", **fields}]


def named(*scanners: str) -> Case:
    """Return what is said of captures that name their scanners, in a cell of one named `left`."""
    captures = [{**c, "scanner": name} for c, name in zip(TCP, scanners, strict=False)]
    session = session_of(captures, scanners={"left": {"kind": "profile"}})
    return lambda: unfit(session.cell, session.captures)


def of_two(scanner: str | None) -> Case:
    """Return what is said of captures of which the first names this scanner, in a cell of two."""
    captures = [{**c, "scanner": "left" if k else scanner} for k, c in enumerate(TCP)]
    return check(captures, scanners={"left": {}, "right": {}})


def by_arm(tool_mm: float = 0.0, arm: str = "ur5e", one_mm: float = 0.0) -> Session:
    """Return captures of an ur5e beside its joints, all poses of a tool so long, the fourth shifted by so much."""
    tool = RigidTransform.of(np.zeros(3), np.array([0.0, 0.0, tool_mm]), "tool0", "tool0")
    poses = [to_pose("kuka", flange_of_joints(NAMED_ARMS["ur5e"], joints) @ tool) for joints in JOINTS]
    poses[3][0] += one_mm
    captures = [
        {**capture, "pose": pose, "joints_deg": joints}
        for capture, pose, joints in zip(TCP, poses, JOINTS, strict=False)
    ]
    return session_of(captures, pose_convention="kuka", robot={"arm": arm})


def by_joints(off_mm: float) -> Case:
    """Return what is said of an arm's captures, the pose of one so far from where its joints put the flange."""
    session = by_arm(one_mm=off_mm)
    return lambda: unfit(session.cell, session.captures)


def with_axis(*readings: dict[str, float]) -> Case:
    """Return what a check says where an axis was read in most captures."""
    first = [{**c, "axes_deg": {"tilt": 10.0 * k}} for k, c in enumerate(TCP[: 5 - len(readings)])]
    more = [{**c, **({"axes_deg": read} if read else {})} for c, read in zip(TCP[5:], readings, strict=False)]
    return check([*first, *more], axes=[{"name": "tilt", "kind": "rotary"}])


def plate(shifted_mm: float) -> Case:
    """Return what a plate's captures say, the fourth of them by a pose that is wrong by so much."""
    from tests.every_code.made import made

    def case() -> list[Finding]:
        data = made("plate", 2).session.to_json()
        pose = data["captures"][3]["pose"]
        data["captures"][3]["pose"] = [pose[0] + shifted_mm, pose[1] - shifted_mm, *pose[2:]]
        return list(solve_stage(Session.model_validate(data), "tcp", made("plate", 2).files.__getitem__).findings)

    return case


def with_file(*rows: str) -> Case:
    """Return what the tcp stage says where the first file has these rows, if any, instead of its own."""
    name = TCP[0]["files"][0]
    files = CELL.files | ({name: "\n".join(("x_mm,z_mm", *rows)).encode()} if rows else {})
    return lambda: solve_stage(session_of(TCP[:8]), "tcp", files.__getitem__).findings


def of_reflection(*captures: int) -> Case:
    """Return what the tcp stage says where some captures see the sphere twice."""

    def case() -> list[Finding]:
        session, files, _ = reflected(*captures)
        return list(solve_stage(session, "tcp", files.__getitem__).findings)

    return case


CASES: dict[str, tuple[Case, Case]] = {
    "capture-while-moving": (check(changed(0, moving=True)), check(changed(0, moving=False))),
    "capture-of-unknown-scanner": (named("left", "lft"), named("left", "left")),
    "capture-without-scanner": (of_two(None), of_two("right")),
    "capture-without-axis-reading": (with_axis({}), with_axis({"tilt": 5.0})),
    "capture-of-other-setting": (
        check([{**c, "active_tool": 1 + (k == 0)} for k, c in enumerate(TCP)]),
        check([{**c, "active_tool": 1} for c in TCP]),
    ),
    "capture-joints-apart": (by_joints(5.1), by_joints(4.9)),
    "capture-duplicate": (check(again()), check(again(files=TCP[3]["files"], pose=TCP[3]["pose"])[:-1])),
    "capture-of-no-ball": (plate(35.0), plate(0.0)),
    "capture-not-measured": (with_file(*(f"{x},200.0" for x in range(-40, 40))), with_file()),
    "stripe-beyond-distortion": (lambda: lost_rays(1), lambda: lost_rays(0)),
}
