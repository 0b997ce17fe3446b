"""Hot loops of the sphere fit: sums over a whole cloud in one pass, and the search for a first sphere."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray

IndexArray = NDArray[np.int64]

"""n, Σu (3), Σ uuᵀ upper triangle (6), Σ res·u (3), Σ res, Σ res²: all over the points within the cut."""


OCTAVES = 12
"""Radii from four times the cloud's size down are told apart by factors of two."""

_BLOCK = 1024  # points worked on at a time: their intermediate values stay in the first-level cache


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def sphere_sums(
    points: FloatArray,
    x: float,
    y: float,
    z: float,
    radius: float,
    cut: float,
    inliers: NDArray[np.bool_],
    mark: bool,
) -> FloatArray:
    """Return the sums (15,) of the points (N, 3) nearer than `cut` to a sphere, in one pass.

    u is the unit vector from the centre to the point, res the signed distance to the sphere.  A point with NaN or
    infinity fails the comparison and is left out.  Where `mark` is true, `inliers` (N,) is filled as well.

    Every loop is free of branches, so that it becomes vector instructions: a point outside has u = 0 and res = 0.
    """
    largest2 = (radius + cut) ** 2
    smallest = max(radius - cut, 0.0)
    smallest2 = smallest * smallest
    bx, by, bz, br = np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK), np.empty(_BLOCK)
    n, ux, uy, uz = 0.0, 0.0, 0.0, 0.0
    xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    rx, ry, rz, r1, r2 = 0.0, 0.0, 0.0, 0.0, 0.0
    for start in range(0, points.shape[0], _BLOCK):
        count = min(_BLOCK, points.shape[0] - start)
        block = points[start : start + count]
        for k in range(count):
            dx, dy, dz = block[k, 0] - x, block[k, 1] - y, block[k, 2] - z
            d2 = dx * dx + dy * dy + dz * dz
            inside = (d2 < largest2) & (d2 > smallest2)
            distance = np.sqrt(d2 if inside else 1.0)
            weight = (1.0 if inside else 0.0) / distance
            bx[k] = dx * weight if inside else 0.0
            by[k] = dy * weight if inside else 0.0
            bz[k] = dz * weight if inside else 0.0
            br[k] = distance - radius if inside else 0.0
            n += 1.0 if inside else 0.0
        if mark:
            marks = inliers[start : start + count]
            for k in range(count):
                marks[k] = (bx[k] != 0.0) | (by[k] != 0.0) | (bz[k] != 0.0)
        for k in range(count):
            ux += bx[k]
            uy += by[k]
            uz += bz[k]
            xx += bx[k] * bx[k]
            xy += bx[k] * by[k]
            xz += bx[k] * bz[k]
            yy += by[k] * by[k]
            yz += by[k] * bz[k]
            zz += bz[k] * bz[k]
        for k in range(count):
            rx += br[k] * bx[k]
            ry += br[k] * by[k]
            rz += br[k] * bz[k]
            r1 += br[k]
            r2 += br[k] * br[k]
    return np.array((n, ux, uy, uz, xx, xy, xz, yy, yz, zz, rx, ry, rz, r1, r2))


@njit(cache=True, nogil=True, error_model="numpy")
def _random(state: NDArray[np.uint64]) -> float:
    """Return a number in [0, 1) and step the state (1,), xorshift64*: the same numbers on every machine."""
    s = state[0]
    s ^= s >> np.uint64(12)
    s ^= s << np.uint64(25)
    s ^= s >> np.uint64(27)
    state[0] = s
    return float((s * np.uint64(2685821657736338717)) >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True, nogil=True, error_model="numpy")
def _through_four(p: FloatArray) -> tuple[float, float, float, float]:
    """Return x, y, z, r of the sphere through four points p (4, 3); r = NaN where they lie in a plane."""
    a, b, c = p[1] - p[0], p[2] - p[0], p[3] - p[0]
    bc = np.cross(b, c)
    volume = 2 * np.dot(a, bc)
    offset = (np.dot(a, a) * bc + np.dot(b, b) * np.cross(c, a) + np.dot(c, c) * np.cross(a, b)) / volume
    return offset[0] + p[0, 0], offset[1] + p[0, 1], offset[2] + p[0, 2], np.sqrt(np.dot(offset, offset))


