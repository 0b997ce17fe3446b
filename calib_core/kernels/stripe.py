"""The laser stripe's hot loops: where each column is brightest, and where exactly the peak stands.

Both work along columns (the stripe runs from left to right); one that runs from top to bottom is turned first.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ImageArray = NDArray[Any]  # uint8 or uint16
WordArray = NDArray[Any]  # uint16 or uint32
FloatArray = NDArray[np.float64]
TableArray = NDArray[np.float32]
CodeArray = NDArray[np.uint8]

OK, WEAK, SATURATED, DOUBLE, SHAPE, ALONE = 0, 1, 2, 3, 4, 5
_MOST_STEPS = 8
_LARGEST_STEP_PX = 1.5


# Two neighbouring pixels lie in one word.  Shifts are constants so that the compiler packs many words at a time.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _row_sums_8(words: WordArray, come: int, gone: int, ring: WordArray, place: int, before: int) -> None:
    for j in range(ring.shape[1]):
        more = np.uint16(np.uint16(words[come, j] & 0xFF) + np.uint16(words[come, j] >> 8))
        less = np.uint16(np.uint16(words[gone, j] & 0xFF) + np.uint16(words[gone, j] >> 8))
        ring[place, j] = np.uint16(ring[before, j] + more - less)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _row_sums_16(words: WordArray, come: int, gone: int, ring: WordArray, place: int, before: int) -> None:
    for j in range(ring.shape[1]):
        more = np.uint32(np.uint32(words[come, j] & 0xFFFF) + np.uint32(words[come, j] >> 16))
        less = np.uint32(np.uint32(words[gone, j] & 0xFFFF) + np.uint32(words[gone, j] >> 16))
        ring[place, j] = np.uint32(ring[before, j] + more - less)


@njit(cache=True, nogil=True, error_model="numpy")
def seed_columns(
    words: WordArray, bits: int, rows: int, band: int, ring: WordArray, best: WordArray, place: NDArray[np.uint16]
) -> None:
    """Find in each pair of columns and each band of rows the box that rises highest above both its sides.

    Every second row is looked at.  A box next to the image's edge is compared with its inner side alone.

    Parameters
    ----------
    words : (H, W // 2)
        The image, two neighbouring pixels as one word.
    bits : int
        Of one pixel.
    rows, band : int
        Heights of the box and of the bands, in looked-at rows.  The sides are as high as the box, one row from it.
    ring : (2 (rows + 1) + 1, W // 2)
        Scratch.
    best, place : (bands, W // 2)
        Written: the rise (grey values summed over the box), and the row of the box's middle.
    """
    count = (words.shape[0] + 1) // 2
    reach = rows + 1
    size = ring.shape[0]
    best[:] = 0
    place[:] = 0
    ring[:] = 0
    for k in range(count + reach):
        here = k % size
        if k < rows:  # the box fills; the ring's other rows are still zero
            before = (k - 1 + size) % size
            for j in range(ring.shape[1]):
                word = words[2 * k, j]
                ring[here, j] = ring[before, j] + (
                    (word & 0xFF) + (word >> 8) if bits == 8 else (word & 0xFFFF) + (word >> 16)
                )
        elif k < count:
            before = (k - 1) % size
            if bits == 8:
                _row_sums_8(words, 2 * k, 2 * (k - rows), ring, here, before)
            else:
                _row_sums_16(words, 2 * k, 2 * (k - rows), ring, here, before)
        end = k - reach
        if end < rows - 1:
            continue
        above = (end - reach) % size if end - reach >= rows - 1 else here
        below = here if k < count else above
        middle = 2 * end - (rows - 1)
        b = middle // (2 * band)
        row = np.uint16(middle)
        m = end % size
        for j in range(ring.shape[1]):
            side = max(ring[above, j], ring[below, j])
            rise = ring.dtype.type(ring[m, j] - min(ring[m, j], side))
            place[b, j] = row if rise > best[b, j] else place[b, j]
            best[b, j] = max(rise, best[b, j])


@njit(cache=True, nogil=True, error_model="numpy")
def choose_seeds(
    best: WordArray,
    place: NDArray[np.uint16],
    least_rise: float,
    apart_px: int,
    rivalry: float,
    reach: int,
    columns: int,
) -> tuple[NDArray[np.int64], CodeArray]:
    """Choose each pair of columns' peak among its bands' peaks.

    A peak wins alone where every other that is `apart_px` away rises less than `rivalry` of it.  Otherwise the
    column is double, unless the columns beside it, which are not, bear out exactly one of its peaks.

    Returns
    -------
    row : (columns,)
        Row of the seed for every column, −1 where there is none.
    code : (columns,)
        OK, WEAK or DOUBLE.
    """
    bands, width = best.shape
    row = np.full(width, -1, dtype=np.int64)
    code = np.full(width, WEAK, dtype=np.uint8)
    highest = best[0].copy()
    where = place[0].copy()
    for b in range(1, bands):
        for j in range(width):
            where[j] = place[b, j] if best[b, j] > highest[j] else where[j]
            highest[j] = max(best[b, j], highest[j])
    for j in range(width):
        if highest[j] >= least_rise:
            row[j], code[j] = where[j], OK
    for b in range(bands):
        for j in range(width):
            if (
                best[b, j] > rivalry * highest[j]
                and code[j] == OK
                and abs(np.int64(place[b, j]) - row[j]) > apart_px
            ):
                code[j] = DOUBLE
    sure = code == OK
    for j in range(width):
        if code[j] != DOUBLE:
            continue
        top = row[j]
        ceiling = float(highest[j])
        borne_out = -1
        count = 0
        for b in range(bands):
            here = np.int64(place[b, j])
            if best[b, j] <= rivalry * ceiling or (here != top and abs(here - top) <= apart_px):
                continue
            if _supporters(row, sure, j, int(here), reach) >= reach // 2:
                borne_out = here
                count += 1
        if count == 1:
            row[j] = borne_out
            code[j] = OK
    rows = np.empty(columns, dtype=np.int64)
    codes = np.empty(columns, dtype=np.uint8)
    for i in range(columns):
        j = min(i // 2, width - 1)
        rows[i], codes[i] = row[j], code[j]
    return rows, codes


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _supporters(row: NDArray[np.int64], sure: NDArray[np.bool_], column: int, here: int, reach: int) -> int:
    """Count the sure columns within `reach` whose stripe could run through row `here` of `column`."""
    count = 0
    for i in range(max(0, column - reach), min(row.shape[0], column + reach + 1)):
        if i != column and sure[i] and abs(row[i] - here) <= 2 + 1.5 * abs(i - column):
            count += 1
    return count


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _gather(image: ImageArray, top: int, column: int, window: TableArray) -> None:
    for k in range(window.shape[0]):
        window[k] = np.float32(image[top + k, column])


@njit(cache=True, nogil=True, error_model="numpy")
def _gather_clean(image: ImageArray, top: int, column: int, hot: float, window: TableArray) -> None:
    """Copy a column's window; a pixel that stands out of all four neighbours is replaced by those beside it."""
    height, width = image.shape
    left = column - 1 if column > 0 else column + 1
    right = column + 1 if column + 1 < width else column - 1
    for k in range(window.shape[0]):
        i = top + k
        value = np.float32(image[i, column])
        side = max(image[i, left], image[i, right])
        if value > side + hot:
            above = image[i - 1, column] if i > 0 else image[i + 1, column]
            below = image[i + 1, column] if i + 1 < height else image[i - 1, column]
            if value > max(above, below) + hot:
                value = np.float32(0.5) * (np.float32(image[i, left]) + np.float32(image[i, right]))
        window[k] = value


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _newton(window: TableArray, first: int, start: float, tables: TableArray) -> tuple[int, int, float, float]:
    """Return shift and phase of the last filter, the centre relative to the window (NaN: lost) and the slope."""
    phases, taps = tables.shape[1] - 1, tables.shape[2]
    center = start
    for _ in range(_MOST_STEPS):
        whole = np.floor(center + 0.5)
        shift = int(whole) - first
        if shift < 0 or shift + taps > window.shape[0]:
            break
        phase = int((center - whole + 0.5) * phases + 0.5)
        at = whole - 0.5 + phase / phases
        response, slope = np.float32(0.0), np.float32(0.0)
        for k in range(taps):
            response += window[shift + k] * tables[0, phase, k]
            slope += window[shift + k] * tables[1, phase, k]
        if not slope < 0.0:  # between two peaks, or far from one: go uphill
            center = at + (1.0 if response > 0.0 else -1.0)
            continue
        step = -response / slope
        if abs(step) > _LARGEST_STEP_PX:
            step = _LARGEST_STEP_PX if step > 0 else -_LARGEST_STEP_PX
        center = at + step
        if abs(step) < 1.5 / phases:
            return shift, phase, center, float(slope)
    return 0, 0, np.nan, 0.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _shape_sums(window: TableArray, shift: int, even: TableArray) -> tuple[float, float, float]:
    total, square, match = np.float32(0.0), np.float32(0.0), np.float32(0.0)
    for k in range(even.shape[0]):
        value = window[shift + k]
        total += value
        square += value * value
        match += value * even[k]
    return float(total), float(square), float(match)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_columns(
    image: ImageArray,
    columns: NDArray[np.int64],
    seeds: NDArray[np.int64],
    tables: TableArray,
    figures: FloatArray,
    limits: FloatArray,
    out: FloatArray,
    code: CodeArray,
) -> None:
    """Find where the odd filter's response to each column's peak is zero: Newton's steps on tabulated filters.

    A column that does not look like the peak's shape is looked at again without its hot pixels.

    Parameters
    ----------
    image : (H, W)
    columns, seeds : (N,)
        Which columns, and the rows to start from.
    tables : (3, phases + 1, taps)
        For centres at −½ … ½ of a pixel: the filter h(u) with u = row − centre, its response's derivative −dh/du,
        and the peak's shape g(u).
    figures : (phases + 1, 5)
        Per phase: Σg, Σ(g − mean)², Σh², Σh²g, Σ−g·(−dh/du).
    limits : (7,)
        Variance of the surroundings, growth of the variance with the light, grey value by which a hot pixel stands
        out of its neighbours, grey value of a saturated pixel, most saturated pixels, least amplitude, whether to
        remove hot pixels at once.
    out : (N, 5)
        Written: centre, its standard deviation, amplitude, sum of squared residuals of the shape, background.
    code : (N,)
        Only columns with OK are looked at; written: OK, WEAK, SATURATED or SHAPE.
    """
    height = image.shape[0]
    taps = tables.shape[2]
    half, margin = taps // 2, 3
    window = np.empty(min(taps + 2 * margin, height), dtype=np.float32)
    variance, light, hot, saturation = limits[0], limits[1], limits[2], limits[3]
    beside = np.nan
    for n in range(columns.shape[0]):
        out[n, 0] = np.nan
        if code[n] != OK:
            continue
        # The column before is mostly nearer to the answer than the seed, which saves a step.
        start = beside if abs(beside - seeds[n]) <= 2.0 else float(seeds[n])
        top = max(0, min(int(start + 0.5) - half - margin, height - window.shape[0]))
        clean = limits[6] > 0.0
        if clean:
            _gather_clean(image, top, columns[n], hot, window)
        else:
            _gather(image, top, columns[n], window)
        mean = form = amplitude = residual = lit = expected = 0.0
        while True:
            shift, phase, center, slope = _newton(window, half, start - top, tables)
            if center == center:
                total, square, match = _shape_sums(window, shift, tables[2, phase])
                form, energy = figures[phase, 0], figures[phase, 1]
                mean = total / taps
                amplitude = (match - form * mean) / energy
                residual = max(0.0, square - total * mean - amplitude * amplitude * energy)
                lit = max(amplitude, 0.0)
                expected = taps * variance + light * lit * form
                if clean or residual < 2.0 * expected:
                    break
            elif clean:
                break
            _gather_clean(image, top, columns[n], hot, window)
            clean = True
        code[n] = WEAK
        if center != center:
            continue
        beside = top + center
        out[n, 0] = beside
        out[n, 1] = np.sqrt(variance * figures[phase, 2] + light * lit * figures[phase, 3]) / -slope
        out[n, 2] = amplitude
        out[n, 3] = residual
        out[n, 4] = mean - amplitude * form / taps
        if amplitude < limits[5]:
            continue
        saturated = 0
        if window[shift + half] >= saturation:
            for k in range(taps):
                saturated += 1 if window[shift + k] >= saturation else 0
        if saturated > limits[4]:
            code[n] = SATURATED
        else:
            irregular = residual > 4.0 * expected + taps * 0.0484 * lit * lit
            flat = saturated == 0 and -slope < 0.5 * lit * figures[phase, 4]
            code[n] = SHAPE if irregular or flat else OK


@njit(cache=True, nogil=True, error_model="numpy")
def stack_profile(
    image: ImageArray, columns: NDArray[np.int64], centers: FloatArray, bins_per_px: int, reach: int, hot: float
) -> tuple[FloatArray, FloatArray]:
    """Lay the peaks of several columns over each other.

    Returns
    -------
    sums, counts : (2 reach bins_per_px + 1,)
        Grey values by their distance from the centre, each column's added up as it is.
    """
    size = 2 * reach * bins_per_px + 1
    sums = np.zeros(size)
    counts = np.zeros(size)
    height = image.shape[0]
    window = np.empty(2 * reach, dtype=np.float32)
    for n in range(columns.shape[0]):
        center = centers[n]
        if not np.isfinite(center):
            continue
        top = int(np.ceil(center - reach))
        if top < 0 or top + 2 * reach + 1 > height:
            continue
        _gather_clean(image, top, columns[n], hot, window)
        for k in range(2 * reach):
            place = int(np.floor((top + k - center + reach) * bins_per_px + 0.5))
            sums[place] += window[k]
            counts[place] += 1.0
    return sums, counts


@njit(cache=True, nogil=True, error_model="numpy")
def mark_alone(centers: FloatArray, code: CodeArray, reach: int, least: int) -> NDArray[np.int64]:
    """Mark the good centres that fewer than `least` good ones within `reach` columns continue; count the codes.

    Parameters
    ----------
    centers, code : (W,)
        Of every column.
    """
    width = centers.shape[0]
    alone = np.zeros(width, dtype=np.bool_)
    for j in range(width):
        if code[j] != OK:
            continue
        count = 0
        for apart in range(1, reach + 1):  # the nearest first: they mostly settle it
            for i in (j - apart, j + apart):
                if 0 <= i < width and code[i] == OK and abs(centers[i] - centers[j]) <= 1.5 + 1.5 * apart:
                    count += 1
            if count >= least:
                break
        alone[j] = count < least
    counts = np.zeros(ALONE + 1, dtype=np.int64)
    for j in range(width):
        if alone[j]:
            code[j] = ALONE
        counts[code[j]] += 1
    return counts


@njit(cache=True, nogil=True, error_model="numpy")
def neighbour_differences(image: ImageArray, samples: int) -> FloatArray:
    """Return the differences (samples,) of pixels to their right neighbours, taken evenly over the image."""
    height, width = image.shape
    differences = np.empty(samples)
    usable = height * (width - 1)
    step = max(1, (usable // samples) | 1)
    for n in range(samples):
        place = (n * step) % usable
        i, j = place // (width - 1), place % (width - 1)
        differences[n] = float(image[i, j + 1]) - float(image[i, j])
    return differences
