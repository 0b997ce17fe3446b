"""Poses as plain matrices, of no brand."""

from calib_core.poses.convention import Convention
from calib_core.robots.brand import Brand

CONVENTION = Convention(
    "matrix",
    "4×4 matrix, row by row",
    "r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z 0 0 0 1",
    "R = [r11 r12 r13; r21 r22 r23; r31 r32 r33]",
    "mm",
    "any",
    "the definition of base_from_tool0",
    "matrix",
)


class Matrix(Brand):
    """4×4 matrices."""

    name = "matrix"
    title = "4×4 matrices"
    conventions = (CONVENTION,)
    rank = 0


BRAND = Matrix()
