"""Mitsubishi: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, XYZ_FIXED, Convention

CONVENTION = Convention(
    "mitsubishi",
    f"Mitsubishi A B C: {XYZ_FIXED}",
    "x y z A B C",
    "R = Rz(C) · Ry(B) · Rx(A)",
    "mm, degrees",
    "Mitsubishi",
    POSE_FORMATS + " (Mitsubishi XYZ-ABC)",
    "ZYX",
    "reverse",
)


class Mitsubishi(Brand):
    """Mitsubishi."""

    name = "mitsubishi"
    title = "Mitsubishi"
    conventions = (CONVENTION,)
    rank = 9


BRAND = Mitsubishi()
