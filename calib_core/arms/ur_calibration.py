"""A UR's joints as its maker calibrated them: the YAML file that its ROS driver draws from the robot.

The controller counts with these, so that what is found of the arm beside them is what the factory's calibration
leaves.  Frames follow each other as in the driver's description: x y z in m, roll pitch yaw in rad, each turning
about its z; the first stands in the controller's base, the last is the flange.
"""

from typing import Any, cast

import numpy as np

from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message
from calib_core.poses.rotations import rotation_from_angles
from calib_core.records import ArmJoint, ArmTable

_MOST_BYTES = 100_000
_LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
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
        rows = [[float(links[link][number]) for number in _NUMBERS] for link in _LINKS]
    except (yaml.YAMLError, KeyError, TypeError, ValueError, RecursionError):
        need = message(
            "a UR's calibration: kinematics with {links}, each with {numbers}",
            links=list(_LINKS),
            numbers=list(_NUMBERS),
        )
        to_do = message("Draw it anew with the driver's calibration_correction.")
        raise InputError(need, "something else", to_do, name) from None
    if not np.isfinite(rows).all():
        to_do = "Draw it anew with the driver's calibration_correction."
        raise InputError("finite numbers", "something else", to_do, name)
    joints: list[ArmJoint] = []
    for link, (x, y, z, roll, pitch, yaw) in zip(_LINKS, rows, strict=True):
        place = np.eye(4)
        place[:3, :3] = rotation_from_angles("ZYX", [yaw, pitch, roll])
        place[:3, 3] = 1000.0 * np.array([x, y, z])
        joints.append(ArmJoint(name=link, previous_from_joint=place.tolist()))
    return ArmTable(joints=joints, source=f"{name}: {links.get('hash', 'calibration')}")
