"""Kawasaki: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, Convention

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


BRAND = Kawasaki()
