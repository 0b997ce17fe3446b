"""Whether a stripe clearly runs from left to right or from top to bottom, from a few lines of the frame."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.kernels.stripe_noise import middling

ImageArray = NDArray[Any]  # uint8 or uint16
LineArray = NDArray[np.int32]

UNCLEAR, COLUMNS, ROWS = 0, 1, 2
_LINES = 16
_STEP_PX = 3  # of the pixels looked at along a line; those rows that `stripe_glance` looks at, too, mostly
_BOX, _GAP = 2, 3  # looked-at pixels
_SPREAD = 7.4  # five standard deviations, in median deviations
_RANK = 6  # of 16: the 40th percentile
_MEAN_WEIGHT = 0.1  # decides where the stripe is so short that most lines have none
_CLEARLY = 3.0
_LEAST_PX = 240  # so that few ridges are not judged by their accidents


@njit(cache=True, nogil=True, error_model="numpy")
def clear_direction(image: ImageArray) -> int:
    """Return COLUMNS or ROWS where ridges across these lines stand out by far the most, otherwise UNCLEAR.

    Parameters
    ----------
    image : (H, W)
    """
    height, width = image.shape
    if min(height, width) < _LEAST_PX:
        return UNCLEAR
    places = (2 * np.arange(_LINES) + 1) * width // (2 * _LINES)
    down = np.empty((height // _STEP_PX, _LINES), np.int32)
    for i in range(down.shape[0]):
        row = image[_STEP_PX * i]
        for n in range(_LINES):
            down[i, n] = row[np.uint32(places[n])]
    across = np.empty((width // _STEP_PX, _LINES), np.int32)
    for n in range(_LINES):
        row = image[(2 * n + 1) * height // (2 * _LINES)]
        for i in range(across.shape[0]):
            across[i, n] = row[_STEP_PX * i]
    in_columns, in_rows = _prominence(down), _prominence(across)
    if in_columns[0] > max(_CLEARLY * in_rows[0], in_columns[1]):
        return COLUMNS
    return ROWS if in_rows[0] > max(_CLEARLY * in_columns[0], in_rows[1]) else UNCLEAR


@njit(cache=True, nogil=True, error_model="numpy")
def _prominence(pixels: LineArray) -> tuple[float, float]:
    """Return how much each line's highest narrow ridge stands out of the usual, and the usual.

    Pixels are (along, lines).  A ridge is a box of pixels above both the boxes beside it; that of the middling
    line counts most.
    """
    flat = pixels.reshape(-1)  # _LINES further on is the next pixel of the same line
    rises = np.empty((pixels.shape[0] - _BOX - 2 * _GAP + 1) * _LINES, np.int32)
    to_next, to_middle, to_below = _LINES, _GAP * _LINES, 2 * _GAP * _LINES
    for m in range(rises.shape[0]):
        above = np.int32(flat[m] + flat[m + to_next])
        middle = np.int32(flat[m + to_middle] + flat[m + to_middle + to_next])
        below = np.int32(flat[m + to_below] + flat[m + to_below + to_next])
        rises[m] = middle - max(above, below)
    some = np.abs(rises.reshape((-1, _LINES))[::7].copy().reshape(-1))
    usual = _SPREAD * middling(some)
    count = rises.shape[0] // _LINES
    while count > 1:  # the upper half of each line against the lower
        upper = (count + 1) // 2
        one, other = rises[: (count - upper) * _LINES], rises[upper * _LINES : count * _LINES]
        for m in range(one.shape[0]):
            one[m] = max(one[m], other[m])
        count = upper
    highest = rises[:_LINES]
    standing_out = np.sort(np.maximum(highest - usual, 0.0))
    return standing_out[_RANK] + _MEAN_WEIGHT * standing_out.mean(), usual
