"""From pixels to rays: the lens distortion undone by Newton's iteration, in blocks that stay in the cache.

The model is OpenCV's: with r² = x² + y² of the ideal ray (x, y, 1),

    R = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶)
    x'' = x·R + 2 p1 x y + p2 (r² + 2x²) + s1 r² + s2 r⁴
    y'' = y·R + p1 (r² + 2y²) + 2 p2 x y + s3 r² + s4 r⁴

followed by the homography of a tilted sensor and the camera matrix, which are undone together by one 3×3 matrix.
The 14 coefficients are k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tauX tauY.
"""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray

BLOCK = 256
_LARGEST_STEP_SQUARED = (
    1e-8  # Newton squares the error: after a step of 1e-4 at most 1e-8 is left (0.01 µm at 1 m)
)
_MOST_STEPS = 30
_UNSOLVED = 1e-7  # above what the last step may leave: a ray that is found must not be taken for one that is not


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def sensor_to_distorted(u: float, v: float, h: FloatArray) -> tuple[float, float]:
    """Map a pixel to the distorted ray through the inverse (3, 3) of camera matrix times tilt."""
    scale = 1.0 / (h[2, 0] * u + h[2, 1] * v + h[2, 2])
    return (h[0, 0] * u + h[0, 1] * v + h[0, 2]) * scale, (h[1, 0] * u + h[1, 1] * v + h[1, 2]) * scale


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def distortion_and_slopes(x: float, y: float, d: FloatArray) -> tuple[float, float, float, float, float, float]:
    """Return x'', y'' and ∂x''/∂x, ∂x''/∂y, ∂y''/∂x, ∂y''/∂y of a ray; the tilt is not in it."""
    s = x * x + y * y
    over = 1.0 + s * (d[0] + s * (d[1] + s * d[4]))
    under = 1.0 / (1.0 + s * (d[5] + s * (d[6] + s * d[7])))
    radial = over * under
    over_slope = d[0] + s * (2.0 * d[1] + s * 3.0 * d[4])
    under_slope = d[5] + s * (2.0 * d[6] + s * 3.0 * d[7])
    slope = 2.0 * (over_slope - radial * under_slope) * under
    p1, p2 = d[2], d[3]
    prism_x, prism_y = d[8] + 2.0 * d[9] * s, d[10] + 2.0 * d[11] * s
    xd = x * radial + 2.0 * p1 * x * y + p2 * (s + 2.0 * x * x) + s * (d[8] + d[9] * s)
    yd = y * radial + p1 * (s + 2.0 * y * y) + 2.0 * p2 * x * y + s * (d[10] + d[11] * s)
    cross = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    return (
        xd,
        yd,
        radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x + 2.0 * x * prism_x,
        cross + 2.0 * y * prism_x,
        cross + 2.0 * x * prism_y,
        radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x + 2.0 * y * prism_y,
    )


