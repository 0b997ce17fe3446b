"""The stripe of a whole frame in one call: where it is, how wide and how noisy, then the centres.

One call, because one from Python costs as much as a hundred columns.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.stripe import OK, Limits, measure_columns
from calib_core.kernels.stripe_alone import mark_alone
from calib_core.kernels.stripe_filters import PHASES, StripeFilters, filters_of, noise_ratio_of
from calib_core.kernels.stripe_noise import noise_growth, surroundings_variance
from calib_core.kernels.stripe_peaks import measure_peaks
from calib_core.kernels.stripe_seeds import choose_seeds, seed_columns
from calib_core.kernels.stripe_width import peak_width

ImageArray = NDArray[Any]  # uint8 or uint16
WordArray = NDArray[Any]  # uint16 or uint32
CodeArray = NDArray[np.uint8]
RowArray = NDArray[np.int32]

_NOISE_SAMPLES = 512
_SAMPLED_COLUMNS = 48
_QUANTISATION_VARIANCE = 1 / 12
_NO_LIMIT = 1e9
_SUPPORTERS_REACH = 5


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def look(
    image: ImageArray, columns: RowArray, seeds: RowArray, codes: CodeArray, filters: StripeFilters, limits: Limits
) -> FloatArray:
    """Measure the columns' peaks, all at once first; look a second time where one is not as it should be.

    Parameters
    ----------
    columns, seeds, codes : (N,)
        Codes are written.
    filters, limits : see `StripeFilters`, `Limits`

    Returns
    -------
    (5, N)
        Centre, its standard deviation, amplitude, sum of squared residuals of the shape, background.
    """
    out, clean = measure_peaks(image, columns, seeds, codes == OK, filters, limits)
    measure_columns(image, columns, seeds, clean, filters, limits, out, codes)
    return out


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _sample(
    image: ImageArray, columns: RowArray, seeds: RowArray, variance: float, filters: StripeFilters
) -> FloatArray:
    """Measure a few columns' peaks, (5, N), whatever their amplitude and saturation."""
    codes = np.zeros(columns.shape[0], np.uint8)
    limits = Limits(variance, 0.0, 6.0 * np.sqrt(variance), _NO_LIMIT, _NO_LIMIT, 0.0)
    return look(image, columns, seeds, codes, filters, limits)


