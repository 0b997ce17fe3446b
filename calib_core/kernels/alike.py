"""Hot loop of alike pose errors: a few columns of their correlation's factor."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

IntArray = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def pivoted_factor(features: FloatArray, order: IntArray, most: int, tolerance: float, factor: FloatArray) -> int:
    """Write columns of a pivoted Cholesky factor of exp(−½ |f_i − f_j|²); return how many.

    Parameters
    ----------
    features : (K, d)
        Places in units of the reach.
    order : (most,)
        The pivots that were chosen; written.
    most, tolerance
        Ends after so many columns, or when no row has a larger variance left.
    factor : (K, most)
        Written.
    """
    count, width = features.shape
    left = np.ones(count)
    for m in range(most):
        pivot = int(np.argmax(left))
        if left[pivot] < tolerance:
            return m
        order[m] = pivot
        root = np.sqrt(left[pivot])
        for i in range(count):
            square = 0.0
            for d in range(width):
                square += (features[i, d] - features[pivot, d]) ** 2
            value = np.exp(-0.5 * square)
            for j in range(m):
                value -= factor[i, j] * factor[pivot, j]
            factor[i, m] = value / root
        for i in range(count):
            left[i] = max(left[i] - factor[i, m] ** 2, 0.0)
        left[pivot] = 0.0
    return most
