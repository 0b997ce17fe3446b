"""The stripe's exact middle in many columns at once.

The responses R(c) = Σ w h(row − c) of the centring filter are taken at whole rows c, for all columns of a row at
a time, and with them their derivatives.  Where R falls through zero between two rows, the cubic that has both
rows' values and derivatives (Hermite's) has its zero at the centre; the match with the peak's shape, from which
the amplitude and the residuals come, is interpolated likewise by a quintic.  The window of each column is first
laid so that all peaks stand at the same row, so that steep stripes cost no more than level ones.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.stripe import Limits
from calib_core.kernels.stripe_filters import StripeFilters

ImageArray = NDArray[Any]  # uint8 or uint16
SingleArray = NDArray[np.float32]
RowArray = NDArray[np.uint32]

_BESIDE = np.float32(0.15)  # px: the short filter's zero may lie on the other side of a whole row
SEARCHED_ROWS = 7  # whole rows at which the filter's response is looked at: the seed and three on either side
_NARROWEST_PX = 0.9  # narrower peaks' responses change too fast from row to row to be interpolated
_LANES = 16  # columns are filled up to a multiple of these


class Bench(NamedTuple):
    """Room for the work on N columns at a time.

    Parameters
    ----------
    tile : (depth, N)
        The columns' windows.
    offsets, rows : (N,)
        Where each window starts in the flattened image, and after which of the searched rows the response falls
        through zero.
    drop : (N,)
        By how much it falls.
    short : (SEARCHED_ROWS + 1, N)
    responses : (3 or 5, 2, N)
    totals, squares : (2, N)
    measured : (5, N)
    usual : (N,)
    """

    tile: SingleArray
    offsets: RowArray
    rows: RowArray
    drop: SingleArray
    short: SingleArray
    responses: SingleArray
    totals: SingleArray
    squares: SingleArray
    measured: SingleArray
    usual: NDArray[np.bool_]


@njit(cache=True, nogil=True, error_model="numpy")
def _bench(depth: int, count: int, filters: int) -> Bench:
    return Bench(
        np.empty((depth, count), np.float32),
        np.zeros(count, np.uint32),
        np.empty(count, np.uint32),
        np.empty(count, np.float32),
        np.empty((SEARCHED_ROWS + 1, count), np.float32),
        np.empty((filters, 2, count), np.float32),
        np.empty((2, count), np.float32),
        np.empty((2, count), np.float32),
        np.empty((5, count), np.float32),
        np.empty(count, np.bool_),
    )


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _lay_straight(image: ImageArray, offsets: RowArray, tile: SingleArray) -> None:
    """Write to `tile` (K, N) the K pixels below (and at) each column's offset in the flattened image."""
    flat = image.reshape(-1)
    for k in range(tile.shape[0]):
        down = np.uint32(k * image.shape[1])
        row = tile[k]
        for j in range(offsets.shape[0]):
            row[j] = flat[offsets[j] + down]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _respond(tile: SingleArray, taps: SingleArray, first: int, upper: SingleArray, lower: SingleArray) -> None:
    """Write a filter's responses (N,) with its first tap at row `first` and one row below; taps: 4, 8, 12 …"""
    for k in range(0, taps.shape[0], 4):
        r = first + k
        a, b, c, d, e = tile[r], tile[r + 1], tile[r + 2], tile[r + 3], tile[r + 4]
        s, t, u, v = taps[k], taps[k + 1], taps[k + 2], taps[k + 3]
        if k == 0:
            for j in range(upper.shape[0]):
                upper[j] = (a[j] * s + b[j] * t) + (c[j] * u + d[j] * v)
                lower[j] = (b[j] * s + c[j] * t) + (d[j] * u + e[j] * v)
        else:
            for j in range(upper.shape[0]):
                upper[j] += (a[j] * s + b[j] * t) + (c[j] * u + d[j] * v)
                lower[j] += (b[j] * s + c[j] * t) + (d[j] * u + e[j] * v)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _sums(tile: SingleArray, taps: int, totals: SingleArray, squares: SingleArray) -> None:
    """Write Σ w and Σ w² over `taps` rows, an odd number, from row 0 and from row 1, each (2, N)."""
    total, square = totals[0], squares[0]
    come, gone = tile[taps], tile[0]
    for j in range(total.shape[0]):
        total[j] = gone[j]
        square[j] = gone[j] * gone[j]
    for k in range(1, taps, 2):
        one, other = tile[k], tile[k + 1]
        for j in range(total.shape[0]):
            total[j] += one[j] + other[j]
            square[j] += one[j] * one[j] + other[j] * other[j]
    next_total, next_square = totals[1], squares[1]
    for j in range(total.shape[0]):
        change = come[j] - gone[j]
        next_total[j] = total[j] + change
        next_square[j] = square[j] + change * (come[j] + gone[j])


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _fall(response: SingleArray, row: RowArray, drop: SingleArray) -> None:
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
def _judge(bench: Bench, filters: StripeFilters, limits: Limits) -> None:
    """Write what `measure_peaks` returns, the centres relative to the upper row of the two."""
    responses, totals, squares = bench.responses, bench.totals, bench.squares
    out, usual, figures, taps = bench.measured, bench.usual, filters.figures, filters.taps
    r0s, r1s, d0s, d1s = responses[0, 0], responses[0, 1], responses[1, 0], responses[1, 1]
    g0s, g1s = responses[2, 0], responses[2, 1]
    # For even noise the centring filter is the match's derivative but for a factor.
    own = responses.shape[0] == 5
    p0s, p1s = (responses[3, 0], responses[3, 1]) if own else (r0s, r1s)
    q0s, q1s = (responses[4, 0], responses[4, 1]) if own else (d0s, d1s)
    factor = np.float32(1) if own else np.float32(filters.width_px**-2)
    half_factor = np.float32(0.5) * factor
    total0s, total1s, square0s, square1s = totals[0], totals[1], squares[0], squares[1]
    peaks = bench.tile[taps // 2 : taps // 2 + 2]
    peak0s, peak1s = peaks[0], peaks[1]
    centers, sigmas, amplitudes, residuals, backgrounds = out[0], out[1], out[2], out[3], out[4]
    zero, half, one, two, three = np.float32(0), np.float32(0.5), np.float32(1), np.float32(2), np.float32(3)
    many, per_tap = np.float32(taps), np.float32(1) / np.float32(taps)
    variance, light = np.float32(limits.variance), np.float32(limits.light)
    saturation, least = np.float32(limits.saturation), np.float32(limits.least_amplitude)
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
    filters: StripeFilters,
    limits: Limits,
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
    filters, limits : see `StripeFilters`, `Limits`

    Returns
    -------
    out : (5, N)
        Centre, its standard deviation, amplitude, sum of squared residuals of the shape, background; the centre is
        NaN where none was found.
    clean : (N,)
        Whether the peak is as it should be; anything else is for a second look.
    """
    count, beyond_short = columns.shape[0], filters.taps // 2 - (filters.short.shape[1] - 1) // 2
    depth = max(filters.whole.shape[1], filters.short.shape[1] + beyond_short) + SEARCHED_ROWS
    if image.shape[0] <= depth or count == 0 or filters.width_px < _NARROWEST_PX:
        return np.full((5, count), np.nan), np.zeros(count, np.bool_)
    bench = _bench(depth, count + -count % _LANES, filters.whole.shape[0])
    out, clean = np.empty((5, count)), np.empty(count, np.bool_)
    width = np.uint32(image.shape[1])
    tile, offsets, rows = bench.tile, bench.offsets, bench.rows
    half, inner = filters.taps // 2, (filters.short.shape[1] - 1) // 2
    reach, lowest = half + SEARCHED_ROWS // 2, image.shape[0] - tile.shape[0]
    down = np.uint32(half - inner) * width
    for j in range(count):
        top = seeds[j] - reach
        clean[j] = sought[j] & (top >= 0) & (top < lowest)
        offsets[j] = (np.uint32(top) if clean[j] else np.uint32(0)) * width + np.uint32(columns[j]) + down
    _lay_straight(image, offsets, tile[: filters.short.shape[1] + SEARCHED_ROWS])
    for r in range(0, SEARCHED_ROWS, 2):
        _respond(tile, filters.short[0], r, bench.short[r], bench.short[r + 1])
    _fall(bench.short[:SEARCHED_ROWS], rows, bench.drop)
    for j in range(count):
        offsets[j] += rows[j] * width - down
    _lay_straight(image, offsets, tile[: filters.whole.shape[1] + 1])
    for f in range(filters.whole.shape[0]):
        _respond(tile, filters.whole[f], 0, bench.responses[f, 0], bench.responses[f, 1])
    _sums(tile, filters.taps, bench.totals, bench.squares)
    _judge(bench, filters, limits)
    places = bench.measured[0]
    for j in range(count):
        found = clean[j] & (bench.drop[j] > 0) & (abs(places[j] - np.float32(0.5)) <= np.float32(0.5) + _BESIDE)
        center = np.float64(seeds[j] - SEARCHED_ROWS // 2 + np.int32(rows[j])) + places[j]
        out[0, j] = center if found else np.nan
        clean[j] = found & bench.usual[j]
    for k in range(1, 5):
        out[k] = bench.measured[k, :count]
    return out, clean
