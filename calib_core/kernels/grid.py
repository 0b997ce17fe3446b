"""Hot loops on a scan's own grid: a plane through each point's neighbours in 5×5, branch-free in blocks.

Points come as three planes (3, P, C), float32, NaN where nothing came back; P and C include a border of two NaN
rows and columns on every side, so that no neighbour lies outside.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

SingleArray = NDArray[np.float32]
ByteArray = NDArray[np.uint8]

REACH = 2
KEPT, BLANK, STRAY, MIXED, GRAZING = 0, 1, 2, 3, 4

_BLOCK = 128
_SUMS = 16  # n, Su, Sv, Suu, Suv, Svv, Σd (3), Σu·d (3), Σv·d (3), Σd²
_FEWER = 8
_FEW = 12  # of the 24 neighbours: less than half, as beside an edge
_FAST = {"contract", "nsz", "reassoc"}


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _sum_block(planes: SingleArray, row: int, start: int, count: int, reach2: SingleArray, s: SingleArray) -> None:
    """Sum over the neighbours within √`reach2` (5, 5) of `count` points of a row, into s (_SUMS, _BLOCK)."""
    s[:, :count] = 0
    centre = slice(start, start + count)
    cx, cy, cz = planes[0, row, centre], planes[1, row, centre], planes[2, row, centre]
    wide = slice(start - REACH, start + count + REACH)
    for du in range(-REACH, REACH + 1):
        nx, ny, nz = planes[0, row + du, wide], planes[1, row + du, wide], planes[2, row + du, wide]
        limits = reach2[du + REACH]
        u = np.float32(du)
        for k in range(count):
            n = v1 = v2 = sx = sy = sz = vx = vy = vz = d2sum = np.float32(0.0)
            for j in range(5):
                v = np.float32(j - REACH)
                dx, dy, dz = nx[k + j] - cx[k], ny[k + j] - cy[k], nz[k + j] - cz[k]
                d2 = dx * dx + dy * dy + dz * dz
                near = d2 < limits[j]  # the point itself counts too, with zeros; false for NaN
                one = np.float32(1.0) if near else np.float32(0.0)
                dx = dx if near else np.float32(0.0)
                dy = dy if near else np.float32(0.0)
                dz = dz if near else np.float32(0.0)
                n += one
                v1 += v * one
                v2 += v * v * one
                sx += dx
                sy += dy
                sz += dz
                vx += v * dx
                vy += v * dy
                vz += v * dz
                d2sum += d2 if near else np.float32(0.0)
            s[0, k] += n
            s[1, k] += u * n
            s[2, k] += v1
            s[3, k] += u * u * n
            s[4, k] += u * v1
            s[5, k] += v2
            s[6, k] += sx
            s[7, k] += sy
            s[8, k] += sz
            s[9, k] += u * sx
            s[10, k] += u * sy
            s[11, k] += u * sz
            s[12, k] += vx
            s[13, k] += vy
            s[14, k] += vz
            s[15, k] += d2sum
    for k in range(count):
        s[0, k] -= np.float32(1.0)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _solve_block(s: SingleArray, count: int, ray: SingleArray, out: SingleArray) -> None:
    """Solve each point's plane from its sums into out (6, _BLOCK): normal (3), offset, RSS, cosine to the ray.

    The neighbours' differences are fitted by a + u·b + v·c in each coordinate; the normal is b × c turned toward
    the scanner, the offset how far the point itself lies from the plane of its neighbours.
    """
    for k in range(count):
        n, su, sv, suu, suv, svv = s[0, k], s[1, k], s[2, k], s[3, k], s[4, k], s[5, k]
        # the adjugate of the symmetric 3×3 normal matrix
        i00, i01, i02 = suu * svv - suv * suv, suv * sv - su * svv, su * suv - suu * sv
        i11, i12, i22 = n * svv - sv * sv, su * sv - n * suv, n * suu - su * su
        det = n * i00 + su * i01 + sv * i02
        inverse = np.float32(1.0) / (det if det > np.float32(0.5) else np.float32(1.0))
        ax = (i00 * s[6, k] + i01 * s[9, k] + i02 * s[12, k]) * inverse
        ay = (i00 * s[7, k] + i01 * s[10, k] + i02 * s[13, k]) * inverse
        az = (i00 * s[8, k] + i01 * s[11, k] + i02 * s[14, k]) * inverse
        bx = (i01 * s[6, k] + i11 * s[9, k] + i12 * s[12, k]) * inverse
        by = (i01 * s[7, k] + i11 * s[10, k] + i12 * s[13, k]) * inverse
        bz = (i01 * s[8, k] + i11 * s[11, k] + i12 * s[14, k]) * inverse
        cx = (i02 * s[6, k] + i12 * s[9, k] + i22 * s[12, k]) * inverse
        cy = (i02 * s[7, k] + i12 * s[10, k] + i22 * s[13, k]) * inverse
        cz = (i02 * s[8, k] + i12 * s[11, k] + i22 * s[14, k]) * inverse
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        length2 = x * x + y * y + z * z
        solved = (det > np.float32(0.5)) & (length2 > np.float32(1e-24))
        scale = np.float32(1.0) / np.sqrt(length2 if solved else np.float32(1.0))
        cosine = (x * ray[0] + y * ray[1] + z * ray[2]) * scale
        scale = -scale if cosine > 0 else scale
        out[0, k], out[1, k], out[2, k] = x * scale, y * scale, z * scale
        out[3, k] = (ax * x + ay * y + az * z) * scale
        fitted = ax * s[6, k] + ay * s[7, k] + az * s[8, k] + bx * s[9, k] + by * s[10, k] + bz * s[11, k]
        fitted += cx * s[12, k] + cy * s[13, k] + cz * s[14, k]
        rest = s[15, k] - fitted
        out[4, k] = rest if rest > 0 else np.float32(0.0)
        out[5, k] = abs(cosine) if solved else np.float32(-1.0)


@njit(cache=True, nogil=True, error_model="numpy")
def _lies_between(planes: SingleArray, row: int, at: int, reach2: SingleArray, ray: SingleArray) -> bool:
    """Return whether something adjacent is nearer to the scanner and something farther, both beyond reach."""
    nearer = farther = False
    for du in range(-1, 2):
        for dv in range(-1, 2):
            d2 = along = np.float32(0.0)
            for axis in range(3):
                d = planes[axis, row + du, at + dv] - planes[axis, row, at]
                d2 += d * d
                along += d * ray[axis]
            jump = d2 >= reach2[du + REACH, dv + REACH]
            nearer |= jump and along < 0 and (du != 0 or dv != 0)
            farther |= jump and along > 0 and (du != 0 or dv != 0)
    return bool(nearer and farther)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=_FAST)
def _judge_block(
    s: SingleArray, out: SingleArray, count: int, limits: tuple[float, float, float, float], verdicts: ByteArray
) -> None:
    """Judge `count` points from their sums and planes; `limits` are sigma, cut, fewest and least.

    A point with few neighbours has _FEWER added to its verdict: whether it is MIXED, its surroundings decide.
    """
    variance, cut2 = np.float32(limits[0] * limits[0]), np.float32(limits[1] * limits[1])
    fewest, least = np.float32(limits[2]), np.float32(limits[3])
    for k in range(count):
        n, cosine = s[0, k], out[5, k]
        freedom = n - np.float32(3.0)
        rms2 = out[4, k] / (freedom if freedom > np.float32(1.0) else np.float32(1.0))
        rms2 = rms2 if rms2 > variance else variance
        far = out[3, k] * out[3, k] > cut2 * rms2
        verdict = np.int32(GRAZING) if cosine < least else np.int32(KEPT)
        verdict = np.int32(STRAY) if far else verdict
        verdict = np.int32(STRAY) if (n < fewest) | (cosine < np.float32(0.0)) else verdict
        verdict = np.int32(_FEWER) + verdict if n < np.float32(_FEW) else verdict
        verdicts[k] = np.uint8(verdict)


@njit(cache=True, nogil=True, error_model="numpy")
def judge_grid(
    planes: SingleArray,
    reach2: SingleArray,
    rays: SingleArray,
    limits: tuple[float, float, float, float],
    first: int,
    last: int,
    verdicts: ByteArray,
    normals: SingleArray,
    cosines: SingleArray,
) -> None:
    """Judge the points of rows `first` to `last` of the grid without its border.

    Parameters
    ----------
    planes : (3, P + 4, C + 4)
        Coordinates with a border of NaN.
    reach2 : (5, 5)
        Squared distance within which a neighbour counts as connected, mm².
    rays : (P, 3)
        Unit direction of sight of each row.
    limits : sigma, cut, fewest, least
        Noise in mm, the residuals in units of it that are still believed, the fewest of the 24 neighbours that
        must be connected, and the least cosine of incidence.
    verdicts : (P, C)
    normals : (3, P, C)
    cosines : (P, C)
        Filled in these rows.
    """
    s = np.empty((_SUMS, _BLOCK), np.float32)
    out = np.empty((6, _BLOCK), np.float32)
    columns = verdicts.shape[1]
    for row in range(first, last):
        ray = rays[row]
        for start in range(0, columns, _BLOCK):
            count = min(_BLOCK, columns - start)
            _sum_block(planes, row + REACH, start + REACH, count, reach2, s)
            _solve_block(s, count, ray, out)
            end = start + count
            marks, depths = verdicts[row, start:end], planes[2, row + REACH, start + REACH : end + REACH]
            _judge_block(s, out, count, limits, marks)
            for k in range(count):
                if np.isnan(depths[k]):
                    marks[k] = BLANK
                elif marks[k] >= _FEWER:
                    between = _lies_between(planes, row + REACH, start + k + REACH, reach2, ray)
                    marks[k] = MIXED if between else marks[k] - _FEWER
            for k in range(count):
                for axis in range(3):
                    normals[axis, row, start + k] = out[axis, k]
                cosines[row, start + k] = out[5, k]


@njit(cache=True, nogil=True, error_model="numpy")
def rejudge_near_strays(
    planes: SingleArray,
    reach2: SingleArray,
    rays: SingleArray,
    limits: tuple[float, float, float, float],
    verdicts: ByteArray,
    normals: SingleArray,
    cosines: SingleArray,
) -> None:
    """Judge again every point that a stray stood near enough to count as its neighbour, now without the strays.

    A stray pulls the planes of its neighbours, so that they may look like strays themselves.  Here `planes` still
    holds all points; every neighbour that was judged a stray is left out, the point itself is judged afresh.
    """
    s = np.empty((_SUMS, _BLOCK), np.float32)
    out = np.empty((6, _BLOCK), np.float32)
    small = np.empty((3, 5, 5), np.float32)
    mark = np.empty(1, np.uint8)
    rows, columns = verdicts.shape
    before = verdicts.copy()
    for row in range(rows):
        for at in range(columns):
            verdict = before[row, at]
            if verdict in (BLANK, MIXED):
                continue
            touched = False
            for du in range(-REACH, REACH + 1):
                for dv in range(-REACH, REACH + 1):
                    r, c = row + du, at + dv
                    if 0 <= r < rows and 0 <= c < columns and before[r, c] == STRAY and (du != 0 or dv != 0):
                        d2 = np.float32(0.0)
                        for axis in range(3):
                            d = planes[axis, r + 2, c + 2] - planes[axis, row + 2, at + 2]
                            d2 += d * d
                        touched |= d2 < reach2[du + REACH, dv + REACH]
            if not touched:
                continue
            for du in range(5):
                for dv in range(5):
                    r, c = row + du - 2, at + dv - 2
                    stray = 0 <= r < rows and 0 <= c < columns and before[r, c] == STRAY
                    for axis in range(3):
                        value = planes[axis, row + du, at + dv]
                        small[axis, du, dv] = np.nan if stray and (du != 2 or dv != 2) else value
            _sum_block(small, 2, 2, 1, reach2, s)
            _solve_block(s, 1, rays[row], out)
            _judge_block(s, out, 1, limits, mark)
            if mark[0] >= _FEWER:
                mark[0] = MIXED if _lies_between(small, 2, 2, reach2, rays[row]) else mark[0] - _FEWER
            verdicts[row, at] = mark[0]
            for axis in range(3):
                normals[axis, row, at] = out[axis, 0]
            cosines[row, at] = out[5, 0]


@njit(cache=True, nogil=True, error_model="numpy")
def to_planes(points: SingleArray, into_from_outof: NDArray[np.float64], planes: SingleArray) -> None:
    """Put points (P, C, 3), by a pose a row (P or 1, 3, 4), into planes (3, P + 4, C + 4), but for the border."""
    rows, columns = points.shape[0], points.shape[1]
    one = into_from_outof.shape[0] == 1
    flat = points.reshape(rows, 3 * columns)
    for row in range(rows):
        m = into_from_outof[0 if one else row]
        line = flat[row]
        for axis in range(3):
            a, b, c, d = m[axis, 0], m[axis, 1], m[axis, 2], m[axis, 3]
            target = planes[axis, row + REACH, REACH:]
            for k in range(columns):
                target[k] = a * line[3 * k] + b * line[3 * k + 1] + c * line[3 * k + 2] + d
