"""Yaskawa Motoman: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, XYZ_FIXED, Convention

CONVENTION = Convention(
    "yaskawa",
    f"Yaskawa Motoman: {XYZ_FIXED}",
    "x y z Rx Ry Rz",
    "R = Rz(Rz) · Ry(Ry) · Rx(Rx)",
    "mm, degrees",
    "Yaskawa, Motoman",
    POSE_FORMATS + " (Yaskawa)",
    "ZYX",
    "reverse",
)


class Yaskawa(Brand):
    """Yaskawa Motoman."""

    name = "yaskawa"
    title = "Yaskawa Motoman"
    conventions = (CONVENTION,)
    rank = 8


BRAND = Yaskawa()
