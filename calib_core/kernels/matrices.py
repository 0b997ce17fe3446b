"""Small matrices inside hot loops: positive definite 3×3, by Cholesky factors."""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def cholesky_3(a: FloatArray, low: FloatArray) -> None:
    """Write the lower Cholesky factor of a positive definite 3×3 matrix."""
    low[0, 0] = np.sqrt(a[0, 0])
    low[1, 0] = a[1, 0] / low[0, 0]
    low[2, 0] = a[2, 0] / low[0, 0]
    low[1, 1] = np.sqrt(a[1, 1] - low[1, 0] ** 2)
    low[2, 1] = (a[2, 1] - low[2, 0] * low[1, 0]) / low[1, 1]
    low[2, 2] = np.sqrt(a[2, 2] - low[2, 0] ** 2 - low[2, 1] ** 2)


@njit(cache=True, nogil=True, error_model="numpy")
def invert_lower_3(low: FloatArray, inverse: FloatArray) -> None:
    """Write the inverse of a lower triangular 3×3 matrix."""
    inverse[0, 0] = 1 / low[0, 0]
    inverse[1, 1] = 1 / low[1, 1]
    inverse[2, 2] = 1 / low[2, 2]
    inverse[1, 0] = -low[1, 0] * inverse[0, 0] * inverse[1, 1]
    inverse[2, 1] = -low[2, 1] * inverse[1, 1] * inverse[2, 2]
    inverse[2, 0] = -(low[2, 0] * inverse[0, 0] + low[2, 1] * inverse[1, 0]) * inverse[2, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def invert_positive_3(a: FloatArray, inverse: FloatArray) -> float:
    """Write the inverse of a positive definite 3×3 matrix by its Cholesky factor; return log det."""
    low = np.zeros((3, 3))
    low_inverse = np.zeros((3, 3))
    cholesky_3(a, low)
    invert_lower_3(low, low_inverse)
    for i in range(3):
        for j in range(3):
            value = 0.0
            for p in range(max(i, j), 3):
                value += low_inverse[p, i] * low_inverse[p, j]
            inverse[i, j] = value
    return 2 * np.log(low[0, 0] * low[1, 1] * low[2, 2])
