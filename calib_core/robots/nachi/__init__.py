"""Nachi: programs, line by line."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import Convention

if TYPE_CHECKING:
    from calib_core.robots.controller_file import Found

CONVENTION = Convention(
    "nachi",
    "Nachi roll pitch yaw: roll is about z and comes first in the list",
    "x y z r p y",
    "R = Rz(r) · Ry(p) · Rx(y)",
    "mm, degrees",
    "Nachi, OTC",
    "RoboDK post processor for Nachi AX and FD (its sample MOVEX line)",
    "ZYX",
    "forward",
)
_MARKS = re.compile(
    r"""^\s*MOVEX\s+A\s*=""",
    re.IGNORECASE | re.MULTILINE,
)


class Nachi(Brand):
    """Nachi."""

    name = "nachi"
    title = "Nachi"
    conventions = (CONVENTION,)
    rank = 9
    endings = (".src", ".txt")
    definitions = "the controller's tool constants"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it holds this brand's statements."""
        return _MARKS.search(text) is not None

    def find(self, data: bytes, name: str) -> "Found":
        """Return poses, joints, tools and frames of a program."""
        from calib_core.robots.nachi.reader import find

        return find(data, name)


BRAND = Nachi()
