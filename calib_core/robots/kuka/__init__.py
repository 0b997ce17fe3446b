"""KUKA: KRL programs, data lists and $config.dat."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, Convention

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

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
    endings = (".src", ".dat", ".sub")
    definitions = "$config.dat"
    points = "the program's .dat, or the one that declares it, such as $config.dat"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds KRL."""
        found = re.search(
            r"^\s*(?:&ACCESS|DEFDAT\b|(?:GLOBAL\s+)?DEF\s+\w+\s*\([^)\n]*\)\s*$|\$?(?:TOOL|BASE)_DATA\[\s*\d+\s*\]\s*=|"
            r"(?:DECL\s+)?(?:GLOBAL\s+)?(?:E6POS|E6AXIS|FDAT|POS|FRAME)\s+\w+(?:\[\d+\])?\s*=\s*\{)",
            text,
            re.IGNORECASE | re.MULTILINE,
        )
        return found is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame data that it writes."""
        from calib_core.robots.kuka.check import CHECK
        from calib_core.robots.kuka.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return positions, tools and bases of a KRL file."""
        from calib_core.robots.kuka.reader import find

        return find(data, name)


BRAND = Kuka()
