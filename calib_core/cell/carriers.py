"""What carries scanner and ball in a cell, as its record says."""

from calib_core.cell.walk import Carrier, Carriers
from calib_core.records import Capture, Cell


def scanner_mount(cell: Cell) -> Carrier:
    """Return what carries the scanner."""
    return "base" if cell.arrangement == "sphere-on-robot" else "tool0"


def ball_carrier(cell: Cell) -> Carrier:
    """Return what carries the ball of the TCP's captures: the other end of the robot."""
    return "tool0" if scanner_mount(cell) == "base" else "base"


def carriers_of(cell: Cell, capture: Capture) -> Carriers:
    """Return what carries scanner and ball in a capture; a turntable stands in base."""
    return Carriers(scanner_mount(cell), "base" if capture.step == "turntable" else ball_carrier(cell))