@njit(cache=True, nogil=True, error_model="numpy")
def _void_unsolved(xd: FloatArray, yd: FloatArray, x: FloatArray, y: FloatArray, n: int, d: FloatArray) -> None:
    """Set NaN where no ray fits: pixels beyond the fold of a polynomial that turns back."""
    for i in range(n):
        a, b, j_xx, j_xy, j_yx, j_yy = distortion_and_slopes(x[i], y[i], d)
        upright = j_xx > 0 and j_xx * j_yy - j_xy * j_yx > 0
        if not (upright and abs(a - xd[i]) < _UNSOLVED and abs(b - yd[i]) < _UNSOLVED):
            x[i] = np.nan
            y[i] = np.nan


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _plain_steps(xd: FloatArray, yd: FloatArray, x: FloatArray, y: FloatArray, n: int, d: FloatArray) -> None:
    """Solve x''(x, y) = xd, y''(x, y) = yd for the five plain coefficients; NaN where there is no solution."""
    k1, k2, p1, p2, k3 = d[0], d[1], d[2], d[3], d[4]
    second, third = 3.0 * k1 * k1 - k2, 12.0 * k1 * k1 * k1 - 8.0 * k1 * k2 + k3
    far, moving = 0, 0
    for i in range(n):  # starting from the inverse series saves Newton steps
        a, b = xd[i], yd[i]
        s = a * a + b * b
        strength = s * (abs(k1) + s * (abs(k2) + s * abs(k3)))
        near = 1.0 if strength < 0.1 else 0.0
        far += 1 if strength >= 0.1 else 0
        smaller = near * (1.0 - 2.0 * k1 * s)  # the tangential part at the ideal ray
        c = a - smaller * (2.0 * p1 * a * b + p2 * (s + 2.0 * a * a))
        e = b - smaller * (2.0 * p2 * a * b + p1 * (s + 2.0 * b * b))
        s = c * c + e * e
        start = 1.0 - near * s * (k1 - s * (second - s * third))
        x[i] = c * start
        y[i] = e * start
    for _ in range(_MOST_STEPS):
        moving = 0
        for i in range(n):  # no branch in here, so that the compiler works on several points at a time
            a, b = x[i], y[i]
            aa, bb, ab = a * a, b * b, a * b
            s = aa + bb
            radial = 1.0 + s * (k1 + s * (k2 + s * k3))
            slope = 2.0 * (k1 + s * (2.0 * k2 + s * 3.0 * k3))
            error_x = a * radial + 2.0 * p1 * ab + p2 * (s + 2.0 * aa) - xd[i]
            error_y = b * radial + p1 * (s + 2.0 * bb) + 2.0 * p2 * ab - yd[i]
            j_xx = radial + slope * aa + 2.0 * p1 * b + 6.0 * p2 * a
            j_yy = radial + slope * bb + 6.0 * p1 * b + 2.0 * p2 * a
            j_xy = slope * ab + 2.0 * p1 * a + 2.0 * p2 * b
            inverse = 1.0 / (j_xx * j_yy - j_xy * j_xy)
            step_x = (j_yy * error_x - j_xy * error_y) * inverse
            step_y = (j_xx * error_y - j_xy * error_x) * inverse
            x[i] = a - step_x
            y[i] = b - step_y
            moving += 1 if step_x * step_x + step_y * step_y > _LARGEST_STEP_SQUARED else 0
        if moving == 0:
            break
    if moving > 0 or far > 0:  # only a strong lens has rays that fold back
        _void_unsolved(xd, yd, x, y, n, d)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _full_steps(xd: FloatArray, yd: FloatArray, x: FloatArray, y: FloatArray, n: int, d: FloatArray) -> None:
    """Do the same for all twelve coefficients."""
    x[:n] = xd[:n]
    y[:n] = yd[:n]
    for _ in range(_MOST_STEPS):
        moving = 0
        for i in range(n):
            a, b, j_xx, j_xy, j_yx, j_yy = distortion_and_slopes(x[i], y[i], d)
            error_x, error_y = a - xd[i], b - yd[i]
            determinant = j_xx * j_yy - j_xy * j_yx
            inverse = 1.0 / determinant
            step_x = (j_yy * error_x - j_xy * error_y) * inverse
            step_y = (j_xx * error_y - j_yx * error_x) * inverse
            x[i] -= step_x
            y[i] -= step_y
            wrong = (step_x * step_x + step_y * step_y > _LARGEST_STEP_SQUARED) | (determinant <= 0) | (j_xx <= 0)
            moving += 1 if wrong else 0
        if moving == 0:
            return
    _void_unsolved(xd, yd, x, y, n, d)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _to_distorted(pixels: FloatArray, h: FloatArray, xd: FloatArray, yd: FloatArray) -> None:
    """Map pixels (n, 2) to distorted rays; a sensor that is not tilted needs no division."""
    if h[2, 0] == 0.0 and h[2, 1] == 0.0:
        h00, h01, h02 = h[0, 0] / h[2, 2], h[0, 1] / h[2, 2], h[0, 2] / h[2, 2]
        h10, h11, h12 = h[1, 0] / h[2, 2], h[1, 1] / h[2, 2], h[1, 2] / h[2, 2]
        for i in range(pixels.shape[0]):
            u, v = pixels[i, 0], pixels[i, 1]
            xd[i] = h00 * u + h01 * v + h02
            yd[i] = h10 * u + h11 * v + h12
        return
    for i in range(pixels.shape[0]):
        a, b = sensor_to_distorted(pixels[i, 0], pixels[i, 1], h)
        xd[i] = a
        yd[i] = b


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"}, inline="always")
def undistort_block(
    pixels: FloatArray,
    start: int,
    n: int,
    rays_from_pixels: FloatArray,
    d: FloatArray,
    plain: bool,
    scratch: FloatArray,
) -> None:
    """Undistort `pixels[start:start + n]`; the rays come out in `scratch[0, :n]` (x) and `scratch[1, :n]` (y).

    Parameters
    ----------
    pixels : (N, 2)
    n : at most BLOCK
    rays_from_pixels : (3, 3)
        Inverse of the camera matrix times the tilt homography.
    d : (14,)
    plain : whether only k1 k2 p1 p2 k3 differ from zero
    scratch : (4, BLOCK)
    """
    x, y, xd, yd = scratch[0], scratch[1], scratch[2], scratch[3]
    _to_distorted(pixels[start : start + n], rays_from_pixels, xd, yd)
    if plain:
        _plain_steps(xd, yd, x, y, n, d)
    else:
        _full_steps(xd, yd, x, y, n, d)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def undistort_pixels(pixels: FloatArray, rays_from_pixels: FloatArray, d: FloatArray, plain: bool) -> FloatArray:
    """Return the ideal rays (N, 2) of pixels (N, 2); the arguments are those of `undistort_block`."""
    scratch = np.empty((4, BLOCK))
    rays = np.empty(pixels.shape)
    for start in range(0, pixels.shape[0], BLOCK):
        n = min(BLOCK, pixels.shape[0] - start)
        undistort_block(pixels, start, n, rays_from_pixels, d, plain, scratch)
        for i in range(n):
            rays[start + i, 0] = scratch[0, i]
            rays[start + i, 1] = scratch[1, i]
    return rays
