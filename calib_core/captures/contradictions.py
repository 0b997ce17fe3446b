"""Captures that are kept but not used, because their records contradict each other or the cell."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from calib_core.captures.content import pose_of
from calib_core.errors import InputError
from calib_core.frames import RigidTransform, vector_from_rotation
from calib_core.poses.identity import AGREE_DEG, AGREE_MM, identity_by_joints
from calib_core.records import Capture, Cell


def require_arrangement(cell: Cell) -> None:
    """Raise InputError where the cell's arrangement is one that nothing solves yet."""
    if cell.arrangement != "scanner-on-robot":
        raise InputError(
            "a cell whose arrangement is 'scanner-on-robot'",
            f"'{cell.arrangement}', which is not supported yet",
            "Put the scanner on the robot and let the sphere stand still, or wait for a later version.",
            "cell.arrangement",
        )


def unfit(cell: Cell, captures: Sequence[Capture]) -> dict[str, str]:
    """Return by id why captures of one step are not used: taken while moving, or otherwise than most.

    Poses are of one tool in one frame only where the controller had the same ones active; those of the minority
    are of another.  Joints that do not give the pose of a named arm mean that one of the two is another capture's;
    where that is so of most, the arm is at fault, and none is left out for it.

    Raises
    ------
    InputError
        If the arrangement is not supported yet, or the arm is unknown.
    """
    require_arrangement(cell)
    found: dict[str, str] = {}
    for capture in captures:
        if capture.moving and capture.kind != "sweep":
            found[capture.id] = "the robot was moving, and a single capture needs it to stand still"
        elif capture.scanner is not None and cell.scanners and capture.scanner not in cell.scanners:
            names = ", ".join(sorted(cell.scanners))
            found[capture.id] = f"its scanner {capture.scanner} is none of the cell's ({names})"
    for field, name in (("active_tool", "tool"), ("active_frame", "frame"), ("scanner", "scanner")):
        for one, (own, usual) in _minority(captures, field).items():
            found.setdefault(one, f"its {name} is {own}, that of most captures of its step {usual}")
    for one, apart in _not_by_joints(cell, captures).items():
        found.setdefault(one, apart)
    return found


def _minority(captures: Sequence[Capture], field: str) -> dict[str, tuple[Any, Any]]:
    """Return the captures whose value of a field is not that of most, with both; those without one are left."""
    values = {c.id: getattr(c, field) for c in captures if getattr(c, field) is not None}
    if len(set(values.values())) < 2:
        return {}
    usual = Counter(values.values()).most_common(1)[0][0]
    return {name: (value, usual) for name, value in values.items() if value != usual}


def told_by_joints(cell: Cell, captures: Sequence[Capture]) -> str | None:
    """Return whose the poses are, or that joints and poses contradict each other, where they are not the flange's.

    Raises
    ------
    InputError
        If the arm is unknown, or a capture lacks a joint.
    """
    told = _with_joints(cell, captures)
    pairs = list(told.values())
    found = identity_by_joints([pose for pose, _ in pairs], [by_joints for _, by_joints in pairs])
    if found is None and 2 * len(apart := _apart_by_joints(told)) > len(told):
        return (
            f"The joints of {len(apart)} of {len(told)} captures do not give their poses. Check the arm "
            "(cell.robot.arm), the joints' order and signs, and the pose convention."
        )
    if found is None or found.of_flange:
        return None
    to_do = (
        "The answer is of these poses: give those of the flange, or enter the tool in the controller as they do."
    )
    return f"{found.sentence} {to_do}"


def _not_by_joints(cell: Cell, captures: Sequence[Capture]) -> dict[str, str]:
    """Return the captures whose joints give another pose than theirs; none where that is so of most."""
    told = _with_joints(cell, captures)
    found = _apart_by_joints(told)
    return found if 2 * len(found) <= len(told) else {}


def _apart_by_joints(told: dict[str, tuple[RigidTransform, RigidTransform]]) -> dict[str, str]:
    """Return by capture how far its joints put the flange from its pose, where that is not an arm's error."""
    found: dict[str, str] = {}
    for name, (pose, by_joints) in told.items():
        shift_mm = float(np.linalg.norm(pose.translation_mm - by_joints.translation_mm))
        turn = vector_from_rotation(by_joints.rotation.T @ pose.rotation)
        turn_deg = float(np.rad2deg(np.linalg.norm(turn)))
        if shift_mm > AGREE_MM or turn_deg > AGREE_DEG:
            found[name] = (
                f"its joints put the flange {shift_mm:.0f} mm and {turn_deg:.1f}° from its pose: "
                "one of the two is another capture's"
            )
    return found


def _with_joints(cell: Cell, captures: Sequence[Capture]) -> dict[str, tuple[RigidTransform, RigidTransform]]:
    """Return by capture its pose, and the flange's by its joints; nothing where no arm is named."""
    if cell.robot.arm is None:
        return {}
    from calib_core.arms.kinematics import arm_of, flange_of_joints

    arm = arm_of(cell.robot.arm)
    found: dict[str, tuple[RigidTransform, RigidTransform]] = {}
    for capture in captures:
        if (capture.joints_deg or capture.joints_mm) and capture.pose is not None:
            try:
                by_joints = flange_of_joints(arm, capture.joints_deg or [], capture.joints_mm)
            except InputError as error:
                raise error.at(capture.id) from None
            found[capture.id] = (pose_of(cell, capture), by_joints)
    return found
