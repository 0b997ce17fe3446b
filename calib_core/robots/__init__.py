"""Robot brands, one folder each: pose convention, readers of controllers' files, writers, read-back.

``parse_pose("fanuc", [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635])`` gives a `RigidTransform`, `to_pose`
gives the numbers again, and `CONVENTIONS` has every convention with its formula, units and source.
"""

from calib_core.poses.convention import Convention
from calib_core.poses.conventions import CONVENTIONS
from calib_core.poses.numbers import convention_named, parse_pose, to_pose
from calib_core.robots.brand import Brand
from calib_core.robots.lines import PoseLine, parse_pose_lines
from calib_core.robots.registry import BRANDS

__all__ = [
    "BRANDS", "CONVENTIONS", "Brand", "Convention", "PoseLine", "convention_named", "parse_pose",
    "parse_pose_lines", "to_pose"
]  # fmt: skip
