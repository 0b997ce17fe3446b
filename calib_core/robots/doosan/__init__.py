"""Doosan: programs, line by line.

Its angles are as Doosan programming manual, posx (Euler angles ZYZ) writes them: R = Rz(A) · Ry(B) · Rz(C).
"""

from calib_core.messages import message
from calib_core.robots.brand import Brand


class Doosan(Brand):
    """Doosan."""

    name = "doosan"
    title = "Doosan"
    writes_like = "kawasaki"  # R = Rz(A) · Ry(B) · Rz(C)
    endings = (".drl", ".py", ".txt")
    marks = r"\bposx\s*\(\s*[-+.\d]"
    definitions = message("the controller's TCP settings")


BRAND = Doosan()
