"""Signs that several layers use: a cross for what was rejected."""

import numpy as np

from calib_core.frames import FloatArray


def cross(at_mm: FloatArray, size_mm: float) -> FloatArray:
    """Return a cross in space (4, 2, 3): the diagonals of a cube, a cross from wherever one looks."""
    corners = np.array([[1, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]], dtype=float) * size_mm / np.sqrt(3)
    return at_mm + np.stack([corners, -corners], axis=1)
