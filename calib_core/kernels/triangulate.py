"""Pixels to points on the plane of light, in one pass over blocks that stay in the cache."""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray
from calib_core.kernels.undistort import BLOCK, undistort_block


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def triangulate_pixels(plain: bool, constants: FloatArray, pixels: FloatArray) -> FloatArray:
    """Return the points (N, 3) of L where the pixels' rays meet the plane of light.

    A ray r = (x, y, 1) meets q · p = 1 at p = r / (q · r), whose coordinates in L are axis · p − offset.

    Parameters
    ----------
    plain : see `undistort_block`
    constants : (34,)
        In one array, as a call's cost grows with their number: `rays_from_pixels` (9) and `d` (14) of
        `undistort_block`; q = normal / distance (3), 1/mm; the x and z axes of L in the camera frame (3 each), and
        their products with the origin of L (2), mm.
    pixels : (N, 2)
    """
    rays_from_pixels, d = constants[:9].reshape(3, 3), constants[9:23]
    q0, q1, q2 = constants[23], constants[24], constants[25]
    a0, a1, a2 = constants[26], constants[27], constants[28]
    b0, b1, b2 = constants[29], constants[30], constants[31]
    x_offset, z_offset = constants[32], constants[33]
    scratch = np.empty((4, BLOCK))
    points = np.empty((pixels.shape[0], 3))
    for start in range(0, pixels.shape[0], BLOCK):
        n = min(BLOCK, pixels.shape[0] - start)
        undistort_block(pixels, start, n, rays_from_pixels, d, plain, scratch)
        x, y = scratch[0], scratch[1]
        part = points[start : start + n]
        for i in range(n):
            depth = 1.0 / (q0 * x[i] + q1 * y[i] + q2)
            part[i, 0] = depth * (a0 * x[i] + a1 * y[i] + a2) - x_offset
            part[i, 1] = 0.0
            part[i, 2] = depth * (b0 * x[i] + b1 * y[i] + b2) - z_offset
    return points
