"""Whether a board's two pitches are as told: a camera's pixels are square, so that fx and fy must be alike."""

from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.optics.adjust import Adjusted
from calib_core.optics.camera_evidence import correlation_inflation
from calib_core.optics.camera_layout import Layout
from calib_core.optics.camera_solution import Fit, PitchRatio

_STEP = 0.004
_SETTLED = 2e-4
_FURTHEST = 1.25  # beyond, the board is another one
_PIXELS_SQUARE_TO = 5e-4
_NOTABLE, _SIGMAS = 0.004, 5.0


def differing_pitches(fit: Fit, layout: Layout) -> PitchRatio | None:
    """Return by how much a board's pitch along its columns differs from what was told; None where nothing says so.

    For a few ratios the camera is adjusted anew; what each costs the corners, and how far its fx and fy are from
    each other, is least at the right one. Boards that stand upright in all views tell by fx / fy alone, turned
    ones by their corners too.
    """
    weight = float(fit.corners.weights.max())
    scale = (fit.sigma_px * weight) ** 2
    found = _best(fit, layout, (1 / _FURTHEST, _FURTHEST), scale * correlation_inflation(fit, layout, scale))
    if found is None or abs(found[0] - 1) < _NOTABLE:
        return None
    # A wrong ratio makes the corners worse: how well they tell it, they say at the right one.
    there = _stretched(fit, layout, found[0])
    scale = (there.sigma_px * weight) ** 2
    about = found[0] - 3 * _STEP, found[0] + 3 * _STEP
    found = _best(fit, layout, about, scale * correlation_inflation(there, layout, scale))
    if found is None or abs(found[0] - 1) < max(_NOTABLE, _SIGMAS * found[1]):
        return None
    told, now = fit.adjusted.state.shared, there.adjusted.state.shared
    return PitchRatio(found[0], found[1], float(told[0] / told[1]), (now - told)[layout.free])


def _best(fit: Fit, layout: Layout, near: tuple[float, float], scale: float) -> tuple[float, float] | None:
    """Return the ratio within two limits that costs least, and its standard deviation."""
    from scipy.optimize import minimize_scalar

    def cost(ratio: float) -> float:
        return _cost(fit, layout, ratio, scale)

    # scipy's types do not say what a bounded search returns.
    found: Any = minimize_scalar(cost, bounds=near, method="bounded", options={"xatol": _SETTLED})
    ratio = float(found.x)
    low, middle, high = (cost(ratio + step) for step in (-_STEP, 0.0, _STEP))
    curvature = (low - 2 * middle + high) / _STEP**2
    return (ratio, curvature**-0.5) if curvature > 0 else None


def _cost(fit: Fit, layout: Layout, ratio: float, scale: float) -> float:
    try:
        ended = _stretched(fit, layout, ratio).adjusted
    except np.linalg.LinAlgError:
        return np.nan
    return ended.cost / scale + _cost_of_focals(ended, scale)


def _stretched(fit: Fit, layout: Layout, ratio: float) -> Fit:
    """Return the fit to a board with another pitch along its columns."""
    corners = replace(fit.corners, points_mm=fit.corners.points_mm * [1.0, ratio, 1.0])
    ended = layout.adjustment(corners).solve(fit.adjusted.state)
    sigma_px = fit.sigma_px * float(np.sqrt(ended.cost / max(fit.adjusted.cost, 1e-300)))
    return replace(fit, corners=corners, adjusted=ended, sigma_px=sigma_px)


def _cost_of_focals(ended: Adjusted, scale: float) -> float:
    """Return half the square of how far fx / fy is from 1, in standard deviations."""
    fx, fy = ended.state.shared[:2]
    slopes = np.array([1 / fy, -fx / fy**2])
    variance = float(slopes @ ended.covariance[:2, :2] @ slopes) * scale
    return 0.5 * float(fx / fy - 1) ** 2 / (variance + _PIXELS_SQUARE_TO**2)
