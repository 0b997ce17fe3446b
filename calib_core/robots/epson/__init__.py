"""Epson: programs, line by line.

Its angles are as a third-party program generator for Epson RC+ writes them: R = Rz(u) · Ry(v) · Rx(w).
"""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

_MARKS = re.compile(
    r"""^\s*(?:TLSet\s+\d+\s*,|Local\s+\d+\s*,|P\d+\s*=\s*XY\s*\(|(?:Go|Move|Jump3?)\s+XY\s*\()""",
    re.IGNORECASE | re.MULTILINE,
)


class Epson(Brand):
    """Epson."""

    name = "epson"
    title = "Epson"
    conventions = ()
    writes_like = "nachi"  # R = Rz(u) · Ry(v) · Rx(w)
    endings = (".prg", ".pts", ".txt")
    definitions = "the program with its TLSet and Local lines"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame lines that it writes."""
        from calib_core.robots.epson.check import CHECK
        from calib_core.robots.epson.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.epson.reader import find

        return find(data, name)


BRAND = Epson()
