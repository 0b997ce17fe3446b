"""ROS: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import QUATERNION, Convention

CONVENTION = Convention(
    "ros",
    "ROS geometry_msgs/Pose: metres and a quaternion, scalar last",
    "x y z qx qy qz qw",
    QUATERNION,
    "m",
    "ROS",
    "ROS geometry_msgs, message Pose; REP 103 (units)",
    "quaternion",
    "xyzw",
    1000.0,
)


class Ros(Brand):
    """ROS."""

    name = "ros"
    title = "ROS"
    conventions = (CONVENTION,)
    rank = 11


BRAND = Ros()