@njit(cache=True, nogil=True, error_model="numpy")
def _through_three(p: FloatArray, radius: float, side: float) -> tuple[float, float, float]:
    """Return x, y, z of a sphere of known radius through three points, on one side of their plane; NaN if none."""
    a, b = p[1] - p[0], p[2] - p[0]
    normal = np.cross(a, b)
    n2 = np.dot(normal, normal)
    offset = (np.dot(a, a) * np.cross(b, normal) + np.dot(b, b) * np.cross(normal, a)) / (2 * n2)
    height = np.sqrt((radius * radius - np.dot(offset, offset)) / n2) * side
    offset = offset + height * normal
    return offset[0] + p[0, 0], offset[1] + p[0, 1], offset[2] + p[0, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def _support(points: FloatArray, x: float, y: float, z: float, radius: float, band: float) -> float:
    """Return the points within the band about a sphere, less what the density beside it would put there."""
    near2, far2 = (radius - band) ** 2, (radius + band) ** 2
    inner = max(radius - 3 * band, 0.0)
    wide_near2, wide_far2 = inner * inner, (radius + 3 * band) ** 2
    inside, wide = 0, 0
    for k in range(points.shape[0]):
        d2 = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2 + (points[k, 2] - z) ** 2
        inside += (d2 > near2) & (d2 < far2)
        wide += (d2 > wide_near2) & (d2 < wide_far2)
    return 1.5 * inside - 0.5 * wide


@njit(cache=True, nogil=True, error_model="numpy")
def first_spheres(
    points: FloatArray,
    known_radius: float,
    reach: float,
    band_share: float,
    band_at_least: float,
    least_draws: int,
    most_draws: int,
) -> FloatArray:
    """Return the best of many spheres through a few neighbouring points, as rows x, y, z, r, support (K, 5).

    One row for each octave of the radius (OCTAVES), so that a wide plane, which a large sphere touches over much
    of its area, does not hide a small sphere; one row in all where the radius is known.

    Parameters
    ----------
    points : (M, 3)
        Finite, in random order of place.
    known_radius : float
        0 where unknown: then four points make a sphere, else three.
    reach : float
        Neighbours are drawn within this distance (known radius) or within reach / 1 … reach / 64 (unknown).
    band_share, band_at_least : float
        Half width of the band in which points count: a share of the radius, and its least value.
    least_draws, most_draws : int
        Draws end between the two, once it is sure that a better sphere would have turned up.
    """
    count = points.shape[0]
    state = np.array([np.uint64(88172645463325252)])
    picked = np.empty((4, 3))
    best = np.zeros((1 if known_radius > 0 else OCTAVES, 5))
    most_support = 0.0
    needed = 3 if known_radius > 0 else 4
    enough = float(most_draws)
    draw = 0
    while draw < enough:
        draw += 1
        within = reach if known_radius > 0 else reach * 2.0 ** (-6.0 * _random(state))
        first = points[int(_random(state) * count)]
        for axis in range(3):
            picked[0, axis] = first[axis]
        got = 1
        for _ in range(200):
            other = points[int(_random(state) * count)]
            d2 = 0.0
            for axis in range(3):
                d2 += (other[axis] - picked[0, axis]) ** 2
            if 0 < d2 < within * within:
                for axis in range(3):
                    picked[got, axis] = other[axis]
                got += 1
                if got == needed:
                    break
        if got < needed:
            continue
        for side in range(2 if known_radius > 0 else 1):
            if known_radius > 0:
                radius = known_radius
                x, y, z = _through_three(picked, radius, 1.0 - 2.0 * side)
            else:
                x, y, z, radius = _through_four(picked)
                widest2 = 0.0
                for i in range(4):
                    for j in range(i):
                        gap = picked[i] - picked[j]
                        widest2 = max(widest2, np.dot(gap, gap))
                # Four points that are near together for their sphere's size are noise on something flat.
                if not widest2 > (0.8 * radius) ** 2:
                    continue
            if not np.isfinite(x + y + z + radius):
                continue
            support = _support(points, x, y, z, radius, max(band_share * radius, band_at_least))
            row = 0
            if known_radius <= 0:
                row = int(min(max(np.floor(np.log2(4 * reach / radius)), 0.0), OCTAVES - 1.0))
            if support > best[row, 4]:
                for k, value in enumerate((x, y, z, radius, support)):
                    best[row, k] = value
            if support > most_support:
                most_support = support
                # A third of the draws from the sphere's own points are taken to be good.
                chance = 0.3 * (support / count) ** needed
                enough = min(float(most_draws), max(float(least_draws), -14.0 / np.log1p(-min(chance, 0.5))))
    return best


@njit(cache=True, nogil=True, error_model="numpy")
def circle_sums(points: FloatArray, offsets: IndexArray, circles: FloatArray, sums: FloatArray) -> None:
    """Write the normal equations (K, 3, 4), last column the gradient, of circles' distances to their points.

    Parameters
    ----------
    points, offsets : (M, 2), (K + 1,)
        Circle k has the points from offsets[k] to offsets[k + 1].
    circles : (K, 3)
        x, z, r.
    sums : (K, 3, 4)
    """
    for k in range(len(circles)):
        xx = xz = zz = x = z = xd = zd = d = 0.0
        for i in range(offsets[k], offsets[k + 1]):
            u, v = points[i, 0] - circles[k, 0], points[i, 1] - circles[k, 1]
            distance = np.sqrt(u * u + v * v)
            scale = 1.0 / max(distance, 1e-300)
            u, v, off = u * scale, v * scale, distance - circles[k, 2]
            xx, xz, zz = xx + u * u, xz + u * v, zz + v * v
            x, z, d = x + u, z + v, d + off
            xd, zd = xd + u * off, zd + v * off
        own = sums[k]
        own[0, 0], own[0, 1], own[0, 2], own[0, 3] = xx, xz, x, xd
        own[1, 0], own[1, 1], own[1, 2], own[1, 3] = xz, zz, z, zd
        own[2, 0], own[2, 1], own[2, 2], own[2, 3] = x, z, offsets[k + 1] - offsets[k], d
