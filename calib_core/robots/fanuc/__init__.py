"""FANUC: TP programs as listings, and listings of variables."""

import re

from calib_core.messages import message
from calib_core.poses.convention import POSE_FORMATS, XYZ_FIXED, Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "fanuc",
    f"FANUC W P R: {XYZ_FIXED}",
    "x y z W P R",
    "R = Rz(R) · Ry(P) · Rx(W)",
    "mm, degrees",
    "FANUC",
    POSE_FORMATS + " (FANUC XYZ-WPR); two recorded FANUC sessions",
    "ZYX",
    "reverse",
)


class Fanuc(Brand):
    """FANUC."""

    name = "fanuc"
    title = "FANUC"
    proof = "real files"
    conventions = (CONVENTION,)
    rank = 4
    endings = (".ls", ".va", ".lst", ".txt")
    definitions = "sysframe.va"
    points = message("the program with its /POS section, or posreg.va")

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is a listing of a TP program or of variables."""
        return (
            re.search(r"^[ \t]*/PROG\b|^[ \t]*P\[\d+[^\]]*\]\s*\{|^\[\*\w+\*\]\$", text, re.MULTILINE) is not None
        )


BRAND = Fanuc()
