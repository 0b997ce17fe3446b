"""All ways in which an arm of six joints can stand in a pose: closed form, for wrists whose axes meet in a point.

The arm is a product of exponentials about its axes at zero, so that a table, a named arm and a URDF are alike.
Three problems of one axis each are all there is (Paden, 1986): by which angle a point turns onto another, to a
given height, and to a given distance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.arms.kinematics import flange_of_joints, joint_lines
from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.records import ArmTable

_MEET_MM, _SQUARE = 1e-3, 1e-6
_BEYOND = 1e-9  # of a cosine: a pose on the edge of what can be reached is reached
_SINGULAR = 1e-4  # rad: wrists so nearly straight turn their fourth and sixth joint against each other
_LEFT_MM = 1e-3


@dataclass(frozen=True)
class Branch:
    """One way to stand in a pose.

    Parameters
    ----------
    joints_deg : tuple of float
        Each from −180 to 180.
    front : bool
        Whether the wrist's centre is in front of the first axis.
    up : bool
        Whether it is on the near side of the line from the second axis to the third: the elbow is up, in front.
    """

    joints_deg: tuple[float, ...]
    front: bool
    up: bool


def branches_of_pose(arm: ArmTable, pose: RigidTransform, upright_deg: Sequence[float]) -> list[Branch]:
    """Return up to eight ways in which an arm stands in a pose, none where it cannot or its wrist is straight.

    Parameters
    ----------
    arm : ArmTable
    pose : RigidTransform
        base_from_tool0.
    upright_deg : sequence of float
        Joints at which the upper arm stands upright and the forearm points to the front: it says what front is.

    Raises
    ------
    InputError
        If the arm has no six turning joints whose last three meet in a point and whose second and third are
        parallel, at right angles to the first.
    """
    at = _Geometry.of(arm, upright_deg)
    wrist = pose.apply(at.wrist_in_flange)
    found: list[Branch] = []
    for back in _to_height(at.axes[0], wrist - at.points[0], at.axes[1], at.beside):
        first, place = -back, at.points[0] + _turned(at.axes[0], back) @ (wrist - at.points[0])
        for third in _to_distance(at, float(np.linalg.norm(place - at.points[1]))):
            folded = at.points[2] + _turned(at.axes[2], third) @ (at.wrist - at.points[2])
            second = _onto(at.axes[1], folded - at.points[1], place - at.points[1])
            arms = _turned(at.axes[0], first) @ _turned(at.axes[1], second) @ _turned(at.axes[2], third)
            left = arms.T @ pose.rotation @ at.flange.T
            for fourth, fifth, sixth in _wrist(at.axes, left):
                joints = at.readings((first, second, third, fourth, fifth, sixth))
                reached = flange_of_joints(arm, joints)
                if np.linalg.norm(reached.translation_mm - pose.translation_mm) < _LEFT_MM:
                    found.append(Branch(joints, at.is_front(place), at.is_up(folded)))
    return found


@dataclass(frozen=True, eq=False)
class _Geometry:
    """The arm with all joints at zero: points on its axes (6, 3), their directions, wrist, flange (3, 3).

    `beside` is how far the wrist lies along the second axis, `forward` points to the front; `up_sign` is that of
    an elbow that is up.
    """

    arm: ArmTable
    points: FloatArray
    axes: FloatArray
    wrist: FloatArray
    flange: FloatArray
    wrist_in_flange: FloatArray
    beside: float
    forward: FloatArray
    up_sign: float

    @classmethod
    def of(cls, arm: ArmTable, upright_deg: Sequence[float]) -> "_Geometry":
        zero = [0.0] * len(arm.joints)
        points, axes, _ = joint_lines(arm, zero)
        if len(axes) != 6 or any(joint.kind != "revolute" for joint in arm.joints):
            raise _unlike()
        wrist = _meeting(points[3:], axes[3:])
        square = max(abs(float(axes[0] @ axes[1])), abs(float(axes[3] @ axes[4])), abs(float(axes[4] @ axes[5])))
        if wrist is None or square > _SQUARE or float(np.linalg.norm(np.cross(axes[1], axes[2]))) > _SQUARE:
            raise _unlike()
        flange = flange_of_joints(arm, zero)
        beside = float(axes[1] @ (wrist - points[0]))
        up_points, up_axes, _ = joint_lines(arm, upright_deg)
        standing = _meeting(up_points[3:], up_axes[3:])
        assert standing is not None
        forward = np.cross(axes[1], axes[0])
        forward = forward * np.sign(forward @ (standing - up_points[0]))
        bend = float(up_axes[1] @ np.cross(up_points[2] - up_points[1], standing - up_points[2]))
        return cls(
            arm, points, axes, wrist, flange.rotation, flange.inverse().apply(wrist), beside, forward,
            float(np.sign(bend)),
        )  # fmt: skip

    def is_front(self, place: FloatArray) -> bool:
        return float(self.forward @ (place - self.points[0])) > 0

    def is_up(self, folded: FloatArray) -> bool:
        bend = self.axes[1] @ np.cross(self.points[2] - self.points[1], folded - self.points[2])
        return float(bend) * self.up_sign > 0

    def readings(self, angles: Sequence[float]) -> tuple[float, ...]:
        """Return joints' readings, deg, of the angles by which each turns about its axis."""
        found = [float(np.rad2deg(angle)) for angle in angles]
        for place in sorted(
            self.arm.couples
        ):  # its axis turns by sign · reading + the other's reading, times sign
            found[place] -= self.arm.joints[place].sign * found[self.arm.couples[place]]
        return tuple((value + 180.0) % 360.0 - 180.0 for value in found)


