"""Hot loops over the voxels that several scans have seen: distances between scans, and what would close them."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

IndexArray = NDArray[np.int64]

_PARTNERS = 3  # in a voxel, each scan is registered to so many others, around the circle of all


@njit(cache=True, nogil=True, error_model="numpy")
def add_neighbours(keys: IndexArray, values: FloatArray, steps: IndexArray, sums: FloatArray) -> None:
    """Add to each voxel's `sums` (N, K) its neighbours' values, and its own to theirs.

    Parameters
    ----------
    keys : (N,)
        Packed indices, ascending.
    values : (N, K)
    steps : (M,)
        From a key to those of neighbours, positive.
    sums : (N, K)
        Changed.
    """
    for k in range(steps.shape[0]):
        at = 0
        for n in range(keys.shape[0]):
            wanted = keys[n] + steps[k]
            while at < keys.shape[0] and keys[at] < wanted:
                at += 1
            if at < keys.shape[0] and keys[at] == wanted:
                for column in range(values.shape[1]):
                    sums[n, column] += values[at, column]
                    sums[at, column] += values[n, column]


@njit(cache=True, nogil=True, error_model="numpy")
def pair_sums(
    bounds: IndexArray,
    scans: IndexArray,
    points: FloatArray,
    normals: FloatArray,
    variances: FloatArray,
    cut: float,
    common: FloatArray,
    together: FloatArray,
    own: FloatArray,
    totals: FloatArray,
) -> FloatArray:
    """Sum over all pairs of scans in all voxels the squared distance and what is expected of it.

    Parameters
    ----------
    bounds : (G + 1,)
        Where each voxel's rows begin in the arrays below.
    scans, points, normals, variances : (N,), (N, 3), (N, 3), (N,)
        A row a scan and voxel: which scan, the mean point, its unit normal, the variance of its noise in mm².
    cut : float
        A pair farther apart than this along the normal is another surface and counts as such.
    common : (S, 6, D)
        How far D independent errors (of unit variance) that scans share move each scan: rx ry rz tx ty tz about
        the origin of T.
    together : (6S, 6S) or (0, 0)
        Covariance of more of the same, where the errors are many.
    own : (S, 6, 6)
        Covariance of what moves each scan alone.
    totals : (S, 4)
        Filled: per scan the pairs, Σd, Σd² and Σ expected, d = this scan's distance in front of the other.

    Returns
    -------
    (4,)
        Pairs, Σd², Σ expected d², pairs beyond the cut.
    """
    sums = np.zeros(4)
    g = np.empty(6)
    for group in range(bounds.shape[0] - 1):
        for a in range(bounds[group], bounds[group + 1]):
            for b in range(a + 1, bounds[group + 1]):
                nx = normals[a, 0] + normals[b, 0]
                ny = normals[a, 1] + normals[b, 1]
                nz = normals[a, 2] + normals[b, 2]
                length = np.sqrt(nx * nx + ny * ny + nz * nz)
                if not length > 1.7:  # more than 64° apart: an edge, or two sides of a thin wall
                    continue
                nx, ny, nz = nx / length, ny / length, nz / length
                d = nx * (points[a, 0] - points[b, 0])
                d += ny * (points[a, 1] - points[b, 1]) + nz * (points[a, 2] - points[b, 2])
                if abs(d) > cut:
                    sums[3] += 1
                    continue
                x = 0.5 * (points[a, 0] + points[b, 0])
                y = 0.5 * (points[a, 1] + points[b, 1])
                z = 0.5 * (points[a, 2] + points[b, 2])
                g[0], g[1], g[2] = y * nz - z * ny, z * nx - x * nz, x * ny - y * nx
                g[3], g[4], g[5] = nx, ny, nz
                sa, sb = scans[a], scans[b]
                expected = variances[a] + variances[b]
                for k in range(common.shape[2]):
                    move = 0.0
                    for r in range(6):
                        move += g[r] * (common[sa, r, k] - common[sb, r, k])
                    expected += move * move
                if together.shape[0] > 0:
                    ia, ib = 6 * sa, 6 * sb
                    for r in range(6):
                        for c in range(6):
                            apart = together[ia + r, ia + c] + together[ib + r, ib + c]
                            expected += g[r] * (apart - 2 * together[ia + r, ib + c]) * g[c]
                for r in range(6):
                    for c in range(6):
                        expected += g[r] * (own[sa, r, c] + own[sb, r, c]) * g[c]
                sums[0] += 1
                sums[1] += d * d
                sums[2] += expected
                for s, sign in ((sa, 1.0), (sb, -1.0)):
                    totals[s, 0] += 1
                    totals[s, 1] += sign * d
                    totals[s, 2] += d * d
                    totals[s, 3] += expected
    return sums


@njit(cache=True, nogil=True, error_model="numpy")
def registration_sums(
    bounds: IndexArray,
    scans: IndexArray,
    points: FloatArray,
    normals: FloatArray,
    variances: FloatArray,
    cut: float,
    centre: FloatArray,
    matrix: FloatArray,
    vector: FloatArray,
) -> float:
    """Add the normal equations of the point-to-plane distances between scans to matrix (6S, 6S) and vector (6S,).

    A scan's move is rx ry rz (rad, about `centre`) and tx ty tz (mm).  In each voxel every scan is paired with the
    next `_PARTNERS` scans in it.  Returns Σ d²/σ², pairs of many scans counting less.
    """
    g = np.empty(6)
    cost = 0.0
    for group in range(bounds.shape[0] - 1):
        first, count = bounds[group], bounds[group + 1] - bounds[group]
        if count < 2:
            continue
        # Pairs share their scans' noise: together they may not count for more than the scans' scatter does.
        share = 2.0 * (count - 1) / (count * min(2 * _PARTNERS, count - 1))
        for i in range(count):
            for step in range(1, min(_PARTNERS, count - 1) + 1):
                if 2 * step > count or (2 * step == count and i >= step):
                    continue  # the pair is met from its other end
                a, b = first + i, first + (i + step) % count
                n = normals[a] + normals[b]
                length = np.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
                if not length > 1.7:
                    continue
                n = n / length
                difference = points[a] - points[b]
                d = n[0] * difference[0] + n[1] * difference[1] + n[2] * difference[2]
                if abs(d) > cut:
                    continue
                x = 0.5 * (points[a] + points[b]) - centre
                g[0], g[1], g[2] = x[1] * n[2] - x[2] * n[1], x[2] * n[0] - x[0] * n[2], x[0] * n[1] - x[1] * n[0]
                g[3], g[4], g[5] = n[0], n[1], n[2]
                weight = share / (variances[a] + variances[b])
                cost += weight * d * d
                ia, ib = 6 * scans[a], 6 * scans[b]
                for r in range(6):
                    vector[ia + r] -= weight * g[r] * d
                    vector[ib + r] += weight * g[r] * d
                    for c in range(6):
                        value = weight * g[r] * g[c]
                        matrix[ia + r, ia + c] += value
                        matrix[ib + r, ib + c] += value
                        matrix[ia + r, ib + c] -= value
                        matrix[ib + r, ia + c] -= value
    return cost
