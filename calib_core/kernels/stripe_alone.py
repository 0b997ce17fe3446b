"""What the columns beside it say of a column's centre."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.stripe import ALONE, OK

CodeArray = NDArray[np.uint8]

_REACH = 5
_LEAST = 3


@njit(cache=True, nogil=True, error_model="numpy")
def mark_alone(centers: FloatArray, code: CodeArray) -> None:
    """Mark the good centres that fewer than three good ones within five columns continue.

    Parameters
    ----------
    centers, code : (W,)
        Of every column; codes are written.
    """
    width = centers.shape[0]
    # Infinite where there is none, and beyond the image: ∞ − ∞ is not a number, and so never near.
    place = np.full(width + 2 * _REACH, np.inf, np.float32)
    for j in range(width):
        place[j + _REACH] = np.float32(centers[j]) if code[j] == OK else np.float32(np.inf)
    beside = np.zeros(width, np.int32)
    here = place[_REACH : _REACH + width]
    for apart in range(1, _REACH + 1):
        before, after = (
            place[_REACH - apart : _REACH - apart + width],
            place[_REACH + apart : _REACH + apart + width],
        )
        near = np.float32(1.5 + 1.5 * apart)
        for j in range(width):
            beside[j] += np.int32(abs(here[j] - before[j]) <= near) + np.int32(abs(here[j] - after[j]) <= near)
    for j in range(width):
        code[j] = np.uint8(ALONE) if (code[j] == OK) & (beside[j] < _LEAST) else code[j]
