"""Stäubli: VAL 3 data and programs."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from calib_core.messages import message
from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

if TYPE_CHECKING:
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
    marks = r"staubli\.com/robotics/VAL3|(?:Project|Data|Program)NameSpace"
    flange = frozenset({"flange", "flange[0]"})
    base = frozenset({"world", "world[0]"})
    definitions = message("the .dtx data of the application")

    def together(self, found: "Sequence[Found]") -> "Sequence[Found]":
        """Return lengths in mm: the project file states the unit of the data beside it."""
        from calib_core.robots.staubli.units import in_millimetres

        return in_millimetres(found)


BRAND = Staubli()
