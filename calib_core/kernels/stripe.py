"""The laser stripe's second look at single columns, and what is asked of all columns together.

All work along columns (the stripe runs from left to right); one that runs from top to bottom is turned first.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ImageArray = NDArray[Any]  # uint8 or uint16
FloatArray = NDArray[np.float64]
TableArray = NDArray[np.float32]
CodeArray = NDArray[np.uint8]

OK, WEAK, SATURATED, DOUBLE, SHAPE, ALONE = 0, 1, 2, 3, 4, 5
_MOST_STEPS = 8
_LARGEST_STEP_PX = 1.5


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
    columns: NDArray[np.int32],
    seeds: NDArray[np.int32],
    clean: NDArray[np.bool_],
    tables: TableArray,
    figures: FloatArray,
    limits: FloatArray,
    out: FloatArray,
    code: CodeArray,
) -> None:
    """Look a second time at the columns that were not clean: Newton's steps on tabulated filters, one by one.

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
    clean : (N,)
        The columns that need no second look.
    limits : (6,)
        Variance of the surroundings, growth of the variance with the light, grey value by which a hot pixel stands
        out of its neighbours, grey value of a saturated pixel, most saturated pixels, least amplitude.
    out : (5, N)
        Written: centre, its standard deviation, amplitude, sum of squared residuals of the shape, background.
    code : (N,)
        Only columns with OK are looked at; written: OK, WEAK, SATURATED or SHAPE.
    """
    height = image.shape[0]
    taps = tables.shape[2]
    half, margin = taps // 2, 3
    window = np.empty(min(taps + 2 * margin, height), dtype=np.float32)
    variance, light, hot, saturation = limits[0], limits[1], limits[2], limits[3]
    for n in range(columns.shape[0]):
        if code[n] != OK or clean[n]:
            continue
        # The column before is mostly nearer to the answer than the seed, which saves a step.
        beside = out[0, n - 1] if n > 0 else np.nan
        start = beside if abs(beside - seeds[n]) <= 2.0 else float(seeds[n])
        top = max(0, min(int(start + 0.5) - half - margin, height - window.shape[0]))
        out[0, n] = np.nan
        second = False
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
                if second or residual < 2.0 * expected:
                    break
            elif second:
                break
            _gather_clean(image, top, columns[n], hot, window)
            second = True
        code[n] = WEAK
        if center != center:
            continue
        out[0, n] = top + center
        out[1, n] = np.sqrt(variance * figures[phase, 2] + light * lit * figures[phase, 3]) / -slope
        out[2, n] = amplitude
        out[3, n] = residual
        out[4, n] = mean - amplitude * form / taps
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
    image: ImageArray, columns: NDArray[np.int32], centers: FloatArray, bins_per_px: int, reach: int, hot: float
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
    place = np.empty(width, np.float32)
    for j in range(width):
        place[j] = centers[j] if code[j] == OK else np.float32(np.inf)
    beside = np.zeros(width, np.uint8)
    joined = np.empty(width, np.uint8)
    for apart in range(1, min(reach, width - 1) + 1):
        near = np.float32(1.5 + 1.5 * apart)
        ahead, beside_ahead = place[apart:], beside[apart:]
        for j in range(width - apart):
            joined[j] = abs(place[j] - ahead[j]) <= near  # never where one is infinite: ∞ − ∞ is not a number
            beside[j] += joined[j]
        for j in range(width - apart):
            beside_ahead[j] += joined[j]
    counts = np.zeros(ALONE + 1, dtype=np.int64)
    for j in range(width):
        if code[j] == OK and beside[j] < least:
            code[j] = ALONE
        counts[code[j]] += 1
    return counts


@njit(cache=True, nogil=True, error_model="numpy")
def surroundings_variance(image: ImageArray, samples: int) -> float:
    """Return the variance of the grey values where nothing is seen, from neighbouring pixels' differences."""
    differences = np.abs(_neighbour_differences(image, samples))
    limit = 4.5 * max(0.5, np.partition(differences, samples // 2)[samples // 2])
    total, count = 0.0, 0
    for difference in differences:
        if difference <= limit:
            total += difference * difference
            count += 1
    return total / count / 2


@njit(cache=True, nogil=True, error_model="numpy")
def _neighbour_differences(image: ImageArray, samples: int) -> FloatArray:
    """Return the differences (samples,) of pixels to their right neighbours, taken evenly over the image."""
    height, width = image.shape
    differences = np.empty(samples)
    usable = height * (width - 1)
    step = max(1, (usable // samples) | 1)
    down, across = step // (width - 1), step % (width - 1)
    i, j = 0, 0
    for n in range(samples):
        differences[n] = float(image[i, j + 1]) - float(image[i, j])
        i, j = i + down, j + across
        if j >= width - 1:
            i, j = i + 1, j - (width - 1)
        if i >= height:
            i -= height
    return differences
