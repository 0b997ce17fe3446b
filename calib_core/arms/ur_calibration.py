"""A UR's joints as its maker calibrated them: the YAML file that its ROS driver draws from the robot.

The controller counts with these, so that what is found of the arm beside them is what the factory's calibration
leaves.  Frames follow each other as in the driver's description: x y z in m, roll pitch yaw in rad, each turning
about its z; the first stands in the controller's base, the last is the flange.
"""

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from calib_core.arms.corrected import corrected_arm
from calib_core.errors import ConflictError, InputError, TooLargeError
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.poses.rotations import rotation_from_angles
from calib_core.records import ArmJoint, ArmTable

_MOST_BYTES = 100_000
LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
"""Of a calibration, each with the frame of its joint."""

_ALONG = 1e-6
_NUMBERS = ("x", "y", "z", "roll", "pitch", "yaw")


def is_ur_calibration(data: bytes) -> bool:
    """Return whether a file is such a calibration, not an arm's description in XML."""
    return not data.lstrip().startswith(b"<") and b"kinematics:" in data[:_MOST_BYTES]


def arm_from_ur_calibration(data: bytes, name: str) -> ArmTable:
    """Return the table of a UR's joints from its calibration.

    Raises
    ------
    InputError
        If it is none.
    TooLargeError
        If it is beyond 100 kB.
    """
    import yaml

    if len(data) > _MOST_BYTES:
        to_do = "Give the file as its program wrote it."
        need = "a file of at most {limit_mb:g} MB"
        raise TooLargeError(need, "a larger one", to_do, name, limit_mb=_MOST_BYTES / 1e6)
    try:
        read = yaml.safe_load(data)
        links = cast("dict[str, dict[str, Any]]", read["kinematics"])
        rows = [[float(links[link][number]) for number in _NUMBERS] for link in LINKS]
    except (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError):
        need = message(
            "a UR's calibration: kinematics with {links}, each with {numbers}",
            links=list(LINKS),
            numbers=list(_NUMBERS),
        )
        to_do = message("Draw it anew with the driver's calibration_correction.")
        raise InputError(need, "something else", to_do, name) from None
    if not np.isfinite(rows).all():
        to_do = "Draw it anew with the driver's calibration_correction."
        raise InputError("finite numbers", "something else", to_do, name)
    joints: list[ArmJoint] = []
    for link, (x, y, z, roll, pitch, yaw) in zip(LINKS, rows, strict=True):
        place = np.eye(4)
        place[:3, :3] = rotation_from_angles("ZYX", [yaw, pitch, roll])
        place[:3, 3] = 1000.0 * np.array([x, y, z])
        joints.append(ArmJoint(name=link, previous_from_joint=place.tolist()))
    return ArmTable(joints=joints, source=f"{name}: {links.get('hash', 'calibration')}")


def calibration_frames(arm: ArmTable, errors: Mapping[str, float]) -> tuple[list[FloatArray], tuple[str, ...]]:
    """Return the frames (4, 4) of a calibration of a UR with such errors, each in the one before; what it lacks.

    Parameters
    ----------
    arm : ArmTable
        By a UR's lengths, or read from its calibration.
    errors : mapping
        As of `corrected_arm`.

    Raises
    ------
    ConflictError
        If the arm is none of Universal Robots' layout.
    """
    table, left_out = corrected_arm(arm, errors)
    as_made, _ = corrected_arm(arm, {})
    placed, nominal = _placed(table), _placed(as_made)
    if arm.joints[0].previous_from_joint is None:
        if len(arm.joints) != len(LINKS):
            raise _unlike()
        wanted = _laid_out(arm)
        # A joint's frame may stand anywhere along its axis and turn about it: as the driver has it.
        moves = [np.linalg.inv(own) @ frame for own, frame in zip(nominal, wanted, strict=True)]
    elif len(arm.joints) == len(LINKS):
        last = np.eye(4) if as_made.last_from_tool0 is None else np.array(as_made.last_from_tool0)
        moves = [*[np.eye(4)] * (len(LINKS) - 1), last]
    else:
        raise _unlike()
    if max(float(np.abs(move[:2, 2:]).max()) for move in moves) > _ALONG:
        raise _unlike()
    frames = [own @ move for own, move in zip(placed, moves, strict=True)]
    frames[-1] = placed[-1] @ np.array(table.last_from_tool0)
    before = [np.eye(4), *frames[:-1]]
    return [np.linalg.inv(one) @ frame for one, frame in zip(before, frames, strict=True)], left_out


def _placed(arm: ArmTable) -> list[FloatArray]:
    """Return where joints' frames stand in base with all joints at zero."""
    found, at = list[FloatArray](), np.eye(4)
    for joint in arm.joints:
        at = at @ np.array(joint.previous_from_joint)
        found.append(at)
    return found


def _laid_out(arm: ArmTable) -> list[FloatArray]:
    """Return where a driver's description has the frames of a UR of such lengths in base."""
    rows, right = arm.joints, np.pi / 2
    steps = [
        ((0.0, 0.0, rows[0].d_mm), 0.0), ((0.0, 0.0, 0.0), right), ((rows[1].a_mm, 0.0, 0.0), 0.0),
        ((rows[2].a_mm, 0.0, rows[3].d_mm), 0.0), ((0.0, -rows[4].d_mm, 0.0), right),
        ((0.0, rows[5].d_mm, 0.0), -right),
    ]  # fmt: skip
    found, at = list[FloatArray](), np.eye(4)
    for place, roll in steps:
        step = np.eye(4)
        step[:3, :3], step[:3, 3] = rotation_from_angles("ZYX", [0.0, 0.0, roll]), place
        at = at @ step
        found.append(at)
    return found


def _unlike() -> ConflictError:
    to_do = message("Use the export 'urdf-arm'.")
    return ConflictError("an arm of Universal Robots", "another one", to_do, "cell.robot.arm")
