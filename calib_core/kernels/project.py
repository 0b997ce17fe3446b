"""From points in the camera frame to pixels, by OpenCV's 14 coefficients and a full camera matrix."""

import math

import numpy as np
from numba import njit

from calib_core.frames import FloatArray
from calib_core.kernels.undistort import distortion_and_slopes, sensor_to_distorted

_MOST_STEPS = 50


@njit(cache=True, nogil=True)
def tilt_homography(tau_x: float, tau_y: float) -> FloatArray:
    """Return the homography (3, 3) that a sensor tilted by two angles (rad) puts on the distorted rays."""
    cx, sx, cy, sy = math.cos(tau_x), math.sin(tau_x), math.cos(tau_y), math.sin(tau_y)
    rotation = np.array([[cy, sy * sx, -sy * cx], [0.0, cx, sx], [sy, -cy * sx, cy * cx]])
    c = rotation[2, 2]
    result = np.empty((3, 3))
    for j in range(3):
        result[0, j] = c * rotation[0, j] - rotation[0, 2] * rotation[2, j]
        result[1, j] = c * rotation[1, j] - rotation[1, 2] * rotation[2, j]
        result[2, j] = rotation[2, j]
    return result


@njit(cache=True, nogil=True, inline="always")
def band_position(depth_mm: float, starts: FloatArray, ends: FloatArray) -> tuple[int, float, float]:
    """Return the lower band b at a depth, the weight of band b + 1 there, and that weight's slope over depth."""
    for b in range(starts.size - 1):
        if depth_mm < ends[b] or b == starts.size - 2:
            width = ends[b] - starts[b + 1]
            weight = (depth_mm - starts[b + 1]) / width
            if weight <= 0.0:
                return b, 0.0, 0.0
            if weight >= 1.0:
                return b, 1.0, 0.0
            return b, weight, 1.0 / width
    return 0, 0.0, 0.0


@njit(cache=True, nogil=True, inline="always")
def blend_bands(depth_mm: float, bands: FloatArray, starts: FloatArray, ends: FloatArray, out: FloatArray) -> None:
    """Write the 14 coefficients at a depth into `out`: linear between two bands where they overlap."""
    b, weight, _ = band_position(depth_mm, starts, ends)
    if weight == 0.0:
        for j in range(14):
            out[j] = bands[b, j]
        return
    for j in range(14):
        out[j] = (1.0 - weight) * bands[b, j] + weight * bands[b + 1, j]


@njit(cache=True, nogil=True, error_model="numpy")
def project_points(
    points_mm: FloatArray, pixels_from_rays: FloatArray, bands: FloatArray, starts: FloatArray, ends: FloatArray
) -> FloatArray:
    """Return the pixels (N, 2) of points (N, 3) in the camera frame; NaN for points not in front of the camera.

    Parameters
    ----------
    pixels_from_rays : (3, 3)
        Camera matrix times tilt homography.
    bands, starts, ends : (B, 14), (B,), (B,)
        Distortion per depth band and the bands' ends, mm; one band where distortion does not depend on depth.
    """
    pixels = np.empty((points_mm.shape[0], 2))
    d = bands[0].copy()
    for i in range(points_mm.shape[0]):
        depth = points_mm[i, 2]
        if not depth > 0.0:
            pixels[i, 0] = np.nan
            pixels[i, 1] = np.nan
            continue
        if starts.size > 1:
            blend_bands(depth, bands, starts, ends, d)
        a, b, _, _, _, _ = distortion_and_slopes(points_mm[i, 0] / depth, points_mm[i, 1] / depth, d)
        u, v = sensor_to_distorted(a, b, pixels_from_rays)
        pixels[i, 0] = u
        pixels[i, 1] = v
    return pixels


@njit(cache=True, nogil=True, error_model="numpy")
def undistort_over_depth(
    pixels: FloatArray,
    rays_from_pixels: FloatArray,
    bands: FloatArray,
    starts: FloatArray,
    ends: FloatArray,
    inverse_depth: FloatArray,
) -> FloatArray:
    """Return the ideal rays (N, 2) of pixels whose depth follows from a plane, with distortion per depth band.

    Parameters
    ----------
    inverse_depth : (N, 3)
        q with 1 / depth = q · (x, y, 1): normal / distance of the plane of light, or (0, 0, 1 / depth).
    """
    rays = np.empty(pixels.shape)
    d = bands[0].copy()
    for i in range(pixels.shape[0]):
        xd, yd = sensor_to_distorted(pixels[i, 0], pixels[i, 1], rays_from_pixels)
        x, y = xd, yd
        for _ in range(_MOST_STEPS):
            depth = 1.0 / (inverse_depth[i, 0] * x + inverse_depth[i, 1] * y + inverse_depth[i, 2])
            blend_bands(depth, bands, starts, ends, d)
            a, b, j_xx, j_xy, j_yx, j_yy = distortion_and_slopes(x, y, d)
            inverse = 1.0 / (j_xx * j_yy - j_xy * j_yx)
            step_x = (j_yy * (a - xd) - j_xy * (b - yd)) * inverse
            step_y = (j_xx * (b - yd) - j_yx * (a - xd)) * inverse
            x -= step_x
            y -= step_y
            if step_x * step_x + step_y * step_y < 1e-26:  # linear here, since the depth moves with the ray
                break
        rays[i, 0] = x
        rays[i, 1] = y
    return rays
