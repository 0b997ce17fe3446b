"""Joints that do not give their poses: which one change of them, or of the arm, would."""

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from calib_core.arms.errors import joint_readings
from calib_core.arms.kinematics import NAMED_ARMS, arm_of, flange_of_joints
from calib_core.captures.content import pose_of
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.messages import Message, message
from calib_core.poses.identity import AGREE_DEG, AGREE_MM
from calib_core.records import ArmTable, Capture, Cell

_MOST_CAPTURES = 12
_ALIKE = 0.8  # the share of captures that must agree


def likely_joints(cell: Cell, captures: Sequence[Capture]) -> Message | None:
    """Return what makes joints and poses agree, in words; None where no one change does.

    Parameters
    ----------
    cell : Cell
        With an arm.
    captures : sequence of Capture
        Those whose joints contradict their poses, with others of the step.
    """
    arm = arm_of(cell.robot.arm or "")
    both = [one for one in captures if one.pose is not None and one.joints_deg]
    both = [both[n] for n in np.unique(np.linspace(0, len(both) - 1, _MOST_CAPTURES).astype(int))] if both else []
    joints = np.array(
        [joint_readings(arm, one.joints_deg or [], one.joints_mm or []) for one in both], dtype=float
    )
    poses = [pose_of(cell, one) for one in both]
    found = (said for said, table, rows in _readings(arm, joints) if _agree(table, rows, poses))
    return next(found, None) if len(both) > 1 else None


def _agree(arm: ArmTable, rows: FloatArray, poses: Sequence[RigidTransform]) -> bool:
    missed, allowed = 0, (1 - _ALIKE) * len(poses)
    for row, pose in zip(rows.tolist(), poses, strict=True):
        flange = flange_of_joints(arm, row, row)
        turned = np.rad2deg(np.linalg.norm(vector_from_rotation(flange.rotation.T @ pose.rotation)))
        shift = np.linalg.norm(flange.translation_mm - pose.translation_mm)
        missed += int(shift > AGREE_MM or turned > AGREE_DEG)
        if missed > allowed:
            return False
    return True


def _readings(arm: ArmTable, joints: FloatArray) -> Iterator[tuple[Message, ArmTable, FloatArray]]:
    """Give other readings, the likelier mistakes first: in words, the arm, the joints."""
    count = joints.shape[1]
    if np.abs(joints).max() <= 2 * np.pi + 1e-3:
        yield message("joints that are radians"), arm, np.rad2deg(joints)
    for n in range(count):
        turned = joints.copy()
        turned[:, n] *= -1
        yield message("joint {joint} counted the other way", joint=n + 1), arm, turned
    for n in range(count):
        for offset in (90.0, -90.0, 180.0):
            turned = joints.copy()
            turned[:, n] += offset
            yield (
                message("joint {joint} counted from {offset_deg:g}°", joint=n + 1, offset_deg=offset),
                arm,
                turned,
            )
    for one in range(count):
        for other in (one - 1, one + 1):
            for sign in (1.0, -1.0):
                if 0 <= other < count:
                    turned = joints.copy()
                    turned[:, one] += sign * joints[:, other]
                    said = message("joint {joint} moving along with joint {other}", joint=one + 1, other=other + 1)
                    yield said, arm, turned
    orders = [list(range(count))[::-1], [*range(1, count), 0], [count - 1, *range(count - 1)]]
    for one, other in combinations(range(count), 2):
        order = list(range(count))
        order[one], order[other] = other, one
        orders.append(order)
    for order in orders:
        words = " ".join(str(n + 1) for n in order)
        yield message("joints in the order {order}", order=words), arm, joints[:, order]
    for name, table in NAMED_ARMS.items():
        if len(table.joints) == count and table != arm:
            yield message("the arm {arm}", arm=name), table, joints
