"""KUKA: KRL programs, data lists and $config.dat."""

from calib_core.messages import message
from calib_core.poses.convention import POSE_FORMATS, Convention
from calib_core.robots.brand import Brand

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
    proof = "real files"
    conventions = (CONVENTION,)
    rank = 3
    endings = (".src", ".dat", ".sub")
    marks = (
        r"^[ \t]*(?:&ACCESS|DEFDAT\b|(?:GLOBAL\s+)?DEF\s+\w+\s*\([^)\n]*\)\s*$|"
        r"\$?(?:TOOL|BASE)_DATA\[\s*\d+\s*\]\s*=|"
        r"(?:DECL\s+)?(?:GLOBAL\s+)?(?:E6POS|E6AXIS|FDAT|POS|FRAME)\s+\w+(?:\[\d+\])?\s*=\s*\{)"
    )
    definitions = "$config.dat"
    points = message("the program's .dat, or the one that declares it, such as $config.dat")


BRAND = Kuka()
