"""What exports of no brand share: transforms between named frames, in metres and radians as ROS has them."""

from collections.abc import Iterator

import numpy as np

from calib_core.cell.axes import frame_of
from calib_core.exports.answer import Answer
from calib_core.exports.axis_frames import other_axes, table_axis
from calib_core.exports.entry import Settings
from calib_core.exports.writing import Part, wanted
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.numbers import to_pose
from calib_core.poses.rotations import angles_from_rotation


class FrameSettings(Settings):
    """What the frames are called; `turntable` left out, as the cell calls that axis.

    ROS's `base_link` may be another frame than the controller's base: on a Universal Robots arm the two differ by
    half a turn about z, and the controller's is `base` there.
    """

    base: str = "base"
    flange: str = "tool0"
    scanner: str = "laser"
    turntable: str | None = None
    part: Part | None = None


def edges(answer: Answer, settings: FrameSettings) -> Iterator[tuple[str, str, RigidTransform]]:
    """Yield parent, child and parent_from_child of all that is to be written.

    These are scanners, table and other axes, camera and board; a table that its scanner alone knows has that as
    its parent.
    """
    for parent, child, frame, _ in edges_known(answer, settings):
        yield parent, child, frame


def edges_known(
    answer: Answer, settings: FrameSettings
) -> Iterator[tuple[str, str, RigidTransform, FloatArray | None]]:
    """Yield the same with the covariance (6, 6) of each, where it is stated."""
    table = settings.turntable or frame_of(table_axis(answer))
    if answer.laser_from_turntable is not None:
        for seen in answer.frames:
            scanner, _, name = seen.into.partition(":")
            if scanner == "laser":
                frame = RigidTransform.from_rounded(seen.matrix, "laser", "turntable")
                ends = [settings.scanner + f"_{one}" * bool(one) for one in (name, seen.outof.partition(":")[2])]
                child = table if seen.outof == "turntable" else ends[1]
                yield ends[0], child, frame, np.array(seen.covariance, dtype=float)
        return
    answer.require_placed()
    with_tool, with_table = wanted(answer, settings.part, "both")
    names = {"tool0": settings.flange, "base": settings.base}
    named = {f"{settings.scanner}_{name}": known for name, known in answer.scanners().items()}
    scanners = named or {settings.scanner: (answer.mount_from_laser, answer.tool_covariance)}
    for child, (frame, covariance) in scanners.items() if with_tool else ():
        yield names[frame.into], child, frame, covariance
    if with_table and answer.base_from_turntable is not None:
        yield settings.base, table, answer.base_from_turntable, answer.table_covariance
    if settings.part == "tool":
        return
    axes = {axis.name: axis for axis in other_axes(answer)}
    for axis in axes.values():
        yield settings.base, axis.name, axis.frame, axis.covariance
    for found in answer.frames:  # camera and board
        if found.into in names and found.outof not in ("laser", "turntable", *axes):
            frame = RigidTransform.from_rounded(found.matrix, "base", "turntable")
            covariance = None if found.covariance is None else np.array(found.covariance, dtype=float)
            yield names[found.into], found.outof, frame, covariance


def position_and_quaternion(frame: RigidTransform) -> tuple[list[str], list[str]]:
    """Return position in metres and quaternion xyzw as texts that read back to the last digit."""
    numbers = [repr(v + 0.0) for v in to_pose("ros", RigidTransform(frame.matrix, "base", "tool0"))]
    return numbers[:3], numbers[3:]


def roll_pitch_yaw(frame: RigidTransform) -> list[str]:
    """Return URDF's angles: about the fixed axes x, y, z, in radians."""
    yaw, pitch, roll = angles_from_rotation("ZYX", frame.rotation)
    return [repr(float(v) + 0.0) for v in np.array([roll, pitch, yaw])]
