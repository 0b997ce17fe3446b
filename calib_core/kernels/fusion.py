"""Hot loops of the merge: points transformed and summed into voxels in one pass, in the caller's table of bricks.

A brick is 4×4×4 voxels next to each other in memory, so that neighbouring points need no look-up of their own.
A table is `heads` (packed indices of a brick, `EMPTY` where free) and `numbers` (which brick that is), a hash
table of a power of two, and for each brick's voxels `sums` (bricks, 64, 4) float32: weighted offset from the
voxel's corner in voxels, and weight; `counts` (bricks, 64) int32; and where normals are wanted `normal_sums`
(bricks, 64, 3), with an intensity (bricks, 64, 4).
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

SingleArray = NDArray[np.float32]
KeyArray = NDArray[np.int64]
CountArray = NDArray[np.int32]

EMPTY = -1
BITS = 21
HALF = 1 << (BITS - 1)
"""Voxel indices run from −HALF to HALF − 1 in each axis."""
BRICK_BITS = 2
BRICK_VOXELS = 1 << (3 * BRICK_BITS)

REGION_BITS = 4
"""Blocks of 16³ voxels belong to one region."""

_MASK = (1 << BITS) - 1
_BLOCK = 256  # points whose keys are computed together, free of branches, before they go into the table
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, error_model="numpy")
def _shift(heads: KeyArray) -> Any:
    shift = 64
    length = heads.shape[0]
    while length > 1:
        length >>= 1
        shift -= 1
    return np.uint64(shift)


@njit(cache=True, nogil=True, error_model="numpy")
def _slot(heads: KeyArray, key: int, shift: Any) -> Any:
    """Return where a brick is or belongs: a multiplicative hash and linear probing."""
    mask = heads.shape[0] - 1
    slot = np.int64((np.uint64(key) * _GOLDEN) >> shift)
    while heads[slot] != key and heads[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _brick_of(i: int, j: int, k: int) -> Any:
    return (
        (np.int64(i >> BRICK_BITS) << (2 * BITS)) | (np.int64(j >> BRICK_BITS) << BITS) | np.int64(k >> BRICK_BITS)
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _place_in_brick(i: int, j: int, k: int) -> Any:
    return ((i & 3) << (2 * BRICK_BITS)) | ((j & 3) << BRICK_BITS) | (k & 3)


@njit(cache=True, nogil=True, error_model="numpy")
def add_points(
    points: SingleArray,
    into_from_outof: FloatArray,
    weights: SingleArray,
    normals: SingleArray,
    origin: FloatArray,
    size: float,
    heads: KeyArray,
    numbers: CountArray,
    sums: SingleArray,
    counts: CountArray,
    normal_sums: SingleArray,
    used: int,
    first: int,
) -> tuple[int, int, int, int]:
    """Sum points into voxels until all are done or the table has no room for another brick.

    Parameters
    ----------
    points : (P, C, 3)
        A scan's rows; NaN where nothing came back.
    into_from_outof : (P, 3, 4) or (1, 3, 4)
        A pose a row, or one for all.
    weights : (P, C) or (1, 1)
        Weight of each point, or one for all; a point of weight 0 is left out.
    normals : (P, C, 3 or 4) or (0, 0, 3)
        In the frame of the points, an intensity behind each; used where `normal_sums` has room for them.
    origin, size : (3,) and float
        Corner of voxel 0 0 0 and the edge, mm.
    heads, numbers, sums, counts, normal_sums
        The table, changed in place; `used` of its bricks are taken.
    first : int
        Number of the point to go on with.

    Returns
    -------
    used, following, added, outside : int
        Bricks taken, the point to go on with (P·C when done), points summed, and how many lie beyond the grid.
    """
    shift = _shift(heads)
    rows, columns = points.shape[0], points.shape[1]
    one_pose, one_weight = into_from_outof.shape[0] == 1, weights.shape[0] == 1 and weights.shape[1] == 1
    with_normals = normal_sums.shape[0] > 0
    px, py, pz = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    bx, by, bz = np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32)
    bi, bj, bk = np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    within, place = np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    bricks = np.empty(_BLOCK, np.int64)
    flat = points.reshape(rows, 3 * columns)
    flat_sums, flat_counts = sums.reshape(-1), counts.reshape(-1)
    added, outside = 0, 0
    weight = weights[0, 0]
    for row in range(first // columns, rows):
        m = into_from_outof[0 if one_pose else row]
        m00, m01, m02, m03 = m[0, 0], m[0, 1], m[0, 2], m[0, 3] - origin[0]
        m10, m11, m12, m13 = m[1, 0], m[1, 1], m[1, 2], m[1, 3] - origin[1]
        m20, m21, m22, m23 = m[2, 0], m[2, 1], m[2, 2], m[2, 3] - origin[2]
        last, base = np.int64(EMPTY), np.int64(0)
        for start in range(max(0, first - row * columns), columns, _BLOCK):
            count = min(_BLOCK, columns - start)
            block = flat[row, 3 * start : 3 * (start + count)]
            for n in range(count):
                px[n], py[n], pz[n] = block[3 * n], block[3 * n + 1], block[3 * n + 2]
            for n in range(count):
                x = (m00 * px[n] + m01 * py[n] + m02 * pz[n] + m03) / size
                y = (m10 * px[n] + m11 * py[n] + m12 * pz[n] + m13) / size
                z = (m20 * px[n] + m21 * py[n] + m22 * pz[n] + m23) / size
                inside = (abs(x) < HALF - 1) & (abs(y) < HALF - 1) & (abs(z) < HALF - 1)  # false for NaN
                x, y, z = (x if inside else 0.0), (y if inside else 0.0), (z if inside else 0.0)
                fx, fy, fz = np.floor(x), np.floor(y), np.floor(z)
                bx[n] = x - fx
                by[n] = y - fy
                bz[n] = z - fz
                bi[n] = np.int32(fx) + np.int32(HALF)
                bj[n] = np.int32(fy) + np.int32(HALF)
                bk[n] = np.int32(fz) + np.int32(HALF)
                within[n] = np.int32(1) if inside else np.int32(0)
            for n in range(count):
                brick = _brick_of(bi[n], bj[n], bk[n])
                bricks[n] = brick if within[n] == 1 else EMPTY
                place[n] = _place_in_brick(bi[n], bj[n], bk[n])
            for n in range(count):
                if bricks[n] == EMPTY:
                    if np.isfinite(px[n]) and np.isfinite(py[n]) and np.isfinite(pz[n]):
                        outside += 1
                    continue
                if not one_weight:
                    weight = weights[row, start + n]
                    if not weight > 0:
                        continue
                if bricks[n] != last:
                    slot = _slot(heads, bricks[n], shift)
                    if heads[slot] == EMPTY:
                        if used == sums.shape[0]:
                            return used, row * columns + start + n, added, outside
                        heads[slot] = bricks[n]
                        numbers[slot] = used
                        used += 1
                    last = bricks[n]
                    base = np.int64(numbers[slot]) * BRICK_VOXELS
                voxel = base + place[n]
                s = 4 * voxel
                flat_sums[s] += weight * bx[n]
                flat_sums[s + 1] += weight * by[n]
                flat_sums[s + 2] += weight * bz[n]
                flat_sums[s + 3] += weight
                flat_counts[voxel] += 1
                added += 1
                if with_normals:
                    q = normals[row, start + n]
                    total = normal_sums[voxel // BRICK_VOXELS, voxel % BRICK_VOXELS]
                    total[0] += weight * np.float32(m00 * q[0] + m01 * q[1] + m02 * q[2])
                    total[1] += weight * np.float32(m10 * q[0] + m11 * q[1] + m12 * q[2])
                    total[2] += weight * np.float32(m20 * q[0] + m21 * q[1] + m22 * q[2])
                    for c in range(3, total.shape[0]):
                        total[c] += weight * q[c]
    return used, rows * columns, added, outside


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _region(x: float, y: float, z: float, size: float, regions: int) -> Any:
    """Return the number of the region that a point falls into; 0 beyond the grid.

    The voxel is found as `add_points` finds it, so that each belongs to one region.
    """
    x, y, z = x / size, y / size, z / size
    if not ((abs(x) < HALF - 1) & (abs(y) < HALF - 1) & (abs(z) < HALF - 1)):
        return 0
    i, j, k = np.int64(np.floor(x)) + HALF, np.int64(np.floor(y)) + HALF, np.int64(np.floor(z)) + HALF
    i, j, k = i >> REGION_BITS, j >> REGION_BITS, k >> REGION_BITS
    mixed = np.uint64((i << (2 * BITS)) | (j << BITS) | k) * _GOLDEN
    return np.int64((mixed >> np.uint64(40)) % np.uint64(regions))


@njit(cache=True, nogil=True, error_model="numpy")
def by_region(
    points: SingleArray,
    sigmas: SingleArray,
    normals: SingleArray,
    kept: NDArray[np.bool_],
    size: float,
    regions: int,
) -> tuple[SingleArray, SingleArray, SingleArray, KeyArray]:
    """Return the points (N, 3) that are kept, their weights 1/σ² and normals, those of one region side by side.

    In each they stand as they came; `bounds` (regions + 1,) is where each begins.  `points` are (P, 3), `sigmas`
    (P,), `normals` (P, 3) or with intensities (P, 4), `kept` (P,).
    """
    count = points.shape[0]
    numbers = np.empty(count, np.uint8)
    bounds = np.zeros(regions + 1, np.int64)
    for n in range(count):
        if kept[n]:
            x, y, z = np.float64(points[n, 0]), np.float64(points[n, 1]), np.float64(points[n, 2])
            numbers[n] = _region(x, y, z, size, regions)
            bounds[numbers[n] + 1] += 1
    for region in range(regions):
        bounds[region + 1] += bounds[region]
    following, many = bounds[:-1].copy(), bounds[regions]
    found = np.empty((many, 3), np.float32)
    weights = np.empty(many, np.float32)
    columns = normals.shape[1]
    facing = np.empty((many, columns), np.float32)
    for n in range(count):
        if kept[n]:
            place = following[numbers[n]]
            following[numbers[n]] += 1
            for c in range(3):
                found[place, c] = points[n, c]
            for c in range(columns):
                facing[place, c] = normals[n, c]
            weights[place] = np.float32(1) / (sigmas[n] * sigmas[n])
    return found, weights, facing, bounds


@njit(cache=True, nogil=True, error_model="numpy")
def enter_bricks(bricks: KeyArray, heads: KeyArray, numbers: CountArray) -> None:
    """Enter the bricks (N,), numbered as they come, into an empty hash table."""
    shift = _shift(heads)
    for n in range(bricks.shape[0]):
        slot = _slot(heads, bricks[n], shift)
        heads[slot] = bricks[n]
        numbers[slot] = n


@njit(cache=True, nogil=True, error_model="numpy")
def voxel_keys(bricks: KeyArray, counts: CountArray, keys: KeyArray, voxels: KeyArray) -> int:
    """Write the occupied voxels' packed indices, and their numbers in the flattened table; return how many.

    Parameters
    ----------
    bricks : (N,)
        Packed indices of the bricks 0 … N − 1.
    counts : (N, 64)
    keys, voxels : (at least the occupied,)
    """
    found = 0
    for b in range(bricks.shape[0]):
        i, j, k = bricks[b] >> (2 * BITS), (bricks[b] >> BITS) & _MASK, bricks[b] & _MASK
        for v in range(BRICK_VOXELS):
            if counts[b, v] > 0:
                x, y, z = (
                    (i << BRICK_BITS) | (v >> 4),
                    (j << BRICK_BITS) | ((v >> 2) & 3),
                    (k << BRICK_BITS) | (v & 3),
                )
                keys[found] = (x << (2 * BITS)) | (y << BITS) | z
                voxels[found] = b * BRICK_VOXELS + v
                found += 1
    return found


def unpack_keys(keys: KeyArray) -> NDArray[np.int64]:
    """Return the voxel indices (N, 3) of packed keys (N,)."""
    return np.stack([(keys >> (2 * BITS)) - HALF, ((keys >> BITS) & _MASK) - HALF, (keys & _MASK) - HALF], axis=1)


def pack_keys(indices: NDArray[np.int64]) -> KeyArray:
    """Return the keys (N,) of voxel indices (N, 3)."""
    i = indices + HALF
    return (i[:, 0] << (2 * BITS)) | (i[:, 1] << BITS) | i[:, 2]
