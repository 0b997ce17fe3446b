"""The stripe's exact middle in many columns at once.

The responses R(c) = Σ w h(row − c) of the centring filter are taken at whole rows c, for all columns of a row at
a time, and with them their derivatives.  Where R falls through zero between two rows, the cubic that has both
rows' values and derivatives (Hermite's) has its zero at the centre; the match with the peak's shape, from which
the amplitude and the residuals come, is interpolated likewise by a quintic.  The window of each column is first
laid so that all peaks stand at the same row, so that steep stripes cost no more than level ones.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

ImageArray = NDArray[Any]  # uint8 or uint16
FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
OffsetArray = NDArray[np.uint32]

_BESIDE = np.float32(0.15)  # px: the short filter's zero may lie on the other side of a whole row
SEARCHED_ROWS = 7  # whole rows at which the filter's response is looked at: the seed and three on either side


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _lay_straight(image: ImageArray, offsets: OffsetArray, tile: SingleArray) -> None:
    """Write to `tile` (K, N) the K pixels below (and at) each column's offset in the flattened image."""
    flat = image.reshape(-1)
    for k in range(tile.shape[0]):
        down = np.uint32(k * image.shape[1])
        row = tile[k]
        for j in range(offsets.shape[0]):
            row[j] = flat[offsets[j] + down]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _respond(tile: SingleArray, filters: SingleArray, responses: SingleArray) -> None:
    """Write the filters' responses (F, R, N) with the first tap at rows 0 … R − 1; taps are a multiple of four."""
    for r in range(responses.shape[1]):
        for k in range(0, filters.shape[1], 4):
            a, b, c, d = tile[r + k], tile[r + k + 1], tile[r + k + 2], tile[r + k + 3]
            for f in range(responses.shape[0]):
                out = responses[f, r]
                s, t, u, v = filters[f, k], filters[f, k + 1], filters[f, k + 2], filters[f, k + 3]
                if k == 0:
                    for j in range(out.shape[0]):
                        out[j] = (a[j] * s + b[j] * t) + (c[j] * u + d[j] * v)
                else:
                    for j in range(out.shape[0]):
                        out[j] += (a[j] * s + b[j] * t) + (c[j] * u + d[j] * v)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _sums(tile: SingleArray, taps: int, totals: SingleArray, squares: SingleArray) -> None:
    """Write Σ w and Σ w² over `taps` rows from row 0 and from row 1, each (2, N)."""
    total, square = totals[0], squares[0]
    total[:] = 0
    square[:] = 0
    for k in range(taps):
        row = tile[k]
        for j in range(total.shape[0]):
            total[j] += row[j]
            square[j] += row[j] * row[j]
    next_total, next_square = totals[1], squares[1]
    come, gone = tile[taps], tile[0]
    for j in range(total.shape[0]):
        change = come[j] - gone[j]
        next_total[j] = total[j] + change
        next_square[j] = square[j] + change * (come[j] + gone[j])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _fall(response: SingleArray, row: OffsetArray, drop: SingleArray) -> None:
    """Write the row (N,) after which the response (R, N) falls most steeply through zero, and by how much."""
    drop[:] = 0
    row[:] = 0
    for r in range(response.shape[0] - 1):
        upper, lower = response[r], response[r + 1]
        for j in range(drop.shape[0]):
            fall = upper[j] - lower[j]
            better = (upper[j] > 0) & (lower[j] <= 0) & (fall > drop[j])
            drop[j] = fall if better else drop[j]
            row[j] = np.uint32(r) if better else row[j]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _judge(
    responses: SingleArray,
    totals: SingleArray,
    squares: SingleArray,
    peaks: SingleArray,
    taps: int,
    per_square_width: float,
    figures: FloatArray,
    limits: FloatArray,
    out: SingleArray,
    usual: NDArray[np.bool_],
) -> None:
    """Write what `measure_peaks` returns, the centres relative to the upper row of the two."""
    r0s, r1s, d0s, d1s = responses[0, 0], responses[0, 1], responses[1, 0], responses[1, 1]
    g0s, g1s = responses[2, 0], responses[2, 1]
    # For even noise the centring filter is the match's derivative but for a factor.
    own = responses.shape[0] == 5
    p0s, p1s = (responses[3, 0], responses[3, 1]) if own else (r0s, r1s)
    q0s, q1s = (responses[4, 0], responses[4, 1]) if own else (d0s, d1s)
    factor = np.float32(1) if own else np.float32(per_square_width)
    half_factor = np.float32(0.5) * factor
    total0s, total1s, square0s, square1s = totals[0], totals[1], squares[0], squares[1]
    peak0s, peak1s = peaks[0], peaks[1]
    centers, sigmas, amplitudes, residuals, backgrounds = out[0], out[1], out[2], out[3], out[4]
    zero, half, one, two, three = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)
    many, per_tap = np.float32(taps), np.float32(1) / np.float32(taps)
    variance, light = np.float32(limits[0]), np.float32(limits[1])
    saturation, least = np.float32(limits[2]), np.float32(limits[3])
    # The figures hardly change with the centre's phase: their even parabola is exact enough.
    still = figures[figures.shape[0] // 2].astype(np.float32)
    bend = np.float32(4) * (figures[0].astype(np.float32) - still)
    form_0, energy_0, dark_0, lit_0, steep_0 = still[0], still[1], still[2], still[3], still[4]
    form_2, energy_2, dark_2, lit_2 = bend[0], bend[1], bend[2], bend[3]
    for j in range(usual.shape[0]):
        r0, r1, d0, d1 = r0s[j], r1s[j], d0s[j], d1s[j]
        c2 = three * (r1 - r0) - two * d0 - d1
        c3 = two * (r0 - r1) + d0 + d1
        x = r0 / (r0 - r1)
        x -= (r0 + x * (d0 + x * (c2 + x * c3))) / (d0 + x * (two * c2 + three * x * c3))
        x -= (r0 + x * (d0 + x * (c2 + x * c3))) / (d0 + x * (two * c2 + three * x * c3))
        inside = (x >= -_BESIDE) & (x <= one + _BESIDE)
        slope = d0 + x * (two * c2 + three * x * c3)
        g0, p0, q0, q1 = g0s[j], factor * p0s[j], half_factor * q0s[j], half_factor * q1s[j]
        e, f, s = g1s[j] - g0 - p0 - q0, factor * p1s[j] - p0 - two * q0, q1 - q0
        k3 = np.float32(10) * e - np.float32(4) * f + s
        k4 = np.float32(-15) * e + np.float32(7) * f - two * s
        k5 = np.float32(6) * e - three * f + s
        match = g0 + x * (p0 + x * (q0 + x * (k3 + x * (k4 + x * k5))))
        lower = x > half
        total = total1s[j] if lower else total0s[j]
        square = square1s[j] if lower else square0s[j]
        peak = peak1s[j] if lower else peak0s[j]
        y = x - one if lower else x
        y *= y
        form = form_0 + y * form_2
        energy = energy_0 + y * energy_2
        mean = total * per_tap
        amplitude = (match - form * mean) / energy
        lit = amplitude if amplitude > zero else zero
        residual = square - total * mean - amplitude * amplitude * energy
        residual = residual if residual > zero else zero
        centers[j] = x
        sigmas[j] = np.sqrt(variance * (dark_0 + y * dark_2) + light * lit * (lit_0 + y * lit_2)) / -slope
        amplitudes[j] = amplitude
        residuals[j] = residual
        backgrounds[j] = mean - amplitude * form * per_tap
        regular = residual < two * (many * variance + light * lit * form)
        sharp = slope <= -half * lit * steep_0
        usual[j] = inside & regular & sharp & (amplitude >= least) & (peak < saturation)


@njit(cache=True, nogil=True, error_model="numpy")
def measure_peaks(
    image: ImageArray,
    columns: NDArray[np.int32],
    seeds: NDArray[np.int32],
    sought: NDArray[np.bool_],
    short: SingleArray,
    filters: SingleArray,
    taps: int,
    width_px: float,
    figures: FloatArray,
    limits: FloatArray,
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Measure each column's peak near its seed, where nothing is unusual about it.

    Parameters
    ----------
    image : (H, W)
        Of fewer than 2³² pixels.
    columns, seeds : (N,)
        Which columns, and the row in each that the peak is within three rows of.
    sought : (N,)
        The others are left alone.
    short : (1, a multiple of four)
        The inner part of the centring filter, which finds the two rows that the centre lies between.  Its middle
        is tap `(size − 1) // 2`.
    filters : (3 or 5, taps and zeros up to a multiple of four)
        At u = −half … half: the centring filter h, its response's derivative −dh/du, the shape g, and, where they
        are not h/width² and −dh/du/width², the first and second derivatives of the match with g by the centre.
    taps : int
        2 half + 1.
    width_px : float
        Of the peak.
    figures : (phases + 1, 5)
        See `kernels.stripe.measure_columns`.
    limits : (4,)
        Variance of the surroundings, growth of the variance with the light, grey value of a saturated pixel, least
        amplitude.

    Returns
    -------
    out : (5, N)
        Centre, its standard deviation, amplitude, sum of squared residuals of the shape, background; the centre is
        NaN where none was found.
    clean : (N,)
        Whether the peak is as it should be; anything else is for a second look.
    """
    height, width = image.shape
    count = columns.shape[0]
    half, middle = taps // 2, (short.shape[1] - 1) // 2
    reach = half + SEARCHED_ROWS // 2
    depth = max(filters.shape[1], short.shape[1] + half - middle) + SEARCHED_ROWS
    out = np.full((5, count), np.nan)
    clean = np.zeros(count, np.bool_)
    if height <= depth:
        return out, clean
    offsets, tops = np.empty(count, np.uint32), np.empty(count, np.int32)
    down = np.uint32((half - middle) * width)
    for j in range(count):
        top = seeds[j] - reach
        clean[j] = sought[j] & (top >= 0) & (top + depth < height)
        tops[j] = top if clean[j] else 0
        offsets[j] = np.uint32(tops[j]) * np.uint32(width) + np.uint32(columns[j]) + down
    tile = np.empty((max(short.shape[1] + SEARCHED_ROWS - 1, filters.shape[1] + 1), count), np.float32)
    _lay_straight(image, offsets, tile[: short.shape[1] + SEARCHED_ROWS - 1])
    response = np.empty((1, SEARCHED_ROWS, count), np.float32)
    _respond(tile, short, response)
    rows, drop = np.empty(count, np.uint32), np.empty(count, np.float32)
    _fall(response[0], rows, drop)
    for j in range(count):
        offsets[j] += rows[j] * np.uint32(width) - down
    tile = tile[: filters.shape[1] + 1]
    _lay_straight(image, offsets, tile)
    responses = np.empty((filters.shape[0], 2, count), np.float32)
    _respond(tile, filters, responses)
    totals, squares = np.empty((2, count), np.float32), np.empty((2, count), np.float32)
    _sums(tile, taps, totals, squares)
    single, usual = np.empty((5, count), np.float32), np.empty(count, np.bool_)
    peaks = tile[half : half + 2]
    _judge(responses, totals, squares, peaks, taps, width_px**-2, figures, limits, single, usual)
    for k in range(1, 5):
        out[k] = single[k]
    for j in range(count):
        found = clean[j] & (drop[j] > 0) & (abs(single[0, j] - 0.5) <= 0.5 + _BESIDE)
        out[0, j] = tops[j] + half + np.int64(rows[j]) + single[0, j] if found else np.nan
        clean[j] = found & usual[j]
    return out, clean
