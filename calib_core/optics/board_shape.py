"""How a board leaves its plane."""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class BoardShape:
    """How a board leaves its plane.

    Parameters
    ----------
    coefficients_mm : (7,)
        Of x², xy, y², x³, x²y, xy², y³ of places scaled to ±1.
    extent_mm : (2, 2)
        See `Corners`.
    """

    coefficients_mm: FloatArray
    extent_mm: FloatArray

    def heights_mm(self, points_mm: FloatArray) -> FloatArray:
        """Return z (N,) at places (N, 2) or (N, 3) of the board's frame."""
        return shape_basis(points_mm, self.extent_mm) @ self.coefficients_mm

    def bend_mm(self, points_mm: FloatArray) -> float:
        """Return how far places of the board leave their own plane, highest to lowest."""
        heights = self.heights_mm(points_mm)
        places = np.column_stack([points_mm[:, :2], np.ones(len(heights))])
        return float(np.ptp(heights - places @ np.linalg.lstsq(places, heights, rcond=None)[0]))


def shape_basis(points_mm: FloatArray, extent_mm: FloatArray) -> FloatArray:
    """Return the functions (N, 7) by which a board may be bent: quadratic and cubic, each at most 1 on the board.

    Parameters
    ----------
    points_mm : (N, 2) or (N, 3)
        Places in the board's frame.
    extent_mm : (2, 2)
        See `Corners`.
    """
    low, high = extent_mm
    x, y = ((points_mm[:, :2] - (low + high) / 2) / max((high - low).max() / 2, 1e-9)).T
    return np.column_stack([x * x, x * y, y * y, x**3, x * x * y, x * y * y, y**3])