def _unlike() -> InputError:
    need = "an arm whose last three axes meet in a point and whose second and third are parallel"
    return InputError(need, "something else", "Record the joints with the poses.", "cell.robot.arm")


def _meeting(points: FloatArray, axes: FloatArray) -> FloatArray | None:
    """Return the point at which lines meet; None if they do not."""
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    found = np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points))
    return found if np.linalg.norm(across @ (found - points)[:, :, None], axis=1).max() < _MEET_MM else None


def _turned(axis: FloatArray, angle: float) -> FloatArray:
    return rotation_from_vector(axis * angle)


def _onto(axis: FloatArray, start: FloatArray, end: FloatArray) -> float:
    """Return by which angle about an axis through the origin one point turns onto another."""
    return float(np.arctan2(axis @ np.cross(start, end), start @ end - (axis @ start) * (axis @ end)))


def _to_height(axis: FloatArray, start: FloatArray, along: FloatArray, height: float) -> list[float]:
    """Return the angles by which a point turns to a height along a direction; none where it does not get there."""
    steady = float(axis @ along) * float(axis @ start)
    cosine, sine = float(along @ start) - steady, float(along @ np.cross(axis, start))
    size, wanted = float(np.hypot(cosine, sine)), height - steady
    if size < 1e-12 or abs(wanted) > size * (1 + _BEYOND):
        return []
    middle, away = np.arctan2(sine, cosine), np.arccos(np.clip(wanted / size, -1.0, 1.0))
    return sorted({float(middle + away), float(middle - away)})


def _to_distance(at: _Geometry, distance: float) -> list[float]:
    """Return the third joint's angles at which the wrist is so far from the second axis' point."""
    between, start = at.points[1] - at.points[2], at.wrist - at.points[2]
    wanted = 0.5 * (float(between @ between) + float(start @ start) - distance**2)
    return _to_height(at.axes[2], start, between, wanted)


def _wrist(axes: FloatArray, left: FloatArray) -> list[tuple[float, float, float]]:
    """Return the last three joints' angles that turn by a rotation (3, 3); none where the wrist is straight."""
    fourth, fifth, sixth = axes[3], axes[4], axes[5]
    end = left @ sixth
    found: list[tuple[float, float, float]] = []
    for bent in _to_height(fifth, sixth, fourth, float(fourth @ end)):
        if np.linalg.norm(np.cross(fourth, end)) < _SINGULAR:
            continue
        turn = _onto(fourth, _turned(fifth, bent) @ sixth, end)
        rest = (_turned(fourth, turn) @ _turned(fifth, bent)).T @ left
        found.append((turn, bent, _onto(sixth, fifth, rest @ fifth)))
    return found
