"""Poses as position and quaternion, of no brand."""

from calib_core.poses.convention import POSE_FORMATS, QUATERNION, Convention
from calib_core.robots.brand import Brand

QUATERNION_XYZW = Convention(
    "quaternion-xyzw",
    "position and quaternion, scalar last",
    "x y z qx qy qz qw",
    QUATERNION,
    "mm",
    "any",
    POSE_FORMATS,
    "quaternion",
    "xyzw",
)
QUATERNION_WXYZ = Convention(
    "quaternion-wxyz",
    "position and quaternion, scalar first",
    "x y z qw qx qy qz",
    QUATERNION,
    "mm",
    "any",
    POSE_FORMATS,
    "quaternion",
    "wxyz",
)


class Quaternion(Brand):
    """Position and quaternion."""

    name = "quaternion"
    title = "Position and quaternion"
    conventions = (QUATERNION_XYZW, QUATERNION_WXYZ)
    rank = 1


BRAND = Quaternion()
