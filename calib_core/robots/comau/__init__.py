"""Comau: programs, line by line.

Its angles are as a third-party program generator for Comau C5G writes them: R = Rz(e1) · Ry(e2) · Rz(e3).
"""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

_MARKS = re.compile(
    r"""^\s*PROGRAM\s+\w+|:=\s*POS\s*\([-+.\d eE,]+""",
    re.IGNORECASE | re.MULTILINE,
)


class Comau(Brand):
    """Comau."""

    name = "comau"
    title = "Comau"
    conventions = ()
    writes_like = "kawasaki"  # R = Rz(e1) · Ry(e2) · Rz(e3)
    endings = (".pdl", ".txt")
    definitions = "the program with its $TOOL and $UFRAME lines"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame lines that it writes."""
        from calib_core.robots.comau.check import CHECK
        from calib_core.robots.comau.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.comau.reader import find

        return find(data, name)


BRAND = Comau()
