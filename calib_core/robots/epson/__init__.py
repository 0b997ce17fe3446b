"""Epson: programs, line by line.

Its angles are as a third-party program generator for Epson RC+ writes them: R = Rz(u) · Ry(v) · Rx(w).
"""

from calib_core.messages import message
from calib_core.robots.brand import Brand


class Epson(Brand):
    """Epson."""

    name = "epson"
    title = "Epson"
    writes_like = "nachi"  # R = Rz(u) · Ry(v) · Rx(w)
    endings = (".prg", ".pts", ".txt")
    marks = r"^[ \t]*(?:TLSet\s+\d+\s*,|Local\s+\d+\s*,|P\d+\s*=\s*XY\s*\(|(?:Go|Move|Jump3?)\s+XY\s*\()"
    definitions = message("the program with its TLSet and Local lines")


BRAND = Epson()
