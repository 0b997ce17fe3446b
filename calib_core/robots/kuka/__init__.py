"""KUKA: its pose convention."""

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, Convention

CONVENTION = Convention(
    "kuka",
    "KUKA frame: A about z first in the list",
    "X Y Z A B C",
    "R = Rz(A) · Ry(B) · Rx(C)",
    "mm, degrees",
    "KUKA",
    POSE_FORMATS + " (KUKA XYZ-ABC)",
    "ZYX",
    "forward",
)


class Kuka(Brand):
    """KUKA."""

    name = "kuka"
    title = "KUKA"
    conventions = (CONVENTION,)
    rank = 3


BRAND = Kuka()
