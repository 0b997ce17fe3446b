"""Doosan: programs, line by line.

Its angles are as Doosan programming manual, posx (Euler angles ZYZ) writes them: R = Rz(A) · Ry(B) · Rz(C).
"""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand

if TYPE_CHECKING:
    from calib_core.robots.controller_file import Found

_MARKS = re.compile(
    r"""\bposx\s*\(\s*[-+.\d]""",
    re.IGNORECASE | re.MULTILINE,
)


class Doosan(Brand):
    """Doosan."""

    name = "doosan"
    title = "Doosan"
    conventions = ()
    writes_like = "kawasaki"  # R = Rz(A) · Ry(B) · Rz(C)
    endings = (".drl", ".py", ".txt")
    definitions = "the controller's TCP settings"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.doosan.reader import find

        return find(data, name)


BRAND = Doosan()
