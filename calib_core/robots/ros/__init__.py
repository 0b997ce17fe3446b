"""ROS: its pose convention, poses and transforms as YAML and in recordings."""

import re
from dataclasses import replace
from typing import TYPE_CHECKING

from calib_core.messages import message
from calib_core.poses.convention import QUATERNION, Convention
from calib_core.robots.brand import Brand
from calib_core.robots.file_hints import NOTHING_TOLD, Told

if TYPE_CHECKING:
    from calib_core.robots.controller_file import Found, Reference

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
_BINARY = ("\x89MCAP0\n", "SQLite format 3\0")
_YAML = r"^[ \t]*(?:- )?(?:orientation|rotation)\s*:\s*(?:\{[^}\n]*\bw\s*:|\n\s+\w\s*:)"
_ECHO = r"^- Translation: \[|static_transform_publisher|<joint\b[^>]*type=\"fixed\"|^\s+tracking_base_frame:"


class Ros(Brand):
    """ROS."""

    name = "ros"
    title = "ROS"
    conventions = (CONVENTION,)
    rank = 11
    endings = (".yaml", ".yml", ".txt", ".mcap", ".db3", ".urdf", ".xacro", ".py", ".xml")
    flange = frozenset({"tool0"})
    base = frozenset({"base", "base_link"})
    definitions = message("a recording with /tf and /tf_static")
    told: Told = NOTHING_TOLD

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is a recording, messages as YAML, or what tf2_echo prints."""
        if text.startswith(_BINARY):
            return True
        return "%YAML:1.0" not in text[:20] and re.search(f"{_YAML}|{_ECHO}", text, re.MULTILINE) is not None

    def telling(self, told: Told) -> "Ros":
        """Return the brand with what the user says about its files."""
        chosen = Ros()
        chosen.told = told
        chosen.flange = frozenset({told.flange.lower()}) if told.flange else self.flange
        chosen.base = frozenset({told.base.lower()}) if told.base else self.base
        return chosen

    def doubt(self, what: str, number: "Reference") -> str:
        """Return that base_link may be turned against the controller's base."""
        if what == "frame" and str(number).lower() == "base_link":
            return (
                "In base_link: on some robots (Universal Robots among them) it is turned by half a turn about z "
                "against the controller's base. The answer is in the same frame as these poses."
            )
        return ""

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses and transforms of messages as YAML, of what tf2_echo prints, or of a recording."""
        from calib_core.robots.ros.reader import find

        found = find(data, name, self.told, self.base, self.flange)
        found.poses = [
            replace(p, frame=p.frame.lstrip("/")) if isinstance(p.frame, str) else p for p in found.poses
        ]
        return found


BRAND = Ros()
