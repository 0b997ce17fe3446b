"""Hot loops of the chain: what points know of a sphere's centre, and normal equations without the pose errors."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.matrices import cholesky_3, invert_lower_3, invert_positive_3

IntArray = NDArray[np.int64]


@njit(cache=True, nogil=True, error_model="numpy")
def sphere_information(
    points: FloatArray,
    first: int,
    last: int,
    weight: float,
    center: FloatArray,
    radius: float,
    gradient: FloatArray,
    information: FloatArray,
) -> float:
    """Return half the weighted squared distances |p − q| − R of some points; write gradient and information.

    Parameters
    ----------
    points : (M, 3)
        In L, mm; those from `first` to `last` (excluded) count.
    weight : float
        1/σ², 1/mm².
    center, radius : (3,), float
        The sphere in L, mm.
    gradient, information : (4,), (4, 4)
        Over (centre, radius); Gauss–Newton.  Added to.
    """
    qx, qy, qz = center[0], center[1], center[2]
    c = gx = gy = gz = gr = 0.0
    xx = xy = xz = yy = yz = zz = 0.0
    sx = sy = sz = 0.0
    for i in range(first, last):
        dx, dy, dz = points[i, 0] - qx, points[i, 1] - qy, points[i, 2] - qz
        distance = np.sqrt(dx * dx + dy * dy + dz * dz)
        residual = distance - radius
        scale = 1.0 / distance
        dx *= scale
        dy *= scale
        dz *= scale
        c += residual * residual
        gx -= dx * residual
        gy -= dy * residual
        gz -= dz * residual
        gr -= residual
        sx += dx
        sy += dy
        sz += dz
        xx += dx * dx
        xy += dx * dy
        xz += dx * dz
        yy += dy * dy
        yz += dy * dz
        zz += dz * dz
    sums = ((xx, xy, xz, sx), (xy, yy, yz, sy), (xz, yz, zz, sz), (sx, sy, sz, float(last - first)))
    slopes = (gx, gy, gz, gr)
    for i in range(4):
        gradient[i] += weight * slopes[i]
        for j in range(4):
            information[i, j] += weight * sums[i][j]
    return 0.5 * weight * c


@njit(cache=True, nogil=True, error_model="numpy")
def settle_centers(
    points: FloatArray,
    offsets: IntArray,
    weights: FloatArray,
    anchors: FloatArray,
    anchor_information: FloatArray,
    anchor_gradient: FloatArray,
    anchor_radius: float,
    radius: float,
    predicted: FloatArray,
    precision: FloatArray,
    centers: FloatArray,
    gradient: FloatArray,
    information: FloatArray,
) -> float:
    """Move each capture's own sphere centre to where its points and its pose's error together want it.

    Minimises, capture by capture, half the weighted squared distances (or the anchor's quadratic) plus
    ½ (q − predicted)ᵀ S⁻¹ (q − predicted), by damped Gauss–Newton: undamped it can overshoot near a great
    circle, where y is hardly known.

    Parameters
    ----------
    points, offsets, weights : (M, 3), (K + 1,), (K,)
    anchors, anchor_information, anchor_gradient : (K, 3), (K, 4, 4), (K, 4)
        For captures without points.
    anchor_radius, radius : float
        Where the anchors stand, and the present one, mm.
    predicted, precision : (K, 3), (K, 3, 3)
        Where the unknowns expect the centre, and S⁻¹.
    centers : (K, 3)
        Moved.
    gradient, information : (K, 4), (K, 4, 4)
        Of the capture's own part at the settled centre; written.

    Returns
    -------
    float
        The sum of the minima.
    """
    total = 0.0
    trial = np.empty(3)
    system = np.empty((3, 3))
    inverse = np.empty((3, 3))
    slope = np.empty(3)
    trial_gradient = np.empty(4)
    trial_information = np.empty((4, 4))
    for k in range(len(weights)):
        cost = own_cost(
            points, offsets[k], offsets[k + 1], weights[k], anchors[k], anchor_information[k], anchor_gradient[k],
            radius - anchor_radius, radius, predicted[k], precision[k], centers[k], gradient[k], information[k],
        )  # fmt: skip
        damping = 0.0
        for _ in range(40):
            decrease = 0.0
            for i in range(3):
                slope[i] = gradient[k, i]
                for j in range(3):
                    slope[i] += precision[k, i, j] * (centers[k, j] - predicted[k, j])
                    system[i, j] = information[k, i, j] + precision[k, i, j]
                system[i, i] *= 1.0 + damping
            invert_positive_3(system, inverse)
            for i in range(3):
                step = -(inverse[i, 0] * slope[0] + inverse[i, 1] * slope[1] + inverse[i, 2] * slope[2])
                trial[i] = centers[k, i] + step
                decrease -= 0.5 * step * slope[i]
            if decrease < 1e-9:
                break
            trial_cost = own_cost(
                points, offsets[k], offsets[k + 1], weights[k], anchors[k], anchor_information[k],
                anchor_gradient[k], radius - anchor_radius, radius, predicted[k], precision[k], trial,
                trial_gradient, trial_information,
            )  # fmt: skip
            if trial_cost <= cost:
                cost = trial_cost
                centers[k] = trial
                gradient[k] = trial_gradient
                information[k] = trial_information
                damping *= 0.1
            else:
                damping = max(10.0 * damping, 1e-3)
        total += cost
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def own_cost(
    points: FloatArray,
    first: int,
    last: int,
    weight: float,
    anchor: FloatArray,
    anchor_information: FloatArray,
    anchor_gradient: FloatArray,
    radius_change: float,
    radius: float,
    predicted: FloatArray,
    precision: FloatArray,
    center: FloatArray,
    gradient: FloatArray,
    information: FloatArray,
) -> float:
    """Return one capture's cost at a centre, its pose's error included; write the own part's derivatives."""
    cost = 0.0
    gradient[:] = 0.0
    information[:] = 0.0
    if last > first:
        cost = sphere_information(points, first, last, weight, center, radius, gradient, information)
    else:
        for i in range(4):
            off_i = center[i] - anchor[i] if i < 3 else radius_change
            gradient[i] = anchor_gradient[i]
            for j in range(4):
                off_j = center[j] - anchor[j] if j < 3 else radius_change
                information[i, j] = anchor_information[i, j]
                gradient[i] += anchor_information[i, j] * off_j
            cost += 0.5 * off_i * (gradient[i] + anchor_gradient[i])
    for i in range(3):
        for j in range(3):
            cost += 0.5 * (center[i] - predicted[i]) * precision[i, j] * (center[j] - predicted[j])
    return cost


@njit(cache=True, nogil=True, error_model="numpy")
def predict_centers(
    rotations: FloatArray,
    translations: FloatArray,
    tool_rotation: FloatArray,
    tool_translation: FloatArray,
    centers: FloatArray,
    predicted: FloatArray,
    jacobian: FloatArray,
) -> None:
    """Write where each capture should see its sphere's centre in L, and the derivatives.

    q = R_sᵀ (R_0ᵀ (c − T_0) − T_s).  Columns of the derivative: rotation of tool0_from_laser (on the right),
    its translation, the capture's sphere centre in base.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0.
    tool_rotation, tool_translation : (3, 3), (3,)
        tool0_from_laser.
    centers : (K, 3)
        Each capture's sphere centre in base, mm.
    predicted, jacobian : (K, 3), (K, 3, 9)
        Written.
    """
    r = tool_rotation
    for k in range(len(translations)):
        b = rotations[k]
        dx = centers[k, 0] - translations[k, 0]
        dy = centers[k, 1] - translations[k, 1]
        dz = centers[k, 2] - translations[k, 2]
        tx = b[0, 0] * dx + b[1, 0] * dy + b[2, 0] * dz - tool_translation[0]
        ty = b[0, 1] * dx + b[1, 1] * dy + b[2, 1] * dz - tool_translation[1]
        tz = b[0, 2] * dx + b[1, 2] * dy + b[2, 2] * dz - tool_translation[2]
        j = jacobian[k]
        for i in range(3):
            predicted[k, i] = r[0, i] * tx + r[1, i] * ty + r[2, i] * tz
            for m in range(3):
                j[i, 3 + m] = -r[m, i]
                j[i, 6 + m] = r[0, i] * b[m, 0] + r[1, i] * b[m, 1] + r[2, i] * b[m, 2]
        qx, qy, qz = predicted[k, 0], predicted[k, 1], predicted[k, 2]
        j[0, 0] = j[1, 1] = j[2, 2] = 0.0
        j[0, 1], j[0, 2] = -qz, qy
        j[1, 0], j[1, 2] = qz, -qx
        j[2, 0], j[2, 1] = -qy, qx


@njit(cache=True, nogil=True, error_model="numpy")
def pose_error_gain(information: FloatArray, spread: FloatArray, gain: FloatArray, share: FloatArray) -> float:
    """Write G = S (I + A S)⁻¹ and N = (I + S A)⁻¹ for each capture's 3×3 blocks; return Σ log det(I + A S).

    A is what a capture knows of the sphere's centre in L and S the covariance of that centre by the pose's own
    error; then A N = A − A G A is what is left when the pose error is integrated out (Woodbury).  A great circle
    makes A nearly singular while its other directions are known to micrometres, so both come from the Cholesky
    factor of S, L, and that of I + Lᵀ A L, which nothing cancels in.

    Parameters
    ----------
    information : (K, m ≥ 3, m)
        Its upper left 3×3 blocks are used.
    spread, gain, share : (K, 3, 3)
        S; G and N to be written.
    """
    logarithm = 0.0
    b = np.empty((3, 3))
    m = np.empty((3, 3))
    low = np.zeros((3, 3))
    low_inverse = np.zeros((3, 3))
    for k in range(len(spread)):
        a, s = information[k], spread[k]
        cholesky_3(s, low)
        invert_lower_3(low, low_inverse)
        for i in range(3):
            for j in range(3):
                value = 0.0
                for p in range(3):
                    for q in range(3):
                        value += low[p, i] * a[p, q] * low[q, j]
                b[i, j] = value
            b[i, i] += 1.0
        logarithm += invert_positive_3(b, m)
        for i in range(3):
            for j in range(3):
                of_gain = of_share = 0.0
                for p in range(i + 1):
                    for q in range(3):
                        of_gain += low[i, p] * m[p, q] * low[j, q]
                        of_share += low[i, p] * m[p, q] * low_inverse[q, j]
                gain[k, i, j] = of_gain
                share[k, i, j] = of_share
    return logarithm


@njit(cache=True, nogil=True, error_model="numpy")
def marginal_normal_equations(
    information: FloatArray,
    vector: FloatArray,
    gain: FloatArray,
    share: FloatArray,
    offset: FloatArray,
    jacobian: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
) -> None:
    """Write the normal equations of all captures with their pose errors integrated out.

    With Λ = A N and η = Nᵀ h a capture's log-likelihood in the predicted centre's change e is −½ eᵀΛe + ηᵀe;
    `offset` is e at the linearisation point.  The radius (m = 4) has no pose error: its row is A's own, less what
    G explains.

    Parameters
    ----------
    information, vector : (K, m, m), (K, m)
        A and h about the present centre (and radius, where m = 4).
    gain, share : (K, 3, 3)
        G and N of `pose_error_gain`.
    offset : (K, 3)
        Predicted minus present centre, mm.
    jacobian : (K, 3, P)
        Of the predicted centre; the radius, where m = 4, is a further last parameter.
    hessian, gradient : (P', P'), (P',)
        Written; P' is P + m − 3.
    """
    m = information.shape[1]
    width = jacobian.shape[2]
    size = width + m - 3
    hessian[:] = 0.0
    gradient[:] = 0.0
    reduced = np.empty((m, m))
    rest = np.empty(m)
    rows = np.zeros((m, size))
    weighted = np.empty((m, size))
    if m == 4:
        rows[3, size - 1] = 1.0
    for k in range(len(offset)):
        for i in range(3):
            for p in range(width):
                rows[i, p] = jacobian[k, i, p]
        without_pose_error(information[k], vector[k], gain[k], share[k], reduced, rest)
        for i in range(m):
            for j in range(3):
                rest[i] -= reduced[i, j] * offset[k, j]
        for i in range(m):
            for p in range(size):
                value = 0.0
                for j in range(m):
                    value += reduced[i, j] * rows[j, p]
                weighted[i, p] = value
        for p in range(size):
            value = 0.0
            for i in range(m):
                value += rows[i, p] * rest[i]
            gradient[p] -= value
            for q in range(p, size):
                value = 0.0
                for i in range(m):
                    value += rows[i, p] * weighted[i, q]
                hessian[p, q] += value
    for p in range(size):
        for q in range(p):
            hessian[p, q] = hessian[q, p]


@njit(cache=True, nogil=True, error_model="numpy")
def without_pose_error(
    a: FloatArray, h: FloatArray, g: FloatArray, n: FloatArray, reduced: FloatArray, rest: FloatArray
) -> None:
    """Write Λ (m, m) and η (m,) of one capture: see `marginal_normal_equations`."""
    m = len(h)
    for i in range(m):
        for j in range(3):
            reduced[i, j] = a[i, 0] * n[0, j] + a[i, 1] * n[1, j] + a[i, 2] * n[2, j]
            if i == 3:
                reduced[j, 3] = reduced[3, j]
    for i in range(3):  # rounding alone makes A N unsymmetric
        for j in range(i):
            reduced[i, j] = reduced[j, i] = 0.5 * (reduced[i, j] + reduced[j, i])
        rest[i] = n[0, i] * h[0] + n[1, i] * h[1] + n[2, i] * h[2]
    if m == 4:
        reduced[3, 3] = a[3, 3]
        rest[3] = h[3]
        for i in range(3):
            for j in range(3):
                reduced[3, 3] -= a[3, i] * g[i, j] * a[j, 3]
                rest[3] -= a[3, i] * g[i, j] * h[j]
