"""Centres of a saturated stripe by its flanks: the middle between where the light rises and where it falls."""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

_LEAST_RUN_PX, _MOST_RUN_PX = 3, 80
_LEVELS = (0.35, 0.5, 0.65)  # of the way from the surroundings to saturation
_LEAST_RISE = 0.15  # of the range of grey values
_LEAST_SIGMA_PX = 0.03
_SIGMAS_IN_HALF_WIDTH = 1.18


def flank_centers(
    image: NDArray[np.uint8 | np.uint16], saturation: float, noise: float
) -> tuple[NDArray[np.int64], FloatArray, FloatArray, float]:
    """Return columns (N,), rows (N,) and their standard deviations (N,), px, and the stripe's width, px.

    Parameters
    ----------
    image : (H, W)
        Turned so that the stripe runs from left to right.
    saturation, noise : float
        Grey value of a saturated pixel; standard deviation of the dark surroundings.
    """
    first, last = _longest_runs(image >= saturation)
    length = last - first + 1
    reach = int(np.clip(length[length > 0].max(initial=0), 8, _MOST_RUN_PX))
    fits = (length >= _LEAST_RUN_PX) & (length <= _MOST_RUN_PX) & (first >= reach) & (last + reach < len(image))
    columns = np.flatnonzero(fits)
    if not columns.size:
        return columns, np.zeros(0), np.zeros(0), 0.0
    steps = np.arange(reach + 1)
    above = image[first[columns, None] - steps, columns[:, None]].astype(float)
    below = image[last[columns, None] + steps, columns[:, None]].astype(float)
    ground = np.maximum(np.median(above[:, -4:], axis=1), np.median(below[:, -4:], axis=1))
    middles, widths, slopes = [], [], []
    for share in _LEVELS:
        level = ground + share * (saturation - ground)
        (up, up_slope), (down, down_slope) = _crossing(above, level), _crossing(below, level)
        middles.append((first[columns] - up + last[columns] + down) / 2)
        widths.append(length[columns] - 1 + up + down)
        slopes.append(np.minimum(up_slope, down_slope))
    rows, sigma = np.mean(middles, axis=0), noise / np.sqrt(2) / np.maximum(slopes[1], 1e-9)
    sigma = np.hypot(sigma, np.std(middles, axis=0) + _LEAST_SIGMA_PX)
    fine = np.isfinite(rows) & np.isfinite(sigma) & (saturation - ground > _LEAST_RISE * saturation)
    width = float(np.median(widths[1][fine])) / 2 / _SIGMAS_IN_HALF_WIDTH if fine.any() else 0.0
    return columns[fine], rows[fine], sigma[fine], width


def _longest_runs(saturated: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first and last row (W,) of each column's longest run; last is before first where there is none."""
    run = best = end = np.zeros(saturated.shape[1], np.int64)
    for row, here in enumerate(saturated):
        run = np.where(here, run + 1, 0)
        end = np.where(run > best, row, end)
        best = np.maximum(best, run)
    return end - best + 1, end


def _crossing(outwards: FloatArray, level: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far out (N,), px, grey values (N, K) first fall below a level (N,), else NaN; and how steeply."""
    below = outwards < level[:, None]
    place = below.argmax(axis=1)
    there = np.arange(len(outwards))
    before, after = outwards[there, np.maximum(place - 1, 0)], outwards[there, place]
    fall = np.maximum(before - after, 1e-9)
    at = place - 1 + (before - level) / fall
    return np.where(below.any(axis=1) & (place > 0), at, np.nan), fall
