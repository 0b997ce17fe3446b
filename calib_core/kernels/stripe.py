"""The laser stripe's second look at single columns, and what is asked of all columns together.

All work along columns (the stripe runs from left to right); one that runs from top to bottom is turned first.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.stripe_filters import StripeFilters

ImageArray = NDArray[Any]  # uint8 or uint16
TableArray = NDArray[np.float32]
CodeArray = NDArray[np.uint8]

OK, WEAK, SATURATED, DOUBLE, SHAPE, ALONE = 0, 1, 2, 3, 4, 5
_MOST_STEPS = 8
_LARGEST_STEP_PX = 1.5


class Limits(NamedTuple):
    """What the frame's noise and its grey values make of a peak.

    Parameters
    ----------
    variance : float
        Of the surroundings.
    light : float
        Growth of the variance with the light.
    hot : float
        Grey value by which a hot pixel stands out of its neighbours.
    saturation : float
        Grey value of a saturated pixel.
    most_saturated : float
        Most pixels of a peak that may be saturated.
    least_amplitude : float
    """

    variance: float
    light: float
    hot: float
    saturation: float
    most_saturated: float
    least_amplitude: float


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _gather(image: ImageArray, top: int, column: int, window: TableArray) -> None:
    for k in range(window.shape[0]):
        window[k] = np.float32(image[top + k, column])


@njit(cache=True, nogil=True, error_model="numpy")
def gather_clean(image: ImageArray, top: int, column: int, hot: float, window: TableArray) -> None:
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
    filters: StripeFilters,
    limits: Limits,
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
    clean : (N,)
        The columns that need no second look.
    filters, limits : see `StripeFilters`, `Limits`
    out : (5, N)
        Written: centre, its standard deviation, amplitude, sum of squared residuals of the shape, background.
    code : (N,)
        Only columns with OK are looked at; written: OK, WEAK, SATURATED or SHAPE.
    """
    height, taps = image.shape[0], filters.taps
    tables, figures = filters.tables, filters.figures
    half, margin = taps // 2, 3
    window = np.empty(min(taps + 2 * margin, height), dtype=np.float32)
    variance, light, saturation = limits.variance, limits.light, limits.saturation
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
            gather_clean(image, top, columns[n], limits.hot, window)
            second = True
        code[n] = WEAK
        if center != center:
            continue
        out[0, n] = top + center
        out[1, n] = np.sqrt(variance * figures[phase, 2] + light * lit * figures[phase, 3]) / -slope
        out[2, n] = amplitude
        out[3, n] = residual
        out[4, n] = mean - amplitude * form / taps
        if amplitude < limits.least_amplitude:
            continue
        saturated = 0
        if window[shift + half] >= saturation:
            for k in range(taps):
                saturated += 1 if window[shift + k] >= saturation else 0
        if saturated > limits.most_saturated:
            code[n] = SATURATED
        else:
            irregular = residual > 4.0 * expected + taps * 0.0484 * lit * lit
            flat = saturated == 0 and -slope < 0.5 * lit * figures[phase, 4]
            code[n] = SHAPE if irregular or flat else OK
