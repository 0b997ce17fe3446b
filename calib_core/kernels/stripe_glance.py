"""A glance at a frame: in which bands of rows could a column's peak, or a rival of it, be at all.

For every column and band of rows the highest pair of looked-at rows is kept (the lower of two, so that a hot pixel
does not count).
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ImageArray = NDArray[Any]  # uint8 or uint16

_BLOCK = 32  # columns
_SHARE = 7  # in 32: a band below this share of the column's range of heights holds neither its peak nor its rival


@njit(cache=True, nogil=True, error_model="numpy")
def glance(image: ImageArray, step: int, band_px: int, heights: ImageArray) -> None:
    """Write the highest pair of rows, `step` apart, of each column in each band of rows.

    Parameters
    ----------
    image : (H, W)
    heights : (bands, W)
        Written: the largest of min(upper, lower).
    """
    height = image.shape[0]
    for b in range(heights.shape[0]):
        most = heights[b]
        most[:] = 0
        end = min((b + 1) * band_px, height - step)
        row = b * band_px
        while row < end:
            if row + 3 * step < end and row + 6 * step < height:
                _six_pairs(image, row, step, most)
                row += 6 * step
            else:
                _three_pairs(image, row, step, most)
                row += 3 * step


@njit(cache=True, nogil=True, error_model="numpy")
def _six_pairs(image: ImageArray, row: int, step: int, most: ImageArray) -> None:
    """Raise `most` (W,) to the highest of the six pairs of rows from `row` on."""
    first, second, third, fourth = image[row], image[row + step], image[row + 2 * step], image[row + 3 * step]
    fifth, sixth, seventh = image[row + 4 * step], image[row + 5 * step], image[row + 6 * step]
    for j in range(most.shape[0]):
        c, d, e = third[j], fourth[j], fifth[j]
        upper = max(min(first[j], second[j]), min(second[j], c))
        middle = max(min(c, d), min(d, e))
        lower = max(min(e, sixth[j]), min(sixth[j], seventh[j]))
        most[j] = max(max(most[j], upper), max(middle, lower))


@njit(cache=True, nogil=True, error_model="numpy")
def _three_pairs(image: ImageArray, row: int, step: int, most: ImageArray) -> None:
    """Raise `most` (W,) to the highest of up to three pairs of rows from `row` on."""
    height = image.shape[0]
    first, second = image[row], image[row + step]
    third = image[row + 2 * step] if row + 2 * step < height else second
    fourth = image[row + 3 * step] if row + 3 * step < height else third
    for j in range(most.shape[0]):
        middle = max(min(second[j], third[j]), min(third[j], fourth[j]))
        most[j] = max(max(most[j], min(first[j], second[j])), middle)


@njit(cache=True, nogil=True, error_model="numpy")
def worth_a_look(heights: ImageArray) -> NDArray[np.int64]:
    """Return the bands that could hold a peak or its rival, each with the columns from which to which, (N, 3).

    One long run of columns is sooner done than several short ones.
    """
    bands, width = heights.shape
    least, highest = heights[0].copy(), heights[0].copy()
    for b in range(1, bands):
        row = heights[b]
        for j in range(width):
            least[j] = min(least[j], row[j])
            highest[j] = max(highest[j], row[j])
    for j in range(width):
        least[j] += (np.uint32(highest[j] - least[j]) * np.uint32(_SHARE)) >> np.uint32(5)
    found = np.empty((bands, 3), np.int64)
    count = 0
    stands_out = np.empty(width, np.uint8)
    for b in range(bands):
        row = heights[b]
        any_stands_out = np.uint8(0)
        for j in range(width):
            stands_out[j] = row[j] >= least[j]
            any_stands_out |= stands_out[j]
        if any_stands_out:
            first, last = 0, width - 1
            while not stands_out[first]:
                first += 1
            while not stands_out[last]:
                last -= 1
            found[count, 0] = b
            found[count, 1], found[count, 2] = first // _BLOCK * _BLOCK, (last // _BLOCK + 1) * _BLOCK
            count += 1
    return found[:count]
