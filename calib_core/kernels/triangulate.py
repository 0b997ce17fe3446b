"""Pixels to points on the plane of light, in one pass over blocks that stay in the cache."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.kernels.undistort import BLOCK, undistort_block

FloatArray = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def triangulate_pixels(
    pixels: FloatArray,
    rays_from_pixels: FloatArray,
    d: FloatArray,
    plain: bool,
    plane: FloatArray,
    x_axis: FloatArray,
    z_axis: FloatArray,
    offsets: FloatArray,
) -> FloatArray:
    """Return the points (N, 3) of L where the pixels' rays meet the plane of light.

    A ray r = (x, y, 1) meets q · p = 1 at p = r / (q · r), whose coordinates in L are axis · p − offset.

    Parameters
    ----------
    pixels : (N, 2)
    rays_from_pixels, d, plain : see `undistort_block`
    plane : (3,)
        q = normal / distance, 1/mm.
    x_axis, z_axis : (3,)
        The axes of L in the camera frame.
    offsets : (2,)
        x_axis and z_axis times the origin of L, mm.
    """
    scratch = np.empty((4, BLOCK))
    points = np.empty((pixels.shape[0], 3))
    q0, q1, q2 = plane[0], plane[1], plane[2]
    a0, a1, a2 = x_axis[0], x_axis[1], x_axis[2]
    b0, b1, b2 = z_axis[0], z_axis[1], z_axis[2]
    for start in range(0, pixels.shape[0], BLOCK):
        n = min(BLOCK, pixels.shape[0] - start)
        undistort_block(pixels, start, n, rays_from_pixels, d, plain, scratch)
        x, y = scratch[0], scratch[1]
        for i in range(n):
            depth = 1.0 / (q0 * x[i] + q1 * y[i] + q2)
            points[start + i, 0] = depth * (a0 * x[i] + a1 * y[i] + a2) - offsets[0]
            points[start + i, 1] = 0.0
            points[start + i, 2] = depth * (b0 * x[i] + b1 * y[i] + b2) - offsets[1]
    return points
