"""A chessboard's corner to a hundredth of a pixel: two blurred edges that cross, fitted to the grey values.

The model is m + gᵀp + h (1 + cᵀp) · erf(a / √2 w) · erf(b / √2 w), with a and b the distances to the two edges,
which cross in the corner, and w the blur.  Like any blur that is the same on all sides it is symmetric about it,
so that neither blur nor angle between the edges draws the corner anywhere.  Light that falls off, as through any
lens, changes the contrast too: were that held even, a board's corners would all be drawn to where it is brightest.
How it changes, c, is told by the contrasts of all corners: what one window shows is mostly noise, dust and print.
"""

import math

import numpy as np
from numba import njit

from calib_core.frames import FloatArray

Window = tuple[float, float, float]

_TERMS = 9  # u, v, angles of the two edges' normals, w; then h, m, g_u, g_v
_STEPS = 30
_SETTLED_PX = 1e-4
_STRAY_SIGMAS = 4.5
_LEAST_BLUR_PX = 0.3
_MOST_BLUR_PX = 5.0


@njit(cache=True, nogil=True, error_model="numpy")
def first_fits(
    grey: FloatArray, starts: FloatArray, angles: FloatArray, radii_px: FloatArray, fits: FloatArray
) -> None:
    """Fit every corner by itself, as if the light were even.

    Parameters
    ----------
    grey : (H, W)
    starts : (N, 2)
        Column and row, about a pixel off at most.
    angles : (N, 2)
        Of the normals of the two edges, rad.
    radii_px : (N,)
        Pixels within this of a start are looked at.
    fits : (N, 10)
        Written: the parameters, the sixth of them h, and the residual from which a pixel belongs to no edge; the
        first is NaN where the fit does not settle.
    """
    none = np.zeros(2)
    for k in range(len(starts)):
        window = (starts[k, 0], starts[k, 1], radii_px[k])
        p = _start(grey, window, angles[k, 0], angles[k, 1])
        settled, count, cost, _ = _descend(grey, window, math.inf, none, p)
        fits[k, :_TERMS] = p
        fits[k, _TERMS] = _STRAY_SIGMAS * math.sqrt(cost / max(count - _TERMS, 1))
        if not settled:
            fits[k, 0] = math.nan


@njit(cache=True, nogil=True, error_model="numpy")
def fit_corners(
    grey: FloatArray,
    starts: FloatArray,
    radii_px: FloatArray,
    fits: FloatArray,
    falls: FloatArray,
    out: FloatArray,
) -> None:
    """Fit every corner once more, without what no edge explains (hot pixels, dust), in the light as it falls off.

    Parameters
    ----------
    grey, starts, radii_px : see `first_fits`
    fits : (N, 10)
        As it wrote them.
    falls : (N, 2)
        How the contrast changes about each corner, by share of itself a pixel.
    out : (N, 5)
        Written: column, row, the standard deviation of a coordinate, that of the residuals as a share of the
        contrast between black and white, and the blur w, px; the column is NaN where the fit does not settle.
    """
    for k in range(len(starts)):
        out[k] = math.nan
        if math.isnan(fits[k, 0]):
            continue
        p = fits[k, :_TERMS].copy()
        window = (starts[k, 0], starts[k, 1], radii_px[k])
        settled, count, cost, hessian = _descend(grey, window, fits[k, _TERMS], falls[k], p)
        if not settled:
            continue
        variance = cost / max(count - _TERMS, 1)
        spread = np.linalg.inv(hessian)
        out[k, 0], out[k, 1] = p[0], p[1]
        out[k, 2] = math.sqrt(max(0.5 * variance * (spread[0, 0] + spread[1, 1]), 0.0))
        out[k, 3] = math.sqrt(variance) / abs(2.0 * p[5])
        out[k, 4] = p[4]


@njit(cache=True, nogil=True, error_model="numpy")
def _start(grey: FloatArray, window: Window, first: float, second: float) -> FloatArray:
    """Return first parameters: the mean grey, and how the grey values go along with two edges."""
    p = np.zeros(_TERMS)
    p[0], p[1], p[2], p[3], p[4] = window[0], window[1], first, second, 0.8
    total, together, shapes, squares, count = 0.0, 0.0, 0.0, 0.0, 0
    left, right, top, bottom = _box(grey, window)
    for v in range(top, bottom):
        for u in range(left, right):
            du, dv = u - p[0], v - p[1]
            a, b = du * math.cos(first) + dv * math.sin(first), du * math.cos(second) + dv * math.sin(second)
            shape = math.erf(a) * math.erf(b)
            total, together = total + grey[v, u], together + shape * grey[v, u]
            shapes, squares, count = shapes + shape, squares + shape * shape, count + 1
    if count:
        p[6] = total / count
        p[5] = (together - shapes * p[6]) / max(squares - shapes * shapes / count, 1e-9)
    return p


