"""The stripe of a whole frame in two calls: a survey of where it is and of its noise, then the centres.

Two calls, because the centring filter is chosen between them; and no more, because a call from Python costs as
much as a hundred columns.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.kernels.stripe import OK, mark_alone, measure_columns, surroundings_variance
from calib_core.kernels.stripe_peaks import measure_peaks
from calib_core.kernels.stripe_seeds import choose_seeds, seed_columns

ImageArray = NDArray[Any]  # uint8 or uint16
WordArray = NDArray[Any]  # uint16 or uint32
FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
CodeArray = NDArray[np.uint8]
RowArray = NDArray[np.int32]

_NOISE_SAMPLES = 512
_QUANTISATION_VARIANCE = 1 / 12
_NO_LIMIT = 1e9
_NARROWEST_PX = 0.9  # narrower peaks' responses change too fast from row to row to be interpolated


@njit(cache=True, nogil=True, error_model="numpy")
def look(
    image: ImageArray,
    columns: RowArray,
    seeds: RowArray,
    codes: CodeArray,
    short: SingleArray,
    filters: SingleArray,
    taps: int,
    width_px: float,
    tables: SingleArray,
    figures: FloatArray,
    limits: FloatArray,
) -> FloatArray:
    """Measure the columns' peaks, all at once first; look a second time where one is not as it should be.

    Parameters
    ----------
    columns, seeds, codes : (N,)
        Codes are written.
    short, filters, taps, width_px, tables, figures : see `stripe_peaks.measure_peaks`, `stripe.measure_columns`
    limits : (6,)
        See `stripe.measure_columns`.

    Returns
    -------
    (5, N)
        Centre, its standard deviation, amplitude, sum of squared residuals of the shape, background.
    """
    if width_px < _NARROWEST_PX:
        out, clean = np.full((5, columns.shape[0]), np.nan), np.zeros(columns.shape[0], np.bool_)
    else:
        first = np.array([limits[0], limits[1], limits[3], limits[5]])
        out, clean = measure_peaks(
            image, columns, seeds, codes == OK, short, filters, taps, width_px, figures, first
        )
    measure_columns(image, columns, seeds, clean, tables, figures, limits, out, codes)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sample(
    image: ImageArray,
    columns: RowArray,
    seeds: RowArray,
    variance: float,
    short: SingleArray,
    filters: SingleArray,
    taps: int,
    width_px: float,
    tables: SingleArray,
    figures: FloatArray,
) -> FloatArray:
    """Measure a few columns' peaks, (5, N), whatever their amplitude and saturation."""
    codes = np.zeros(columns.shape[0], np.uint8)
    limits = np.array([variance, 0.0, 6.0 * np.sqrt(variance), _NO_LIMIT, _NO_LIMIT, 0.0])
    return look(image, columns, seeds, codes, short, filters, taps, width_px, tables, figures, limits)


@njit(cache=True, nogil=True, error_model="numpy")
def survey(
    image: ImageArray,
    words: WordArray,
    bits: int,
    rows: int,
    step: int,
    rivalry: float,
    samples: int,
    short: SingleArray,
    filters: SingleArray,
    taps: int,
    width_px: float,
    tables: SingleArray,
    figures: FloatArray,
) -> tuple[float, RowArray, CodeArray, RowArray, FloatArray]:
    """Find the peak of each column to a row or two, and measure a few of them.

    Parameters
    ----------
    image, words, bits, rows, step : see `stripe_seeds.seed_columns`
    rivalry : see `stripe_seeds.choose_seeds`
    samples : int
        About how many columns are measured.
    short, filters, taps, width_px, tables, figures : see `look`
        For even noise.

    Returns
    -------
    variance : float
        Of the grey values where nothing is seen.
    seeds, codes : (W,)
    sampled : (S,)
        Columns.
    measured : (5, S)
    """
    variance = surroundings_variance(image, _NOISE_SAMPLES) + _QUANTISATION_VARIANCE
    best, place = seed_columns(image, words, bits, rows, max(32, 2 * rows), step)
    least_rise = 4.0 * np.sqrt(4.0 * rows * variance)
    seeds, codes = choose_seeds(best, place, least_rise, 2 * rows + 1, rivalry, 5, image.shape[1])
    count = 0
    for code in codes:
        count += code == OK
    every = max(1, count // samples)
    sampled = np.empty((count + every - 1) // every, np.int32)
    n = 0
    for j in range(codes.shape[0]):
        if codes[j] == OK:
            if n % every == 0:
                sampled[n // every] = j
            n += 1
    measured = sample(image, sampled, seeds[sampled], variance, short, filters, taps, width_px, tables, figures)
    return variance, seeds, codes, sampled, measured


@njit(cache=True, nogil=True, error_model="numpy")
def noise_growth(measured: FloatArray, variance: float, taps: int, mean_shape: float) -> tuple[float, float]:
    """Return by how much the variance grows with the light, and the usual amplitude, of measured peaks (5, S)."""
    amplitude, excess = np.empty(measured.shape[1]), np.empty(measured.shape[1])
    count = 0
    for j in range(measured.shape[1]):
        if np.isfinite(measured[0, j]) and measured[2, j] > 0.0:
            amplitude[count] = measured[2, j]
            excess[count] = (measured[3, j] / (taps - 3) - variance) / measured[2, j]
            count += 1
    if count == 0:
        return 0.0, 1.0
    light = np.median(excess[:count]) / mean_shape
    return max(0.0, light), np.median(amplitude[:count])


@njit(cache=True, nogil=True, error_model="numpy")
def measure(
    image: ImageArray,
    seeds: RowArray,
    codes: CodeArray,
    short: SingleArray,
    filters: SingleArray,
    taps: int,
    width_px: float,
    tables: SingleArray,
    figures: FloatArray,
    limits: FloatArray,
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Measure every column's peak; keep those that are as they should be and that others continue.

    Parameters
    ----------
    image : (H, W)
    seeds, codes : (W,)
        Codes are written.
    short, filters, taps, width_px, tables, figures, limits : see `look`

    Returns
    -------
    centers : (4, N)
        Column, row, its standard deviation, amplitude.
    counts : (codes,)
        How many columns have each code.
    """
    columns = np.arange(image.shape[1]).astype(np.int32)
    out = look(image, columns, seeds, codes, short, filters, taps, width_px, tables, figures, limits)
    counts = mark_alone(out[0], codes, 5, 3)
    centers = np.empty((4, counts[OK]))
    n = 0
    for j in range(codes.shape[0]):
        if codes[j] == OK:
            centers[0, n], centers[1, n] = j, out[0, j]
            centers[2, n], centers[3, n] = out[1, j], out[2, j]
            n += 1
    return centers, counts
