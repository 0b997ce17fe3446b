"""Comau: programs, line by line.

Its angles are as a third-party program generator for Comau C5G writes them: R = Rz(e1) · Ry(e2) · Rz(e3).
"""

from calib_core.messages import message
from calib_core.robots.brand import Brand


class Comau(Brand):
    """Comau."""

    name = "comau"
    title = "Comau"
    writes_like = "kawasaki"  # R = Rz(e1) · Ry(e2) · Rz(e3)
    endings = (".pdl", ".txt")
    marks = r"^[ \t]*PROGRAM\s+\w+|:=\s*POS\s*\([-+.\d eE,]+"
    definitions = message("the program with its $TOOL and $UFRAME lines")


BRAND = Comau()
