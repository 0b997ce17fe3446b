"""Kawasaki: files saved by its AS controllers."""

from calib_core.messages import message
from calib_core.poses.convention import POSE_FORMATS, Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "kawasaki",
    "Kawasaki O A T: turns about z, the new y, the new z",
    "x y z O A T",
    "R = Rz(O) · Ry(A) · Rz(T)",
    "mm, degrees",
    "Kawasaki",
    POSE_FORMATS + " (Kawasaki XYZ-OAT)",
    "ZYZ",
    "forward",
)


class Kawasaki(Brand):
    """Kawasaki."""

    name = "kawasaki"
    title = "Kawasaki"
    conventions = (CONVENTION,)
    rank = 7
    endings = (".as", ".pg", ".lc", ".txt")
    marks = r"^[ \t]*\.(?:TRANS|JOINTS|REALS|PROGRAM|NETCONF|ROBOTDATA\d*|SYSDATA)\b"
    flange = frozenset({"0", "null"})
    base = frozenset({"0", "null"})
    definitions = message("the file saved with SAVE, with its .TRANS section")


BRAND = Kawasaki()
