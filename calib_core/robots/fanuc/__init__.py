"""FANUC: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, XYZ_FIXED, Convention

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
    conventions = (CONVENTION,)
    rank = 4


BRAND = Fanuc()
