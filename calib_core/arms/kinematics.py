"""Forward kinematics: where an arm's joints put its flange, from a named arm or a table of its joints."""

from collections.abc import Sequence

import numpy as np

from calib_core.arms.named import NAMED_ARMS
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import ArmJoint, ArmTable


def arm_of(arm: str | ArmTable) -> ArmTable:
    """Return an arm's table; raises InputError, which lists the arms that are known by name."""
    if isinstance(arm, ArmTable):
        return arm
    known = NAMED_ARMS.get(arm.lower())
    if known is None:
        need = "an arm known by its name, {named_arms}"
        to_do = "Name one of these, or give the arm's Denavit-Hartenberg table."
        raise InputError(need, f"'{arm}'", to_do, "cell.robot.arm", named_arms=", ".join(NAMED_ARMS))
    return known


def flange_of_joints(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None = None
) -> RigidTransform:
    """Return base_from_tool0 at these joints.

    Parameters
    ----------
    arm : ArmTable
    joints_deg : sequence of float
        One reading a joint, in order; of a prismatic one it is not looked at.
    joints_mm : sequence of float, optional
        Readings of prismatic joints, at their places in the same order.

    Raises
    ------
    InputError
        If a joint has no reading.
    """
    matrix = _frames(arm, joints_deg, joints_mm)[-1]
    if arm.last_from_tool0 is not None:
        matrix = matrix @ np.array(arm.last_from_tool0)
    return RigidTransform.from_rounded(matrix.tolist(), "base", "tool0")


def links_mm(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None = None
) -> FloatArray:
    """Return the corners (N, 3) of the line from the base along an arm's links to its flange, in the base, mm.

    A link runs along its joint's axis, then along the common normal to the next one's; the arguments and what is
    raised are those of `flange_of_joints`.
    """
    flange = flange_of_joints(arm, joints_deg, joints_mm)
    corners: list[FloatArray] = []
    frames = _frames(arm, joints_deg, joints_mm)
    for joint, last, after in zip(arm.joints, frames[:-1], frames[1:], strict=True):
        before = _at_joint(last, joint)
        if joint.previous_from_joint is not None:
            corners.append(last[:3, 3])
        # Along x of the frame that follows in the standard convention, of the frame before in the modified one.
        x = after[:3, 0] if arm.convention == "standard" else before[:3, 0]
        bend = after[:3, 3] - joint.a_mm * x if arm.convention == "standard" else before[:3, 3] + joint.a_mm * x
        corners += [before[:3, 3], bend]
    return np.array([*corners, frames[-1][:3, 3], flange.translation_mm])


def joint_lines(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a point (n, 3) on each joint's axis and its direction (n, 3), and the flange (3,), in base, mm.

    The arguments and what is raised are those of `flange_of_joints`.
    """
    at, last = joint_frames(arm, joints_deg, joints_mm)
    signs = np.array([float(joint.sign) for joint in arm.joints])
    return at[:, :3, 3], signs[:, None] * at[:, :3, 2], last[:3, 3]


def joint_frames(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return frames (n, 4, 4) about whose z, times the joint's sign, each joint turns, and the flange's (4, 4).

    In base, mm; the arguments and what is raised are those of `flange_of_joints`.
    """
    frames = _frames(arm, joints_deg, joints_mm)
    after = arm.convention == "modified"
    at = [frames[n + 1] if after else _at_joint(frames[n], joint) for n, joint in enumerate(arm.joints)]
    last = frames[-1] if arm.last_from_tool0 is None else frames[-1] @ np.array(arm.last_from_tool0)
    return np.array(at), last


def _frames(
    arm: ArmTable, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None
) -> list[FloatArray]:
    """Return the frames (4, 4) in the base before the first joint and after each."""
    readings = [
        _reading(joint.kind == "prismatic", place, joints_deg, joints_mm) for place, joint in enumerate(arm.joints)
    ]
    matrix = np.eye(4) if arm.base_from_first is None else np.array(arm.base_from_first)
    frames = [matrix]
    for place, joint in enumerate(arm.joints):
        reading = joint.sign * readings[place]
        if place in arm.couples:
            reading += readings[arm.couples[place]]
        turns = joint.kind == "revolute"
        theta = np.deg2rad(joint.theta_deg + (reading if turns else 0.0))
        d_mm = joint.d_mm + (0.0 if turns else reading)
        alpha = np.deg2rad(joint.alpha_deg)
        matrix = _at_joint(matrix, joint) @ (_standard if arm.convention == "standard" else _modified)(
            theta, d_mm, joint.a_mm, alpha
        )
        frames.append(matrix)
    return frames


def _at_joint(last: FloatArray, joint: ArmJoint) -> FloatArray:
    """Return the frame (4, 4) in which a joint's row begins."""
    return last if joint.previous_from_joint is None else last @ np.array(joint.previous_from_joint)


def _reading(
    prismatic: bool, place: int, joints_deg: Sequence[float | None], joints_mm: Sequence[float | None] | None
) -> float:
    readings = (joints_mm or ()) if prismatic else joints_deg
    value = readings[place] if place < len(readings) else None
    if value is None:
        name = "joints_mm" if prismatic else "joints_deg"
        need = "a reading of each joint of the arm in {name}"
        raise InputError(need, "none of joint {place}", "Add it.", name=name, place=place + 1)
    return float(value)


def _standard(theta: float, d_mm: float, a_mm: float, alpha: float) -> FloatArray:
    """Return Rot_z(θ) Trans_z(d) Trans_x(a) Rot_x(α) (4, 4), the convention of Denavit and Hartenberg (1955)."""
    (c, s), (ca, sa) = (np.cos(theta), np.sin(theta)), (np.cos(alpha), np.sin(alpha))
    return np.array(
        [[c, -s * ca, s * sa, a_mm * c], [s, c * ca, -c * sa, a_mm * s], [0, sa, ca, d_mm], [0, 0, 0, 1]]
    )


def _modified(theta: float, d_mm: float, a_mm: float, alpha: float) -> FloatArray:
    """Return Rot_x(α) Trans_x(a) Rot_z(θ) Trans_z(d) (4, 4), the convention of Craig (1986)."""
    (c, s), (ca, sa) = (np.cos(theta), np.sin(theta)), (np.cos(alpha), np.sin(alpha))
    return np.array(
        [[c, -s, 0, a_mm], [s * ca, c * ca, -sa, -sa * d_mm], [s * sa, c * sa, ca, ca * d_mm], [0, 0, 0, 1]]
    )
