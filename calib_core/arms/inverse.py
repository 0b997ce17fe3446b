"""Joints from poses: the configuration nearest to joints that are known, by Newton's method."""

from collections.abc import Sequence

import numpy as np

from calib_core.arms.kinematics import flange_of_joints, joint_lines
from calib_core.frames import FloatArray, RigidTransform, skew, vector_from_rotation
from calib_core.records import ArmTable

_ROUNDS = 40
_CLOSE_MM, _CLOSE_RAD = 1e-4, 1e-7
_NEAR_MM, _NEAR_RAD = 5.0, np.deg2rad(1.0)
_AT_ONCE = 25
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


def joints_of_poses(
    arm: ArmTable, rotations: FloatArray, translations: FloatArray, near: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Return the joints (K, 6), deg, of many poses of base_from_tool0 at once, and which of them are reached (K,).

    Parameters
    ----------
    arm : ArmTable
        All of whose joints turn.
    rotations, translations : (K, 3, 3), (K, 3)
    near : (K, 6)
        Joints of the same configuration, deg.
    """
    zero = [0.0] * len(arm.joints)
    (points, axes, place), turned = joint_lines(arm, zero), flange_of_joints(arm, zero).rotation
    along = np.eye(len(zero))  # of each joint's own turn by all readings
    for place_of, other in arm.couples.items():
        along[place_of, other] = arm.joints[place_of].sign
    angles, weights = np.deg2rad(near).copy(), np.array([1.0, 1.0, 1.0, 300.0, 300.0, 300.0])
    off = np.full((len(angles), 6), np.inf)
    for _ in range(_AT_ONCE):
        own = angles @ along.T
        at, origin = np.broadcast_to(np.eye(3), (len(own), 3, 3)), np.zeros((len(own), 3))
        lines: list[tuple[FloatArray, FloatArray]] = []
        for n in range(len(zero)):
            lines.append((at @ axes[n], origin + at @ points[n]))
            about, angle = skew(axes[n]), own[:, n, None, None]
            turn = at @ (np.eye(3) + np.sin(angle) * about + (1 - np.cos(angle)) * (about @ about))
            origin, at = lines[n][1] - turn @ points[n], turn
        reached = origin + at @ place
        off = np.hstack([translations - reached, vector_from_rotation(rotations @ np.swapaxes(at @ turned, 1, 2))])
        if np.all(np.abs(off[:, :3]) < _CLOSE_MM) and np.all(np.abs(off[:, 3:]) < _CLOSE_RAD):
            break
        moves = np.stack([np.hstack([np.cross(axis, reached - point), axis]) for axis, point in lines], axis=2)
        moves = (moves @ along) * weights[:, None]
        square = np.swapaxes(moves, 1, 2) @ moves
        square += 1e-9 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.eye(len(zero))
        step = np.linalg.solve(square, np.swapaxes(moves, 1, 2) @ (off * weights)[:, :, None])[:, :, 0]
        angles += step * np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(axis=1), 1e-12))[:, None]
    missed_mm, missed_rad = np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:], axis=1)
    return np.rad2deg(angles), (missed_mm < 0.01) & (missed_rad < 1e-4)
