"""Mitsubishi: programs, line by line."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import POSE_FORMATS, XYZ_FIXED, Convention

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

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
_MARKS = re.compile(
    r"^\s*(?:\d+\s+)?(?:Def\s+Pos\b|Tool\s*\([-+.\d]|P\w+(?:\(\d+\))?\s*=\s*\([-+.\d eE,]+\)\s*\(\d+\s*,)",
    re.IGNORECASE | re.MULTILINE,
)


class Mitsubishi(Brand):
    """Mitsubishi."""

    name = "mitsubishi"
    title = "Mitsubishi"
    conventions = (CONVENTION,)
    rank = 8
    endings = (".prg", ".mb4", ".mb5", ".mb6", ".pos", ".txt")
    definitions = "the program with its Tool and Base lines"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame lines that it writes."""
        from calib_core.robots.mitsubishi.check import CHECK
        from calib_core.robots.mitsubishi.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.mitsubishi.reader import find

        return find(data, name)


BRAND = Mitsubishi()
