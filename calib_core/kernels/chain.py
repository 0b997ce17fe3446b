"""Hot loops of the chain: what points know of a sphere's centre, and normal equations without the pose errors."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy")
def point_information(points, offsets, weights, centers, radius, cost, gradient, information):
    """Write each capture's cost, gradient and Gauss–Newton information over (centre, radius).

    Residuals are |p − q| − R with weight 1/σ²; captures without points get zeros.

    Parameters
    ----------
    points : (M, 3)
        All captures' points in L, mm.
    offsets : (K + 1,)
        Where each capture's points begin.
    weights : (K,)
        1/σ², 1/mm².
    centers : (K, 3)
        The sphere's centre in L for each capture, mm.
    radius : float
        mm.
    cost, gradient, information : (K,), (K, 4), (K, 4, 4)
        Written.
    """
    for k in range(len(weights)):
        qx, qy, qz = centers[k, 0], centers[k, 1], centers[k, 2]
        c = gx = gy = gz = gr = 0.0
        xx = xy = xz = yy = yz = zz = 0.0
        sx = sy = sz = 0.0
        for i in range(offsets[k], offsets[k + 1]):
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
        w = weights[k]
        cost[k] = 0.5 * w * c
        gradient[k, 0], gradient[k, 1], gradient[k, 2], gradient[k, 3] = w * gx, w * gy, w * gz, w * gr
        count = offsets[k + 1] - offsets[k]
        a = information[k]
        a[0, 0], a[1, 1], a[2, 2], a[3, 3] = w * xx, w * yy, w * zz, w * count
        a[0, 1] = a[1, 0] = w * xy
        a[0, 2] = a[2, 0] = w * xz
        a[1, 2] = a[2, 1] = w * yz
        a[0, 3] = a[3, 0] = w * sx
        a[1, 3] = a[3, 1] = w * sy
        a[2, 3] = a[3, 2] = w * sz


@njit(cache=True, nogil=True, error_model="numpy")
def predict_tcp(rotations, translations, tool_rotation, tool_translation, center, predicted, jacobian):
    """Write where each capture should see the sphere's centre in L, and the derivatives.

    q = R_sᵀ (R_0ᵀ (c − T_0) − T_s).  Columns of the derivative: rotation of tool0_from_laser (on the right),
    its translation, the sphere's centre in base.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0.
    tool_rotation, tool_translation : (3, 3), (3,)
        tool0_from_laser.
    center : (3,)
        The sphere's centre in base, mm.
    predicted, jacobian : (K, 3), (K, 3, 9)
        Written.
    """
    r = tool_rotation
    for k in range(len(translations)):
        b = rotations[k]
        dx = center[0] - translations[k, 0]
        dy = center[1] - translations[k, 1]
        dz = center[2] - translations[k, 2]
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
def pose_error_gain(information, spread, gain):
    """Write G = S (I + A S)⁻¹ for each capture's 3×3 blocks and return Σ log det(I + A S).

    A is what a capture knows of the sphere's centre in L and S the covariance of that centre by the pose's own
    error; then A − A G A is what is left when the pose error is integrated out (Woodbury).

    Parameters
    ----------
    information : (K, m ≥ 3, m)
        Its upper left 3×3 blocks are used.
    spread, gain : (K, 3, 3)
        S, and G to be written.
    """
    logarithm = 0.0
    m = np.empty((3, 3))
    for k in range(len(spread)):
        a, s, g = information[k], spread[k], gain[k]
        for i in range(3):
            for j in range(3):
                m[i, j] = a[i, 0] * s[0, j] + a[i, 1] * s[1, j] + a[i, 2] * s[2, j]
            m[i, i] += 1.0
        c00 = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
        c01 = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
        c02 = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
        determinant = m[0, 0] * c00 + m[0, 1] * c01 + m[0, 2] * c02
        logarithm += np.log(determinant)
        f = 1.0 / determinant
        i00, i10, i20 = c00 * f, c01 * f, c02 * f
        i01 = (m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]) * f
        i11 = (m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]) * f
        i21 = (m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]) * f
        i02 = (m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]) * f
        i12 = (m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]) * f
        i22 = (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]) * f
        for i in range(3):
            g[i, 0] = s[i, 0] * i00 + s[i, 1] * i10 + s[i, 2] * i20
            g[i, 1] = s[i, 0] * i01 + s[i, 1] * i11 + s[i, 2] * i21
            g[i, 2] = s[i, 0] * i02 + s[i, 1] * i12 + s[i, 2] * i22
    return logarithm


@njit(cache=True, nogil=True, error_model="numpy")
def marginal_normal_equations(information, vector, gain, offset, jacobian, hessian, gradient):
    """Write the normal equations of all captures with their pose errors integrated out.

    With Λ = A − A G A and η = h − A G h a capture's log-likelihood in the predicted centre's change e is
    −½ eᵀΛe + ηᵀe; `offset` is e at the linearisation point.

    Parameters
    ----------
    information, vector : (K, m, m), (K, m)
        A and h about the present centre (and radius, where m = 4).
    gain : (K, 3, 3)
        G of `pose_error_gain`.
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
    ga = np.empty((3, m))
    gh = np.empty(3)
    reduced = np.empty((m, m))
    rest = np.empty(m)
    rows = np.empty((m, size))
    weighted = np.empty((m, size))
    rows[:] = 0.0
    if m == 4:
        rows[3, size - 1] = 1.0
    for k in range(len(offset)):
        a, h, g = information[k], vector[k], gain[k]
        for i in range(3):
            for j in range(m):
                ga[i, j] = g[i, 0] * a[0, j] + g[i, 1] * a[1, j] + g[i, 2] * a[2, j]
            gh[i] = g[i, 0] * h[0] + g[i, 1] * h[1] + g[i, 2] * h[2]
            for p in range(width):
                rows[i, p] = jacobian[k, i, p]
        for i in range(m):
            rest[i] = h[i] - (a[i, 0] * gh[0] + a[i, 1] * gh[1] + a[i, 2] * gh[2])
            for j in range(m):
                reduced[i, j] = a[i, j] - (a[i, 0] * ga[0, j] + a[i, 1] * ga[1, j] + a[i, 2] * ga[2, j])
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
