"""What exports of no brand share: transforms between named frames, in metres and radians as ROS has them."""

from collections.abc import Iterator

import numpy as np

from calib_core.exports.answer import Answer
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, wanted
from calib_core.frames import RigidTransform
from calib_core.poses.numbers import to_pose
from calib_core.poses.rotations import angles_from_rotation


class FrameSettings(Settings):
    """What the frames are called.

    ROS's `base_link` may be another frame than the controller's base: on a Universal Robots arm the two differ by
    half a turn about z, and the controller's is `base` there.
    """

    base: str = "base"
    flange: str = "tool0"
    scanner: str = "laser"
    turntable: str = "turntable"
    part: Part | None = None


def edges(answer: Answer, settings: FrameSettings) -> Iterator[tuple[str, str, RigidTransform]]:
    """Yield parent, child and parent_from_child of what is to be written."""
    with_tool, with_table = wanted(answer, settings.part, "both")
    if with_tool:
        mount = settings.flange if answer.mount_from_laser.into == "tool0" else settings.base
        yield mount, settings.scanner, answer.mount_from_laser
    if with_table and answer.base_from_turntable is not None:
        yield settings.base, settings.turntable, answer.base_from_turntable


def position_and_quaternion(frame: RigidTransform) -> tuple[list[str], list[str]]:
    """Return position in metres and quaternion xyzw as texts that read back to the last digit."""
    numbers = [repr(v + 0.0) for v in to_pose("ros", RigidTransform(frame.matrix, "base", "tool0"))]
    return numbers[:3], numbers[3:]


def roll_pitch_yaw(frame: RigidTransform) -> list[str]:
    """Return URDF's angles: about the fixed axes x, y, z, in radians."""
    yaw, pitch, roll = angles_from_rotation("ZYX", frame.rotation)
    return [repr(float(v) + 0.0) for v in np.array([roll, pitch, yaw])]
