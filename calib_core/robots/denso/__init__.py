"""Denso: programs, line by line.

Its angles are as a third-party program generator for Denso RC8 writes them: R = Rz(RZ) · Ry(RY) · Rx(RX).
"""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

_MARKS = re.compile(
    r"""^\s*(?:TakeArm\b|(?:Tool|Work)\s+\d+\s*,\s*P\s*\(|P\[\d+\]\s*=\s*P?\s*\()""", re.IGNORECASE | re.MULTILINE
)


class Denso(Brand):
    """Denso."""

    name = "denso"
    title = "Denso"
    conventions = ()
    writes_like = "yaskawa"  # R = Rz(RZ) · Ry(RY) · Rx(RX)
    endings = (".pcs", ".pac", ".txt")
    definitions = "the program with its Tool and Work lines"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame lines that it writes."""
        from calib_core.robots.denso.check import CHECK
        from calib_core.robots.denso.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.denso.reader import find

        return find(data, name)


BRAND = Denso()
