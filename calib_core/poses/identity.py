"""Whose poses are: joints and a known arm tell the flange in the base from a tool, or from another frame.

With P a pose, F the flange by the joints, X the base in a frame and T a tool on the flange, P = X · F · T.
Where T alone is not the identity, F⁻¹ · P is the same in every pose; where X alone is not, P · F⁻¹ is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.messages import Message, message

AGREE_MM, AGREE_DEG = 5.0, 1.0
"""A calibrated controller's lengths differ from an arm's nominal ones by less."""

_LEAST_POSES = 3
_MOST_APART = 0.2  # the share of poses that may be other captures'
_TELLING_MM, _TELLING_DEG = 50.0, 10.0  # of the flange's motion: with less, a tool and a frame look alike
_HALF_TURN = np.diag([-1.0, -1.0, 1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Identity:
    """What joints say about poses.

    Parameters
    ----------
    of_flange : bool
        Whether they are of the flange, in the base.
    sentence : Message
        Whose they are, for people.
    tool0_from_tool, base_from_frame : (4, 4) or None
        What they are of, or in, in mm, where it is not the flange or the base.
    """

    of_flange: bool
    sentence: Message
    tool0_from_tool: FloatArray | None = None
    base_from_frame: FloatArray | None = None


def identity_by_joints(poses: Sequence[RigidTransform], by_joints: Sequence[RigidTransform]) -> Identity | None:
    """Return whose poses are, None where the joints do not tell it.

    Parameters
    ----------
    poses : sequence of RigidTransform
        As the controller gave them.
    by_joints : sequence of RigidTransform
        base_from_tool0 of the same moments, by the joints and the arm.
    """
    if len(poses) < _LEAST_POSES or not _moved(by_joints):
        return None
    given = [pose.matrix for pose in poses]
    flange = [pose.matrix for pose in by_joints]
    if _common(given, flange, lambda p, f: np.linalg.inv(f) @ p, np.eye(4)) is not None:
        count = len(poses)
        said = message(
            "The joints of {count} captures give the poses of the flange in the robot's base.", count=count
        )
        return Identity(True, said)
    for turned in (np.eye(4), _HALF_TURN):
        in_base = turned is not _HALF_TURN
        tool = _common(given, flange, lambda p, f, turned=turned: np.linalg.inv(turned @ f) @ p)
        if tool is None:
            continue
        if _near(tool, np.eye(4)):
            return Identity(
                False,
                message(
                    "By the joints, the poses are in a base that is turned by half a turn about z (ROS's "
                    "base_link, or the controller's base)."
                ),
                None,
                turned,
            )
        place = _placed(tool)
        said = (
            message("By the joints, the poses are not of the flange but of a tool on it at {place}.", place=place)
            if in_base
            else message(
                "By the joints, the poses are not of the flange but of a tool on it at {place}, and in a base "
                "that is turned by half a turn about z (ROS's base_link, or the controller's base).",
                place=place,
            )
        )
        return Identity(False, said, tool, None if in_base else turned)
    base = _common(given, flange, lambda p, f: p @ np.linalg.inv(f))
    if base is not None:
        frame = np.array(np.linalg.inv(base), dtype=np.float64)
        said = message(
            "By the joints, the poses are not in the robot's base but in a frame at {place}.", place=_placed(frame)
        )
        return Identity(False, said, None, frame)
    return None


def _moved(by_joints: Sequence[RigidTransform]) -> bool:
    first = by_joints[0].matrix
    shifts = [float(np.linalg.norm(pose.matrix[:3, 3] - first[:3, 3])) for pose in by_joints]
    turns = [_turn_deg(first, pose.matrix) for pose in by_joints]
    return max(shifts) > _TELLING_MM and max(turns) > _TELLING_DEG


def _common(
    given: Sequence[FloatArray],
    flange: Sequence[FloatArray],
    rest: Callable[[FloatArray, FloatArray], FloatArray],
    expected: FloatArray | None = None,
) -> FloatArray | None:
    """Return what is left of most poses, or None where it is not the same (or not what is expected)."""
    left = [rest(p, f) for p, f in zip(given, flange, strict=True)]
    candidates = left if expected is None else [expected]
    best = max(candidates, key=lambda one: sum(_near(one, other) for other in left))
    agree = [one for one in left if _near(best, one)]
    if len(agree) < max(_LEAST_POSES, (1 - _MOST_APART) * len(left)):
        return None
    middle = np.median([one[:3, 3] for one in agree], axis=0)
    return min(agree, key=lambda one: float(np.linalg.norm(one[:3, 3] - middle)))


def _near(one: FloatArray, other: FloatArray) -> bool:
    shift = float(np.linalg.norm(one[:3, 3] - other[:3, 3]))
    return shift <= AGREE_MM and _turn_deg(one, other) <= AGREE_DEG


def _turn_deg(one: FloatArray, other: FloatArray) -> float:
    cosine = (float(np.trace(one[:3, :3].T @ other[:3, :3])) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def _placed(matrix: FloatArray) -> str:
    x, y, z = matrix[:3, 3]
    turn = _turn_deg(np.eye(4), matrix)
    return f"x {x:.0f}, y {y:.0f}, z {z:.0f} mm, {turn:.0f}°"
