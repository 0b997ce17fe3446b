"""Denso: programs, line by line.

Its angles are as a third-party program generator for Denso RC8 writes them: R = Rz(RZ) · Ry(RY) · Rx(RX).
"""

from calib_core.messages import message
from calib_core.robots.brand import Brand


class Denso(Brand):
    """Denso."""

    name = "denso"
    title = "Denso"
    writes_like = "yaskawa"  # R = Rz(RZ) · Ry(RY) · Rx(RX)
    endings = (".pcs", ".pac", ".txt")
    marks = r"^[ \t]*(?:TakeArm\b|(?:Tool|Work)\s+\d+\s*,\s*P\s*\(|P\[\d+\]\s*=\s*P?\s*\()"
    definitions = message("the program with its Tool and Work lines")


BRAND = Denso()
