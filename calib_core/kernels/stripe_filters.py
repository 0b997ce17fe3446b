"""The filters of a stripe's Gaussian peak, and what noise makes of them."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

SingleArray = NDArray[np.float32]

PHASES = 32
_EVEN_NOISE_REACH = 2.7  # widths
_LIGHT_NOISE_REACH = 3.2  # the filter that is nearly a centroid has longer arms
_LARGEST_RATIO = 16.0
_SMALLEST_RATIO = 0.4


class StripeFilters(NamedTuple):
    """Filters of one peak width and noise ratio.

    Parameters
    ----------
    width_px : float
        Standard deviation of the peak's shape g(u) = exp(−u²/2 width²).
    taps : int
        2 half + 1: how many rows the centring filter reaches over.
    short : (1, a multiple of four)
        The inner part of the centring filter, which finds the two rows that the centre lies between.  Its middle
        is tap `(size − 1) // 2`.
    whole : (3 or 5, taps and zeros up to a multiple of four)
        At u = −half … half: the centring filter h, its response's derivative −dh/du, the shape g, and, where they
        are not h/width² and −dh/du/width², the first and second derivatives of the match with g by the centre.
    tables : (3, phases + 1, taps)
        For centres at −½ … ½ of a pixel, u = row − centre: h(u), −dh/du and g(u).
    figures : (phases + 1, 5)
        Per phase: Σg, Σ(g − mean)², Σh², Σh²g, Σ−g·(−dh/du).
    energy, mean_shape : float
        Means of Σ(g − mean)² and of g over the phases.
    """

    width_px: float
    taps: int
    short: SingleArray
    whole: SingleArray
    tables: SingleArray
    figures: FloatArray
    energy: float
    mean_shape: float


@njit(cache=True, nogil=True, error_model="numpy")
def noise_ratio_of(ratio: float) -> float:
    """Return a ratio of the light's variance to the dark's, rounded to a power of two, as the filters take it.

    Small ratios gain nothing; large ones make a centroid, which a sloping background pulls.
    """
    if not (ratio >= _SMALLEST_RATIO and ratio < np.inf):
        return 0.0
    return min(_LARGEST_RATIO, 2.0 ** np.round(np.log2(ratio)))


@njit(cache=True, nogil=True, error_model="numpy")
def filters_of(width_px: float, noise_ratio: float) -> StripeFilters:
    """Return the filters of a Gaussian peak: its standard deviation (px), and its light's noise beside the dark's.

    The centring filter is h = g′/(1 + ρ g), the maximum-likelihood position for variance a (1 + ρ g).
    """
    reach = _EVEN_NOISE_REACH if noise_ratio == 0.0 else _LIGHT_NOISE_REACH
    half = int(np.ceil(reach * width_px)) + 1
    taps = 2 * half + 1
    tables = np.empty((3, PHASES + 1, taps), np.float32)
    figures = np.empty((PHASES + 1, 5))
    whole = np.zeros((5 if noise_ratio else 3, taps + -taps % 4), np.float32)
    inner = min(half - 1, int(1.5 * width_px)) | 1  # odd: padded by one zero, its middle is easy to tell
    short = np.zeros((1, 2 * inner + 2), np.float32)
    per_square = width_px**-2
    exponents = -0.5 * per_square * np.arange(-half, half + 1.0) ** 2
    on_whole_rows = np.exp(exponents)
    u, g, h, slope = np.empty(taps), np.empty(taps), np.empty(taps), np.empty(taps)
    for p in range(PHASES + 1):
        phase = p / PHASES - 0.5
        _write_shape(on_whole_rows, phase, per_square, u, g)
        _write_filter(u, g, per_square, noise_ratio, h, slope)
        _write_figures(g, h, slope, figures[p])
        for k in range(taps):
            tables[0, p, k], tables[1, p, k], tables[2, p, k] = h[k], slope[k], g[k]
        if p == PHASES // 2:  # the centre on a whole row
            for k in range(taps):
                whole[0, k], whole[1, k], whole[2, k] = h[k], slope[k], g[k]
            for k in range(2 * inner + 1):
                short[0, k] = h[half - inner + k]
            if noise_ratio:
                for k in range(taps):
                    turn = u[k] * per_square
                    whole[3, k], whole[4, k] = turn * g[k], (turn * turn - per_square) * g[k]
    return StripeFilters(
        width_px, taps, short, whole, tables, figures, figures[:, 1].mean(), figures[:, 0].mean() / taps
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _write_shape(on_whole_rows: FloatArray, phase: float, per_square: float, u: FloatArray, g: FloatArray) -> None:
    """Write u = row − phase and exp(−u²/2 width²) = exp(−row²/2w²) · exp(−phase²/2w²) · exp(phase/w²)^row."""
    half = u.shape[0] // 2
    common = np.exp(-0.5 * per_square * phase * phase)
    turn = np.exp(per_square * phase)
    power, inverse_power, inverse = 1.0, 1.0, 1.0 / turn
    u[half], g[half] = -phase, common
    for k in range(1, half + 1):
        power *= turn
        inverse_power *= inverse
        u[half + k], u[half - k] = k - phase, -k - phase
        g[half + k] = on_whole_rows[half + k] * common * power
        g[half - k] = on_whole_rows[half - k] * common * inverse_power


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _write_filter(
    u: FloatArray, g: FloatArray, per_square: float, noise_ratio: float, h: FloatArray, slope: FloatArray
) -> None:
    """Write h = u g/(1 + ρ g) and −dh/du."""
    if noise_ratio == 0.0:
        for k in range(u.shape[0]):
            h[k] = u[k] * g[k]
            slope[k] = -g[k] * (1.0 - u[k] * u[k] * per_square)
    else:
        for k in range(u.shape[0]):
            weight = 1.0 / (1.0 + noise_ratio * g[k])
            h[k] = u[k] * g[k] * weight
            slope[k] = -g[k] * weight * (1.0 - u[k] * u[k] * per_square * weight)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _write_figures(g: FloatArray, h: FloatArray, slope: FloatArray, figures: FloatArray) -> None:
    """Write Σg, Σ(g − mean)², Σh², Σh²g and Σ−g·slope of one phase."""
    form = shape_square = dark = lit = steep = 0.0
    for k in range(g.shape[0]):
        form += g[k]
        shape_square += g[k] * g[k]
        dark += h[k] * h[k]
        lit += h[k] * h[k] * g[k]
        steep -= slope[k] * g[k]
    figures[0], figures[1] = form, shape_square - form * form / g.shape[0]
    figures[2], figures[3], figures[4] = dark, lit, steep
