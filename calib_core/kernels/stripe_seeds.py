"""Where a laser stripe's peak stands in each column, to a row or two: coarse first, then boxes where it pays.

A glance at the image keeps, for every column and band of rows, the highest pair of looked-at rows (the lower of
two, so that a hot pixel does not count).  Boxes are laid only over the bands that could hold a column's peak or
its rival; where nothing stands out, that is all of them.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.kernels.stripe import DOUBLE, OK, WEAK
from calib_core.kernels.stripe_glance import glance, worth_a_look

ImageArray = NDArray[Any]  # uint8 or uint16
WordArray = NDArray[Any]  # uint16 or uint32
CodeArray = NDArray[np.uint8]
RowArray = NDArray[np.uint16]

# Two neighbouring pixels lie in one word.  Shifts are constants so that the compiler packs many words at a time.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _next_box_8(come: WordArray, gone: WordArray, before: WordArray, box: WordArray) -> None:
    for j in range(box.shape[0]):
        more = np.uint16(np.uint16(come[j] & 0xFF) + np.uint16(come[j] >> 8))
        less = np.uint16(np.uint16(gone[j] & 0xFF) + np.uint16(gone[j] >> 8))
        box[j] = np.uint16(before[j] + more - less)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _next_box_16(come: WordArray, gone: WordArray, before: WordArray, box: WordArray) -> None:
    for j in range(box.shape[0]):
        more = np.uint32(np.uint32(come[j] & 0xFFFF) + np.uint32(come[j] >> 16))
        less = np.uint32(np.uint32(gone[j] & 0xFFFF) + np.uint32(gone[j] >> 16))
        box[j] = np.uint32(before[j] + more - less)


@njit(cache=True, nogil=True, error_model="numpy")
def _boxes(
    words: WordArray, bits: int, rows: int, first: int, last: int, left: int, right: int, boxes: WordArray
) -> None:
    """Write the sums of `rows` looked-at rows that end at `first` … `last`, of the words `left` … `right` − 1."""
    start = boxes[0][left:right]
    start[:] = 0
    for k in range(first - rows + 1, first + 1):
        row = words[2 * k][left:right]
        for j in range(start.shape[0]):
            word = row[j]
            start[j] += (word & 0xFF) + (word >> 8) if bits == 8 else (word & 0xFFFF) + (word >> 16)
    for end in range(first + 1, last + 1):
        come, gone = words[2 * end][left:right], words[2 * (end - rows)][left:right]
        before, box = boxes[end - first - 1][left:right], boxes[end - first][left:right]
        if bits == 8:
            _next_box_8(come, gone, before, box)
        else:
            _next_box_16(come, gone, before, box)


@njit(cache=True, nogil=True, error_model="numpy")
def _search(
    words: WordArray,
    bits: int,
    rows: int,
    ends: tuple[int, int],
    left: int,
    right: int,
    boxes: WordArray,
    best: WordArray,
    place: RowArray,
) -> None:
    """Find the box, ending at one of a range of looked-at rows, that rises highest above both its sides.

    Only the words `left` … `right` − 1 are looked at, and their `best` (W // 2,) and `place` (W // 2,) written.
    """
    count = (words.shape[0] + 1) // 2
    reach = rows + 1
    low, high = max(rows - 1, ends[0] - reach), min(count - 1, ends[1] - 1 + reach)
    _boxes(words, bits, rows, low, high, left, right, boxes)
    best, place = best[left:right], place[left:right]
    for end in range(ends[0], ends[1]):
        above = end - reach if end - reach >= rows - 1 else end + reach
        below = end + reach if end + reach < count else above
        if above > high:
            continue
        row = np.uint16(2 * end - (rows - 1))
        middle = boxes[end - low][left:right]
        upper, lower = boxes[above - low][left:right], boxes[below - low][left:right]
        for j in range(best.shape[0]):
            side = upper[j] if upper[j] > lower[j] else lower[j]
            side = side if side < middle[j] else middle[j]
            rise = boxes.dtype.type(middle[j] - side)
            place[j] = row if rise > best[j] else place[j]
            best[j] = rise if rise > best[j] else best[j]


@njit(cache=True, nogil=True, error_model="numpy")
def seed_columns(
    image: ImageArray, words: WordArray, rows: int, band: int, step: int
) -> tuple[WordArray, RowArray]:
    """Find in each pair of columns and each band of rows the box that rises highest above both its sides.

    Every second row is looked at.  A box next to the image's edge is compared with its inner side alone.

    Parameters
    ----------
    image : (H, W)
    words : (H, W // 2)
        The image, two neighbouring pixels as one word.
    rows, band : int
        Heights of the box and of the bands, in looked-at rows.  The sides are as high as the box, one row from it.
    step : int
        Distance of the rows of the first glance, px: less than twice the peak's width.

    Returns
    -------
    best, place : (looked-at bands, W // 2)
        The rise (grey values summed over the box; 0 where nothing was looked for), and the box's middle row.
    """
    count = (words.shape[0] + 1) // 2
    bands = (count + band - 1) // band
    width, bits = words.shape[1], 8 * image.itemsize
    heights = np.empty((bands, image.shape[1]), image.dtype)
    glance(image, step, 2 * band, heights)
    looked_at = worth_a_look(heights)
    boxes = np.empty((band + 2 * rows + 4, width), words.dtype)
    best = np.zeros((len(looked_at), width), words.dtype)
    place = np.zeros((len(looked_at), width), np.uint16)
    for n in range(len(looked_at)):
        b, left, right = looked_at[n, 0], looked_at[n, 1] // 2, min(looked_at[n, 2] // 2, width)
        first = max(rows - 1, (2 * band * b + rows) // 2)
        beyond = min(count, (2 * band * (b + 1) + rows) // 2)
        _search(words, bits, rows, (first, beyond), left, right, boxes, best[n], place[n])
    return best, place


@njit(cache=True, nogil=True, error_model="numpy")
def choose_seeds(
    best: WordArray, place: RowArray, least_rise: float, apart_px: int, rivalry: float, reach: int, columns: int
) -> tuple[NDArray[np.int32], CodeArray]:
    """Choose each pair of columns' peak among its bands' peaks.

    A peak wins alone where every other that is `apart_px` away rises less than `rivalry` of it.  Otherwise the
    column is double, unless the columns beside it, which are not, bear out exactly one of its peaks.

    Returns
    -------
    row : (columns,)
        Row of the seed for every column.
    code : (columns,)
        OK, WEAK or DOUBLE.
    """
    bands, width = best.shape
    highest, where = best[0].copy(), place[0].copy()
    least = highest.dtype.type(min(np.ceil(least_rise), 2.0 ** (8 * highest.itemsize) - 1))
    for b in range(1, bands):
        rises, rows = best[b], place[b]
        for j in range(width):
            where[j] = rows[j] if rises[j] > highest[j] else where[j]
            highest[j] = rises[j] if rises[j] > highest[j] else highest[j]
    rival = highest.copy()
    for j in range(width):
        rival[j] = np.uint32(np.float32(highest[j]) * np.float32(rivalry))
    double = np.zeros(width, np.uint8)
    most_apart = np.uint16(apart_px)
    for b in range(bands):
        rises, rows = best[b], place[b]
        for j in range(width):
            apart = np.uint16(rows[j] - where[j]) if rows[j] > where[j] else np.uint16(where[j] - rows[j])
            double[j] |= np.uint8((rises[j] > rival[j]) & (apart > most_apart))
    code = np.empty(width, np.uint8)
    doubles = np.uint8(0)
    for j in range(width):
        double[j] &= np.uint8(highest[j] >= least)
        doubles |= double[j]
    for j in range(width):
        code[j] = np.uint8(DOUBLE if double[j] else OK) if highest[j] >= least else np.uint8(WEAK)
    if doubles:
        _bear_out(best, place, where, code, highest, apart_px, rivalry, reach)
    rows_of = np.empty(columns, dtype=np.int32)
    codes = np.empty(columns, dtype=np.uint8)
    for j in range(width):
        rows_of[2 * j] = rows_of[2 * j + 1] = where[j]
        codes[2 * j] = codes[2 * j + 1] = code[j]
    if columns > 2 * width:
        rows_of[columns - 1], codes[columns - 1] = where[width - 1], code[width - 1]
    return rows_of, codes


@njit(cache=True, nogil=True, error_model="numpy")
def _bear_out(
    best: WordArray,
    place: RowArray,
    row: RowArray,
    code: CodeArray,
    highest: WordArray,
    apart_px: int,
    rivalry: float,
    reach: int,
) -> None:
    """Settle the double columns of which the columns beside them bear out exactly one peak."""
    sure = code == OK
    for j in range(row.shape[0]):
        if code[j] != DOUBLE:
            continue
        top = np.int64(row[j])
        borne_out = -1
        count = 0
        for b in range(best.shape[0]):
            here = np.int64(place[b, j])
            if best[b, j] <= rivalry * highest[j] or (here != top and abs(here - top) <= apart_px):
                continue
            if _supporters(row, sure, j, int(here), reach) >= reach // 2:
                borne_out = here
                count += 1
        if count == 1:
            row[j] = borne_out
            code[j] = OK


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _supporters(row: RowArray, sure: NDArray[np.bool_], column: int, here: int, reach: int) -> int:
    """Count the sure columns within `reach` whose stripe could run through row `here` of `column`."""
    count = 0
    for i in range(max(0, column - reach), min(row.shape[0], column + reach + 1)):
        if i != column and sure[i] and abs(np.int64(row[i]) - here) <= 2 + 1.5 * abs(i - column):
            count += 1
    return count