@njit(cache=True, nogil=True, error_model="numpy")
def _spread(codes: CodeArray, about: int) -> RowArray:
    """Return `about` so many of the columns with a seed, evenly spread."""
    good = np.flatnonzero(codes == OK).astype(np.int32)
    return good[:: max(1, len(good) // about)].copy()


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _seeds(
    image: ImageArray, words: WordArray, box_width_px: float, rivalry: float, variance: float
) -> tuple[RowArray, CodeArray]:
    """Find the peak of each column to a row or two; see `stripe_seeds.choose_seeds`."""
    height, width = image.shape
    rows = max(3, min(int(np.round(1.5 * box_width_px)), 60, height // 10))
    step = max(1, int(1.5 * box_width_px))
    best, place = seed_columns(image, words, rows, max(32, 2 * rows), step)
    least_rise = 4.0 * np.sqrt(4.0 * rows * variance)
    return choose_seeds(best, place, least_rise, 2 * rows + 1, rivalry, _SUPPORTERS_REACH, width)


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _look_at_some(
    image: ImageArray,
    seeds: RowArray,
    codes: CodeArray,
    variance: float,
    hot: float,
    box_width_px: float,
    given_width_px: float,
    widths: FloatArray,
    shapes: FloatArray,
) -> tuple[float, float, float]:
    """Return the peak's width (px), the variance's growth with the light and the filters' noise ratio."""
    sampled = _spread(codes, _SAMPLED_COLUMNS)
    rows = seeds[sampled]
    filters = filters_of(round(box_width_px, 2), 0.0)
    measured = _sample(image, sampled, rows, variance, filters)
    if given_width_px == 0.0 and len(sampled):
        width_px = peak_width(image, sampled, measured[0], hot, widths, shapes)
        filters = filters_of(round(width_px, 2), 0.0)
        measured = _sample(image, sampled, rows, variance, filters)
    light, amplitude = noise_growth(measured, variance, filters.taps, filters.mean_shape)
    return filters.width_px, light, noise_ratio_of(light * amplitude / variance)


@njit(cache=True, nogil=True, error_model="numpy")
def find(
    image: ImageArray,
    words: WordArray,
    box_width_px: float,
    given_width_px: float,
    saturation: float,
    least_snr: float,
    rivalry: float,
    widths: FloatArray,
    shapes: FloatArray,
    codes: CodeArray,
    centers: FloatArray,
) -> tuple[float, float, tuple[int, int, int, int, int, int]]:
    """Find one centre per column.

    Parameters
    ----------
    image : (H, W)
    words : (H, W // 2)
        The image, two neighbouring pixels as one word.
    box_width_px : float
        The peak's width for which the boxes are laid that look for it.
    given_width_px : float
        The peak's width; 0: estimated.
    saturation : float
        Grey value of a saturated pixel.
    least_snr, rivalry : float
        See `optics.stripe.StripeOptions`.
    widths, shapes : see `stripe_width.peak_width`
    codes : (W,)
        Written.
    centers : (6, W)
        Written, of those that are as they should be: column, row, its standard deviation, amplitude, background,
        and by how much a background that rises by one grey value a pixel draws the centre, px.

    Returns
    -------
    width_px : float
    variance : float
        Of the grey values where nothing is seen.
    counts : (6,)
        How many columns have each code; the first is how many centres were written.
    """
    variance = surroundings_variance(image, _NOISE_SAMPLES) + _QUANTISATION_VARIANCE
    seeds, seeds_codes = _seeds(image, words, box_width_px, rivalry, variance)
    for j in range(len(codes)):
        codes[j] = seeds_codes[j]
    hot = 6.0 * np.sqrt(variance) + 0.02 * saturation
    width_px, light, noise_ratio = _look_at_some(
        image, seeds, codes, variance, hot, box_width_px, given_width_px, widths, shapes
    )
    filters = filters_of(width_px, noise_ratio)
    least = least_snr * np.sqrt(variance / filters.energy)
    limits = Limits(variance, light, hot, saturation, 3.0 * width_px, least)
    columns = np.arange(image.shape[1]).astype(np.int32)
    out = look(image, columns, seeds, codes, filters, limits)
    mark_alone(out[0], codes)
    _gather_good(out, codes, filters, limits, centers)
    return width_px, variance, _counts(codes)


@njit(cache=True, nogil=True, error_model="numpy")
def _gather_good(
    measured: FloatArray, codes: CodeArray, filters: StripeFilters, limits: Limits, centers: FloatArray
) -> None:
    """Write what `find` returns of the good columns."""
    middle, half = PHASES // 2, filters.taps // 2
    lever, dark, lit = 0.0, filters.figures[middle, 2], filters.figures[middle, 3]
    for k in range(filters.taps):
        lever += (k - half) * filters.tables[0, middle, k]
    n = 0
    for j in range(codes.shape[0]):
        if codes[j] == OK:
            sigma, amplitude = measured[1, j], measured[2, j]
            centers[0, n], centers[1, n] = j, measured[0, j]
            centers[2, n], centers[3, n], centers[4, n] = sigma, amplitude, measured[4, j]
            # What the noise makes of the response, over the centre's deviation, is how steeply the response falls.
            slope = np.sqrt(limits.variance * dark + limits.light * max(amplitude, 0.0) * lit) / sigma
            centers[5, n] = lever / slope
            n += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _counts(codes: CodeArray) -> tuple[int, int, int, int, int, int]:
    counts = np.zeros(6, np.int64)
    for code in codes:
        counts[code] += 1
    return counts[0], counts[1], counts[2], counts[3], counts[4], counts[5]
