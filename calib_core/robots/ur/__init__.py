"""Universal Robots: scripts, programs, installations and recordings."""

import re

from calib_core.messages import message
from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "ur",
    "Universal Robots pose: metres and a rotation vector in radians",
    "x y z rx ry rz",
    "R = exp([rx ry rz]×)",
    "m, radians",
    "Universal Robots",
    "Universal Robots forum, Pose Rotation Order (rv2rpy, rpy2rv)",
    "rotation-vector",
    "",
    1000.0,
)


class Ur(Brand):
    """Universal Robots."""

    name = "ur"
    title = "Universal Robots"
    proof = "real files"
    conventions = (CONVENTION,)
    rank = 5
    endings = (".script", ".urscript", ".urp", ".installation", ".csv", ".txt")
    base = frozenset({"base"})
    definitions = message("the script with set_tcp, or default.installation")
    points = message("the program that sets it; a value that is computed stands in no file")

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is a script, a program, an installation or a recording."""
        pattern = r"<URProgram|<Installation|tcpTransform|actual_TCP_pose_0|actual_q_0|\bp\s*\[[^\]]*,"
        return re.search(pattern, text) is not None


BRAND = Ur()
