"""Normal equations of boards seen by one camera, and of laser lines on those boards.

Shared parameters stand in one vector: fx fy cx cy · 14 coefficients per band of depth · 7 of the board's shape ·
the 3 of the plane of light, q = normal / distance. Every view adds its 6 of camera_from_board (rx ry rz perturbing
on the right, tx ty tz). Only the `free` ones of the shared get columns. Both kernels add to the same equations.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.project import band_position, blend_bands, tilt_homography
from calib_core.kernels.undistort import distortion_and_slopes

IntArray = NDArray[np.int64]

LENS = 4  # where the first band's coefficients stand
SHAPE_TERMS = 7
PLANE_TERMS = 3
_LINE_STEPS = 2
_TILT_STEP = 1e-5  # rad; the central difference of a homography's elements is exact to 1e-11 there


@njit(cache=True, nogil=True)
def _tilts(d: FloatArray) -> FloatArray:
    """Return the tilt's homography and its derivatives by both angles, (3, 3, 3)."""
    result = np.empty((3, 3, 3))
    h = _TILT_STEP
    result[0] = tilt_homography(d[12], d[13])
    result[1] = (tilt_homography(d[12] + h, d[13]) - tilt_homography(d[12] - h, d[13])) / (2 * h)
    result[2] = (tilt_homography(d[12], d[13] + h) - tilt_homography(d[12], d[13] - h)) / (2 * h)
    return result


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _ray_gradients(
    x: float, y: float, d: FloatArray, focal: FloatArray, tilts: FloatArray, out: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """Return a ray's u, v and ∂u/∂x ∂u/∂y ∂v/∂x ∂v/∂y; `out` (2, 18) gets ∂(u, v) by fx fy cx cy and lens."""
    a, b, j_xx, j_xy, j_yx, j_yy = distortion_and_slopes(x, y, d)
    s = x * x + y * y
    under = 1.0 / (1.0 + s * (d[5] + s * (d[6] + s * d[7])))
    radial = (1.0 + s * (d[0] + s * (d[1] + s * d[4]))) * under
    t = tilts[0]
    scale = 1.0 / (t[2, 0] * a + t[2, 1] * b + t[2, 2])
    xt = (t[0, 0] * a + t[0, 1] * b + t[0, 2]) * scale
    yt = (t[1, 0] * a + t[1, 1] * b + t[1, 2]) * scale
    fx, fy = focal[0], focal[1]
    u_a, u_b = fx * (t[0, 0] - xt * t[2, 0]) * scale, fx * (t[0, 1] - xt * t[2, 1]) * scale
    v_a, v_b = fy * (t[1, 0] - yt * t[2, 0]) * scale, fy * (t[1, 1] - yt * t[2, 1]) * scale
    out[0, 0], out[1, 0] = xt, 0.0
    out[0, 1], out[1, 1] = 0.0, yt
    out[0, 2], out[1, 2] = 1.0, 0.0
    out[0, 3], out[1, 3] = 0.0, 1.0
    u_r, v_r = (u_a * x + u_b * y) * under, (v_a * x + v_b * y) * under
    power = s
    for order, over_index, under_index in ((0, 0, 5), (1, 1, 6), (2, 4, 7)):
        out[0, LENS + over_index], out[1, LENS + over_index] = u_r * power, v_r * power
        out[0, LENS + under_index] = -u_r * radial * power
        out[1, LENS + under_index] = -v_r * radial * power
        if order < 2:
            out[0, LENS + 8 + order], out[1, LENS + 8 + order] = u_a * power, v_a * power
            out[0, LENS + 10 + order], out[1, LENS + 10 + order] = u_b * power, v_b * power
        power *= s
    cross, along_x, along_y = 2.0 * x * y, s + 2.0 * x * x, s + 2.0 * y * y
    out[0, LENS + 2], out[1, LENS + 2] = u_a * cross + u_b * along_y, v_a * cross + v_b * along_y
    out[0, LENS + 3], out[1, LENS + 3] = u_a * along_x + u_b * cross, v_a * along_x + v_b * cross
    for j in range(2):
        e = tilts[1 + j]
        w = e[2, 0] * a + e[2, 1] * b + e[2, 2]
        out[0, LENS + 12 + j] = fx * (e[0, 0] * a + e[0, 1] * b + e[0, 2] - xt * w) * scale
        out[1, LENS + 12 + j] = fy * (e[1, 0] * a + e[1, 1] * b + e[1, 2] - yt * w) * scale
    return (
        fx * xt + focal[2],
        fy * yt + focal[3],
        u_a * j_xx + u_b * j_yx,
        u_a * j_xy + u_b * j_yy,
        v_a * j_xx + v_b * j_yx,
        v_a * j_xy + v_b * j_yy,
    )


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _spread_over_bands(
    by_lens: FloatArray, band: int, weight: float, band_count: int, row: int, gradient: FloatArray
) -> None:
    """Copy ∂ by focal and blended lens into the shared vector's places of the one or two bands at work."""
    for j in range(LENS):
        gradient[j] = by_lens[row, j]
    if band_count == 1:
        for j in range(14):
            gradient[LENS + j] = by_lens[row, LENS + j]
        return
    gradient[LENS : LENS + 14 * band_count] = 0.0
    lower = LENS + 14 * band
    for j in range(12):
        gradient[lower + j] = (1.0 - weight) * by_lens[row, LENS + j]
        gradient[lower + 14 + j] = weight * by_lens[row, LENS + j]
    for j in range(12, 14):  # the sensor is tilted once, for all depths: the first band's angles hold
        gradient[LENS + j] = by_lens[row, LENS + j]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def _add_products(
    rows: FloatArray,
    count: int,
    shared: int,
    view: int,
    h_cc: FloatArray,
    g_c: FloatArray,
    h_cp: FloatArray,
    h_pp: FloatArray,
    g_p: FloatArray,
) -> None:
    """Add JᵀJ and Jᵀr of one view; `rows` is (shared + 7, ≥ count): shared columns, six of the pose, residual."""
    last = shared + 6
    for a in range(last):
        for b in range(a, last + 1):
            total = 0.0
            for i in range(count):
                total += rows[a, i] * rows[b, i]
            if b == last:
                if a < shared:
                    g_c[a] += total
                else:
                    g_p[view, a - shared] += total
            elif b < shared:
                h_cc[a, b] += total
                if a != b:
                    h_cc[b, a] += total
            elif a < shared:
                h_cp[view, a, b - shared] += total
            else:
                h_pp[view, a - shared, b - shared] += total
                if a != b:
                    h_pp[view, b - shared, a - shared] += total


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def add_corners(
    pixels: FloatArray,
    points_mm: FloatArray,
    basis: FloatArray,
    ends: IntArray,
    weights: FloatArray,
    huber: float,
    shared: FloatArray,
    band_nears: FloatArray,
    band_fars: FloatArray,
    free: IntArray,
    rotations: FloatArray,
    translations: FloatArray,
    h_cc: FloatArray,
    g_c: FloatArray,
    h_cp: FloatArray,
    h_pp: FloatArray,
    g_p: FloatArray,
    residuals: FloatArray,
) -> float:
    """Add the board corners of all views to the normal equations and return their cost.

    Parameters
    ----------
    pixels : (N, 2)
    points_mm : (N, 3)
        The corners in the board's frame.
    basis : (N, 7)
        Functions of the board's place by which its shape may leave the plane, mm per unit of coefficient.
    ends : (V + 1,)
        Corners of view k are those from ends[k] to ends[k + 1].
    weights : (N,)
        1 / σ of each corner, 1/px; 0 leaves it out.
    huber : float
        Residuals longer than this many σ count linearly.
    residuals : (N, 2)
        Seen minus predicted, px; written.
    """
    band_count = band_nears.size
    bands = shared[LENS : LENS + 14 * band_count].copy().reshape(band_count, 14)
    shape_at = LENS + 14 * band_count
    d = bands[0].copy()
    tilts = _tilts(d)
    by_lens = np.empty((2, LENS + 14))
    gradient = np.zeros(shape_at + SHAPE_TERMS + PLANE_TERMS)
    count, views = free.size, ends.size - 1
    largest = 0
    for view in range(views):
        largest = max(largest, ends[view + 1] - ends[view])
    rows = np.empty((count + 7, 2 * largest))
    cost = 0.0
    for view in range(views):
        r, t = rotations[view], translations[view]
        filled = 0
        for i in range(ends[view], ends[view + 1]):
            px, py, pz = points_mm[i, 0], points_mm[i, 1], points_mm[i, 2]
            for j in range(SHAPE_TERMS):
                pz += shared[shape_at + j] * basis[i, j]
            depth = r[2, 0] * px + r[2, 1] * py + r[2, 2] * pz + t[2]
            if not depth > 0.0:
                return np.inf
            over = 1.0 / depth
            x = (r[0, 0] * px + r[0, 1] * py + r[0, 2] * pz + t[0]) * over
            y = (r[1, 0] * px + r[1, 1] * py + r[1, 2] * pz + t[1]) * over
            band, weight, slope = 0, 0.0, 0.0
            if band_count > 1:
                band, weight, slope = band_position(depth, band_nears, band_fars)
                blend_bands(depth, bands, band_nears, band_fars, d)
            u, v, u_x, u_y, v_x, v_y = _ray_gradients(x, y, d, shared, tilts, by_lens)
            du, dv = pixels[i, 0] - u, pixels[i, 1] - v
            residuals[i, 0] = du
            residuals[i, 1] = dv
            w = weights[i]
            if w == 0.0:
                continue
            length = w * np.sqrt(du * du + dv * dv)
            if length > huber:
                cost += huber * (length - 0.5 * huber)
                w *= np.sqrt(huber / length)
            else:
                cost += 0.5 * length * length
            for k in range(2):
                g_x, g_y, error = (u_x, u_y, du) if k == 0 else (v_x, v_y, dv)
                a0, a1, a2 = g_x * over, g_y * over, -(g_x * x + g_y * y) * over
                if slope != 0.0:
                    for j in range(14):
                        a2 += by_lens[k, LENS + j] * (bands[band + 1, j] - bands[band, j]) * slope
                _spread_over_bands(by_lens, band, weight, band_count, k, gradient)
                b0 = a0 * r[0, 0] + a1 * r[1, 0] + a2 * r[2, 0]
                b1 = a0 * r[0, 1] + a1 * r[1, 1] + a2 * r[2, 1]
                b2 = a0 * r[0, 2] + a1 * r[1, 2] + a2 * r[2, 2]
                for j in range(SHAPE_TERMS):
                    gradient[shape_at + j] = b2 * basis[i, j]
                for c in range(count):
                    rows[c, filled] = -w * gradient[free[c]]
                rows[count, filled] = -w * (py * b2 - pz * b1)
                rows[count + 1, filled] = -w * (pz * b0 - px * b2)
                rows[count + 2, filled] = -w * (px * b1 - py * b0)
                rows[count + 3, filled] = -w * a0
                rows[count + 4, filled] = -w * a1
                rows[count + 5, filled] = -w * a2
                rows[count + 6, filled] = w * error
                filled += 1
        _add_products(rows, filled, count, view, h_cc, g_c, h_cp, h_pp, g_p)
    return cost


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def add_laser_lines(
    pixels: FloatArray,
    basis: FloatArray,
    axes: IntArray,
    ends: IntArray,
    weights: FloatArray,
    huber: float,
    shared: FloatArray,
    band_nears: FloatArray,
    band_fars: FloatArray,
    free: IntArray,
    rotations: FloatArray,
    translations: FloatArray,
    h_cc: FloatArray,
    g_c: FloatArray,
    h_cp: FloatArray,
    h_pp: FloatArray,
    g_p: FloatArray,
    residuals: FloatArray,
) -> float:
    """Add the laser's line on each board and return its cost.

    A ray m = (x, y, 1) meets the board n_b · p = d_b and the light n · p = d at the same depth when
    (n / d − n_b / d_b) · m = 0; d_b has the board's height there where it is bent. That, divided by its slope
    along the pixel axis in which the stripe's centre was measured, is the residual in px.

    Parameters
    ----------
    pixels : (M, 2)
    basis : (M, 7)
        Functions of the place on the board where the light meets it, mm per unit of the shape's coefficients.
    axes : (M,)
        0 where u was measured (stripe across a row), 1 where v was.
    residuals : (M,)
        px; written.
    The others are those of `add_corners`.
    """
    band_count = band_nears.size
    bands = shared[LENS : LENS + 14 * band_count].copy().reshape(band_count, 14)
    shape_at = LENS + 14 * band_count
    plane_at = shape_at + SHAPE_TERMS
    q = shared[plane_at : plane_at + 3]
    d = bands[0].copy()
    tilts = _tilts(d)
    by_lens = np.empty((2, LENS + 14))
    gradient = np.zeros(plane_at + PLANE_TERMS)
    other = np.zeros(plane_at + PLANE_TERMS)
    count, views = free.size, ends.size - 1
    largest = 0
    for view in range(views):
        largest = max(largest, ends[view + 1] - ends[view])
    rows = np.empty((count + 7, largest))
    cost = 0.0
    for view in range(views):
        r, t = rotations[view], translations[view]
        n0, n1, n2 = r[0, 2], r[1, 2], r[2, 2]
        flat = n0 * t[0] + n1 * t[1] + n2 * t[2]
        x, y = 0.0, 0.0
        filled = 0
        for i in range(ends[view], ends[view + 1]):
            distance = flat
            for j in range(SHAPE_TERMS):
                distance += shared[shape_at + j] * basis[i, j]
            e0, e1, e2 = q[0] - n0 / distance, q[1] - n1 / distance, q[2] - n2 / distance
            band, weight, slope, by_u, by_v = 0, 0.0, 1.0, 0.0, 0.0
            u, v, u_x, u_y, v_x, v_y = 0.0, 0.0, 1.0, 0.0, 0.0, 1.0
            seen_u, seen_v, error = pixels[i, 0], pixels[i, 1], 0.0
            # The slopes must be those where the line is, not where noise has put the centre: else they go with the
            # noise, and its square draws the lens.  So the line is sought along the axis first.
            for _ in range(_LINE_STEPS):
                for _ in range(12):  # from the neighbour's ray: three steps do
                    if band_count > 1:
                        depth = distance / (n0 * x + n1 * y + n2)
                        band, weight, _ = band_position(depth, band_nears, band_fars)
                        blend_bands(depth, bands, band_nears, band_fars, d)
                    u, v, u_x, u_y, v_x, v_y = _ray_gradients(x, y, d, shared, tilts, by_lens)
                    determinant = u_x * v_y - u_y * v_x
                    du, dv = seen_u - u, seen_v - v
                    x += (v_y * du - u_y * dv) / determinant
                    y += (u_x * dv - v_x * du) / determinant
                    if du * du + dv * dv < 1e-14:
                        break
                determinant = u_x * v_y - u_y * v_x
                by_u = (e0 * v_y - e1 * v_x) / determinant  # ∂((q − q_b) · m) / ∂u
                by_v = (e1 * u_x - e0 * u_y) / determinant
                slope = by_u if axes[i] == 0 else by_v
                off = (e0 * x + e1 * y + e2) / slope
                error += off
                if axes[i] == 0:
                    seen_u -= off
                else:
                    seen_v -= off
            residuals[i] = error
            w = weights[i]
            if w == 0.0:
                continue
            if not np.isfinite(error):
                return np.inf
            length = w * abs(error)
            if length > huber:
                cost += huber * (length - 0.5 * huber)
                w *= np.sqrt(huber / length)
            else:
                cost += 0.5 * length * length
            _spread_over_bands(by_lens, band, weight, band_count, 0, gradient)
            _spread_over_bands(by_lens, band, weight, band_count, 1, other)
            for j in range(shape_at):  # the ray moves against the pixel's prediction
                gradient[j] = -(by_u * gradient[j] + by_v * other[j])
            gradient[plane_at], gradient[plane_at + 1], gradient[plane_at + 2] = x, y, 1.0
            w /= slope
            m_n = (n0 * x + n1 * y + n2) / (distance * distance)
            for j in range(SHAPE_TERMS):
                gradient[shape_at + j] = m_n * basis[i, j]
            for c in range(count):
                rows[c, filled] = w * gradient[free[c]]
            for k in range(2):  # turning about the board's x axis moves its normal along −y, about y along +x
                s, a = (-1.0, 1) if k == 0 else (1.0, 0)
                m_dn = s * (r[0, a] * x + r[1, a] * y + r[2, a]) / distance
                t_dn = s * (r[0, a] * t[0] + r[1, a] * t[1] + r[2, a] * t[2])
                rows[count + k, filled] = -w * (m_dn - m_n * t_dn)
            rows[count + 2, filled] = 0.0
            rows[count + 3, filled] = w * m_n * n0
            rows[count + 4, filled] = w * m_n * n1
            rows[count + 5, filled] = w * m_n * n2
            rows[count + 6, filled] = w * slope * error
            filled += 1
        _add_products(rows, filled, count, view, h_cc, g_c, h_cp, h_pp, g_p)
    return cost
