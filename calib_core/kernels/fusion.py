"""Hot loops of the merge: points transformed and summed into voxels in one pass, in the caller's hash table.

A table is three arrays of one length (a power of two): `keys` (the voxel's packed indices, `EMPTY` where free),
`sums` float32 (0-2: weighted offset from the voxel's corner in voxels, 3: weight, and where normals are wanted
4-6: weighted normal) and `counts`.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
SingleArray = NDArray[np.float32]
KeyArray = NDArray[np.int64]
CountArray = NDArray[np.int32]

EMPTY = -1
BITS = 21
HALF = 1 << (BITS - 1)
"""Voxel indices run from −HALF to HALF − 1 in each axis."""

_MASK = (1 << BITS) - 1
_BLOCK = 256  # points whose keys are computed together, free of branches, before they go into the table
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True, nogil=True, error_model="numpy")
def _home(key: int, shift: int) -> Any:
    """Return where a key would best be: a multiplicative hash that keeps neighbours along z in pairs."""
    pair = (np.uint64(key >> 1) * _GOLDEN) >> np.uint64(shift)
    return np.int64(pair ^ np.uint64(key & 1))


@njit(cache=True, nogil=True, error_model="numpy")
def _slot(keys: KeyArray, key: int, home: int) -> int:
    """Return where a key is or belongs: linear probing from its home."""
    mask = keys.shape[0] - 1
    slot = home
    while keys[slot] != key and keys[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@njit(cache=True, nogil=True, error_model="numpy")
def add_points(
    points: SingleArray,
    into_from_outof: FloatArray,
    weights: SingleArray,
    normals: SingleArray,
    origin: FloatArray,
    size: float,
    keys: KeyArray,
    sums: SingleArray,
    counts: CountArray,
    used: int,
    first_row: int,
    most_used: int,
) -> tuple[int, int, int, int]:
    """Sum points into voxels, row by row, until the table has no room for one more row.

    Parameters
    ----------
    points : (P, C, 3)
        A scan's rows; NaN where nothing came back.
    into_from_outof : (P, 3, 4) or (1, 3, 4)
        A pose a row, or one for all.
    weights : (P, C) or (1, 1)
        Weight of each point, or one for all; a point of weight 0 is left out.
    normals : (P, C, 3) or (0, 0, 3)
        In the frame of the points; used where `sums` has room for them.
    origin, size : (3,) and float
        Corner of voxel 0 0 0 and the edge, mm.
    keys, sums, counts
        The table, changed in place; `used` of its slots are taken.
    first_row : int
        Where to go on.
    most_used : int
        Stop before a row that could take the table beyond this.

    Returns
    -------
    used, next_row, added, outside : int
        Slots taken, the row to go on with (P when done), points summed, and how many lie beyond the grid.
    """
    shift = 64
    length = keys.shape[0]
    while length > 1:
        length >>= 1
        shift -= 1
    rows, columns = points.shape[0], points.shape[1]
    one_pose, one_weight = into_from_outof.shape[0] == 1, weights.shape[0] == 1 and weights.shape[1] == 1
    with_normals = sums.shape[1] == 7
    px, py, pz = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    bx, by, bz = np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32), np.empty(_BLOCK, np.float32)
    bi, bj, bk = np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32), np.empty(_BLOCK, np.int32)
    within = np.empty(_BLOCK, np.int32)
    bkey, bhome, bfound = np.empty(_BLOCK, np.int64), np.empty(_BLOCK, np.int64), np.empty(_BLOCK, np.int64)
    flat = points.reshape(rows, 3 * columns)
    added, outside = 0, 0
    weight = weights[0, 0]
    for row in range(first_row, rows):
        if used + columns > most_used:
            return used, row, added, outside
        m = into_from_outof[0 if one_pose else row]
        m00, m01, m02, m03 = m[0, 0], m[0, 1], m[0, 2], m[0, 3] - origin[0]
        m10, m11, m12, m13 = m[1, 0], m[1, 1], m[1, 2], m[1, 3] - origin[1]
        m20, m21, m22, m23 = m[2, 0], m[2, 1], m[2, 2], m[2, 3] - origin[2]
        last, slot = np.int64(EMPTY), np.int64(0)
        sx = sy = sz = sw = np.float32(0.0)
        run = np.int32(0)
        for start in range(0, columns, _BLOCK):
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
                key = (np.int64(bi[n]) << (2 * BITS)) | (np.int64(bj[n]) << BITS) | np.int64(bk[n])
                bkey[n] = key if within[n] == 1 else EMPTY
            for n in range(count):  # independent look-ups first: their cache misses overlap
                bhome[n] = _home(bkey[n], shift)
                bfound[n] = keys[bhome[n]]
            for n in range(count):
                key = bkey[n]
                if key == EMPTY:
                    if np.isfinite(px[n]) and np.isfinite(py[n]) and np.isfinite(pz[n]):
                        outside += 1
                    continue
                if not one_weight:
                    weight = weights[row, start + n]
                    if not weight > 0:
                        continue
                if key != last:  # neighbours in a row mostly share their voxel: their sums stay in registers
                    if last != EMPTY:
                        sums[slot, 0] += sx
                        sums[slot, 1] += sy
                        sums[slot, 2] += sz
                        sums[slot, 3] += sw
                        counts[slot] += run
                        added += int(run)
                    slot = bhome[n] if bfound[n] == key else _slot(keys, key, bhome[n])
                    last = key
                    sx = sy = sz = sw = np.float32(0.0)
                    run = np.int32(0)
                    if keys[slot] == EMPTY:
                        keys[slot] = key
                        used += 1
                sx += weight * bx[n]
                sy += weight * by[n]
                sz += weight * bz[n]
                sw += weight
                run += np.int32(1)
                if with_normals:
                    q = normals[row, start + n]
                    sums[slot, 4] += weight * np.float32(m00 * q[0] + m01 * q[1] + m02 * q[2])
                    sums[slot, 5] += weight * np.float32(m10 * q[0] + m11 * q[1] + m12 * q[2])
                    sums[slot, 6] += weight * np.float32(m20 * q[0] + m21 * q[1] + m22 * q[2])
        if last != EMPTY:
            sums[slot, 0] += sx
            sums[slot, 1] += sy
            sums[slot, 2] += sz
            sums[slot, 3] += sw
            counts[slot] += run
            added += int(run)
    return used, rows, added, outside


@njit(cache=True, nogil=True, error_model="numpy")
def add_sums(
    from_keys: KeyArray,
    from_sums: SingleArray,
    from_counts: CountArray,
    keys: KeyArray,
    sums: SingleArray,
    counts: CountArray,
) -> int:
    """Add voxels' sums into a table that has room for them; return how many slots they newly took."""
    shift = 64
    length = keys.shape[0]
    while length > 1:
        length >>= 1
        shift -= 1
    taken = 0
    for n in range(from_keys.shape[0]):
        if from_keys[n] == EMPTY:
            continue
        slot = _slot(keys, from_keys[n], _home(from_keys[n], shift))
        if keys[slot] == EMPTY:
            keys[slot] = from_keys[n]
            taken += 1
        for c in range(sums.shape[1]):
            sums[slot, c] += from_sums[n, c]
        counts[slot] += from_counts[n]
    return taken


def unpack_keys(keys: KeyArray) -> NDArray[np.int64]:
    """Return the voxel indices (N, 3) of packed keys (N,)."""
    return np.stack([(keys >> (2 * BITS)) - HALF, ((keys >> BITS) & _MASK) - HALF, (keys & _MASK) - HALF], axis=1)


def pack_keys(indices: NDArray[np.int64]) -> KeyArray:
    """Return the keys (N,) of voxel indices (N, 3)."""
    i = indices + HALF
    return (i[:, 0] << (2 * BITS)) | (i[:, 1] << BITS) | i[:, 2]
