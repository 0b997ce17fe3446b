"""Stäubli: VAL 3 data and programs."""

from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

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
    definitions = "the .dtx data of the application"


BRAND = Staubli()