@njit(cache=True, nogil=True, error_model="numpy")
def _descend(
    grey: FloatArray, window: Window, cut: float, fall: FloatArray, p: FloatArray
) -> tuple[bool, int, float, FloatArray]:
    """Move parameters to the least sum of squares; return whether they settle, pixels, the sum, and JᵀJ."""
    hessian, gradient = np.empty((_TERMS, _TERMS)), np.empty(_TERMS)
    next_hessian, next_gradient = np.empty((_TERMS, _TERMS)), np.empty(_TERMS)
    trial = np.empty(_TERMS)
    count, cost = _equations(grey, window, cut, fall, p, hessian, gradient)
    if count < 2 * _TERMS:
        return False, count, cost, hessian
    damping, small = 1e-3, False
    for _ in range(_STEPS):
        damped = hessian.copy()
        for j in range(_TERMS):
            damped[j, j] = damped[j, j] * (1.0 + damping) + 1e-12
        step = np.linalg.solve(damped, gradient)
        for j in range(_TERMS):
            trial[j] = p[j] + step[j]
        trial[4] = min(max(trial[4], _LEAST_BLUR_PX), _MOST_BLUR_PX)
        next_count, next_cost = _equations(grey, window, cut, fall, trial, next_hessian, next_gradient)
        small = abs(step[0]) + abs(step[1]) < _SETTLED_PX
        if next_cost < cost or small:
            for j in range(_TERMS):
                p[j], gradient[j] = trial[j], next_gradient[j]
                for k in range(_TERMS):
                    hessian[j, k] = next_hessian[j, k]
            count, cost, damping = next_count, next_cost, max(0.2 * damping, 1e-9)
            if small:
                break
        else:
            damping *= 8.0
    astray = math.hypot(p[0] - window[0], p[1] - window[1]) > 0.5 * window[2]
    for j in range(_TERMS):
        hessian[j, j] += 1e-12
    return small and not astray and abs(p[5]) > 1e-9, count, cost, hessian


@njit(cache=True, nogil=True, error_model="numpy")
def _box(grey: FloatArray, window: Window) -> tuple[int, int, int, int]:
    u, v, radius = window
    height, width = grey.shape
    return (
        max(math.ceil(u - radius), 0),
        min(math.floor(u + radius) + 1, width),
        max(math.ceil(v - radius), 0),
        min(math.floor(v + radius) + 1, height),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _equations(
    grey: FloatArray,
    window: Window,
    cut: float,
    fall: FloatArray,
    p: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
) -> tuple[int, float]:
    """Write JᵀJ and Jᵀr of the residuals up to `cut`; return how many there are and the sum of their squares."""
    hessian[:], gradient[:] = 0.0, 0.0
    jacobian = np.empty(_TERMS)
    left, right, top, bottom = _box(grey, window)
    ca, sa, cb, sb = math.cos(p[2]), math.sin(p[2]), math.cos(p[3]), math.sin(p[3])
    scale, peak = 1.0 / (math.sqrt(2.0) * p[4]), math.sqrt(2.0 / math.pi) / p[4]
    count, cost = 0, 0.0
    for v in range(top, bottom):
        for u in range(left, right):
            s, t = u - window[0], v - window[1]
            if s * s + t * t > window[2] * window[2]:
                continue
            du, dv = u - p[0], v - p[1]
            a, b = du * ca + dv * sa, du * cb + dv * sb
            ea, eb = math.erf(a * scale), math.erf(b * scale)
            contrast = 1.0 + fall[0] * s + fall[1] * t
            residual = grey[v, u] - (p[6] + p[7] * s + p[8] * t + contrast * p[5] * ea * eb)
            if abs(residual) > cut:
                continue
            slope_a = peak * math.exp(-((a * scale) ** 2)) * eb * p[5] * contrast
            slope_b = peak * math.exp(-((b * scale) ** 2)) * ea * p[5] * contrast
            jacobian[0] = -(slope_a * ca + slope_b * cb)
            jacobian[1] = -(slope_a * sa + slope_b * sb)
            jacobian[2] = slope_a * (dv * ca - du * sa)
            jacobian[3] = slope_b * (dv * cb - du * sb)
            jacobian[4] = -(slope_a * a + slope_b * b) / p[4]
            jacobian[5], jacobian[6], jacobian[7], jacobian[8] = contrast * ea * eb, 1.0, s, t
            cost += residual * residual
            count += 1
            for i in range(_TERMS):
                gradient[i] += jacobian[i] * residual
                for j in range(i + 1):
                    hessian[i, j] += jacobian[i] * jacobian[j]
    for i in range(_TERMS):
        for j in range(i):
            hessian[j, i] = hessian[i, j]
    return count, cost
