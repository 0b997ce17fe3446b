"""Joints from poses: the configuration nearest to joints that are known, by Newton's method."""

from collections.abc import Sequence

import numpy as np

from calib_core.arms.kinematics import flange_of_joints, joint_lines
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.records import ArmTable

_ROUNDS = 40
_CLOSE_MM, _CLOSE_RAD = 1e-4, 1e-7
_NEAR_MM, _NEAR_RAD = 5.0, np.deg2rad(1.0)
_LONGEST = 0.3  # rad, or 30 mm, of one step


def joints_of_pose(
    arm: ArmTable, pose: RigidTransform, near: Sequence[float]
) -> tuple[FloatArray, float, float] | None:
    """Return the joints (n,), deg or mm, that put the flange there, and what is left, mm and rad; None if none do.

    Parameters
    ----------
    arm : ArmTable
    pose : RigidTransform
        base_from_tool0 as an arm without errors would have it.
    near : sequence of float
        Joints of the same configuration, deg or mm.
    """
    joints = np.array(near, dtype=float)
    slides = np.array([joint.kind == "prismatic" for joint in arm.joints])
    unit = np.where(slides, 1.0, np.deg2rad(1.0))
    left_mm, left_rad = np.inf, np.inf
    for _ in range(_ROUNDS):
        at = flange_of_joints(arm, joints.tolist(), joints.tolist())
        off = np.concatenate(
            [pose.translation_mm - at.translation_mm, vector_from_rotation(pose.rotation @ at.rotation.T)]
        )
        left_mm, left_rad = float(np.linalg.norm(off[:3])), float(np.linalg.norm(off[3:]))
        if left_mm < _CLOSE_MM and left_rad < _CLOSE_RAD:
            break
        points, axes, flange = joint_lines(arm, joints.tolist(), joints.tolist())
        turned = np.concatenate([np.cross(axes, flange - points), axes], axis=1)
        moves = np.where(slides[:, None], np.concatenate([axes, np.zeros_like(axes)], axis=1), turned).T
        weighed = np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])
        square = (moves.T * weighed**2) @ moves
        damping = 1e-9 * np.trace(square) * np.eye(len(joints))
        step = np.linalg.solve(square + damping, (moves.T * weighed**2) @ off)
        size = np.where(slides, 0.01, 1.0) * np.abs(step)
        joints += step * min(1.0, _LONGEST / max(float(size.max()), 1e-12)) / unit
    return (joints, left_mm, left_rad) if left_mm < _NEAR_MM and left_rad < _NEAR_RAD else None
