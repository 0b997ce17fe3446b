"""Kawasaki: files saved by its AS controllers."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, Convention

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

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
    flange = frozenset({"0", "null"})
    base = frozenset({"0", "null"})
    definitions = "the file saved with SAVE, with its .TRANS section"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it has sections of AS."""
        pattern = r"^\s*\.(?:TRANS|JOINTS|REALS|PROGRAM|NETCONF|ROBOTDATA\d*|SYSDATA)\b"
        return re.search(pattern, text, re.MULTILINE | re.IGNORECASE) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame data that it writes."""
        from calib_core.robots.kawasaki.check import CHECK
        from calib_core.robots.kawasaki.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return transformations, joints, tools and bases of a saved file."""
        from calib_core.robots.kawasaki.reader import find

        return find(data, name)


BRAND = Kawasaki()
