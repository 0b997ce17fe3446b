"""Nachi: programs, line by line."""

from calib_core.messages import message
from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

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


class Nachi(Brand):
    """Nachi."""

    name = "nachi"
    title = "Nachi"
    conventions = (CONVENTION,)
    rank = 9
    endings = (".src", ".txt")
    marks = r"^[ \t]*MOVEX\s+A\s*="
    definitions = message("the controller's tool constants")


BRAND = Nachi()
