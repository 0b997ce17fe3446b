"""Stäubli: VAL 3 data and programs."""

import re
from typing import TYPE_CHECKING

from calib_core.robots.brand import Brand
from calib_core.robots.convention import Convention

if TYPE_CHECKING:
    from calib_core.exports.entry import Export
    from calib_core.robots.controller_file import Found

CONVENTION = Convention(
    "staubli",
    "Stäubli VAL 3: turns about x, then the new y, then the new z",
    "x y z Rx Ry Rz",
    "R = Rx(Rx) · Ry(Ry) · Rz(Rz)",
    "mm, degrees",
    "Stäubli",
    "RoboDK post processor for Stäubli VAL 3",
    "XYZ",
    "forward",
)


class Staubli(Brand):
    """Stäubli."""

    name = "staubli"
    title = "Stäubli"
    conventions = (CONVENTION,)
    rank = 6
    endings = (".dtx", ".pjx", ".pgx")
    flange = frozenset({"flange", "flange[0]"})
    base = frozenset({"world", "world[0]"})
    definitions = "the .dtx data of the application"

    def recognises(self, text: str, name: str) -> bool:
        """Return whether it is VAL 3 text, a program or a project."""
        return re.search(r"staubli\.com/robotics/VAL3|ProjectNameSpace", text, re.IGNORECASE) is not None

    def exports(self) -> "tuple[Export, ...]":
        """Return the tool and frame data that it writes."""
        from calib_core.robots.staubli.check import CHECK
        from calib_core.robots.staubli.writer import EXPORT

        return (EXPORT, CHECK)

    def find(self, data: bytes, name: str) -> "Found":
        """Return tools, frames, points and joints of VAL 3 data."""
        from calib_core.robots.staubli.reader import find

        return find(data, name)


BRAND = Staubli()
