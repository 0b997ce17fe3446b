"""The hot loop of a TCP from sphere centres alone, whose weights do not change from step to step."""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def center_normal_equations(
    rotations: FloatArray,
    translations: FloatArray,
    weights: FloatArray,
    measured: FloatArray,
    tool_rotation: FloatArray,
    tool_translation: FloatArray,
    center: FloatArray,
    hessian: FloatArray,
    gradient: FloatArray,
) -> float:
    """Write the normal equations of all captures' centres; return half the sum of weighted squares.

    Residuals are R_sᵀ (R_0ᵀ (c − T_0) − T_s) − X in L; the unknowns are the rotation of tool0_from_laser (on the
    right), its translation, and the sphere's centre in base.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0.
    weights, measured : (K, 3, 3), (K, 3)
        Inverse covariance of each centre, its pose's error included, and the centre X, in L.
    tool_rotation, tool_translation, center : (3, 3), (3,), (3,)
    hessian, gradient : (9, 9), (9,)
        Written.
    """
    r = tool_rotation
    cost = 0.0
    rows = np.zeros((3, 9))
    weighted = np.empty((3, 9))
    residual = np.empty(3)
    pull = np.empty(3)
    hessian[:] = 0.0
    gradient[:] = 0.0
    for i in range(3):
        for m in range(3):
            rows[i, 3 + m] = -r[m, i]
    for k in range(len(translations)):
        b, w = rotations[k], weights[k]
        dx = center[0] - translations[k, 0]
        dy = center[1] - translations[k, 1]
        dz = center[2] - translations[k, 2]
        tx = b[0, 0] * dx + b[1, 0] * dy + b[2, 0] * dz - tool_translation[0]
        ty = b[0, 1] * dx + b[1, 1] * dy + b[2, 1] * dz - tool_translation[1]
        tz = b[0, 2] * dx + b[1, 2] * dy + b[2, 2] * dz - tool_translation[2]
        qx = r[0, 0] * tx + r[1, 0] * ty + r[2, 0] * tz
        qy = r[0, 1] * tx + r[1, 1] * ty + r[2, 1] * tz
        qz = r[0, 2] * tx + r[1, 2] * ty + r[2, 2] * tz
        residual[0], residual[1], residual[2] = qx - measured[k, 0], qy - measured[k, 1], qz - measured[k, 2]
        rows[0, 1], rows[0, 2] = -qz, qy
        rows[1, 0], rows[1, 2] = qz, -qx
        rows[2, 0], rows[2, 1] = -qy, qx
        for i in range(3):
            for m in range(3):
                rows[i, 6 + m] = r[0, i] * b[m, 0] + r[1, i] * b[m, 1] + r[2, i] * b[m, 2]
        for i in range(3):
            pull[i] = w[i, 0] * residual[0] + w[i, 1] * residual[1] + w[i, 2] * residual[2]
            cost += 0.5 * residual[i] * pull[i]
            for p in range(9):
                weighted[i, p] = w[i, 0] * rows[0, p] + w[i, 1] * rows[1, p] + w[i, 2] * rows[2, p]
        for p in range(9):
            gradient[p] += rows[0, p] * pull[0] + rows[1, p] * pull[1] + rows[2, p] * pull[2]
            for q in range(p, 9):
                hessian[p, q] += (
                    rows[0, p] * weighted[0, q] + rows[1, p] * weighted[1, q] + rows[2, p] * weighted[2, q]
                )
    for p in range(9):
        for q in range(p):
            hessian[p, q] = hessian[q, p]
    return cost


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})
def center_weights(
    information: FloatArray,
    arms: FloatArray,
    position_variance: float,
    orientation_variance: float,
    weights: FloatArray,
) -> None:
    """Write each centre's weight (A⁻¹ + S)⁻¹, with S its covariance by the pose's random error.

    Parameters
    ----------
    information : (K, ≥ 3, ≥ 3)
        A in its upper left 3×3 block, 1/mm².
    arms : (K, 3)
        From the flange to the sphere's centre, in L, mm.
    position_variance, orientation_variance : float
        Per axis, mm² and rad².
    weights : (K, 3, 3)
        Written.
    """
    own = np.empty((3, 3))
    for k in range(len(arms)):
        invert_symmetric_3(information[k], own)
        square = arms[k, 0] ** 2 + arms[k, 1] ** 2 + arms[k, 2] ** 2
        for i in range(3):
            own[i, i] += position_variance + orientation_variance * square
            for j in range(3):
                own[i, j] -= orientation_variance * arms[k, i] * arms[k, j]
        invert_symmetric_3(own, weights[k])


@njit(cache=True, nogil=True, error_model="numpy")
def invert_symmetric_3(a: FloatArray, inverse: FloatArray) -> None:
    """Write the inverse of a well-conditioned symmetric 3×3 matrix by its cofactors: nothing is allocated."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    c01 = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    c02 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    factor = 1.0 / (a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02)
    inverse[0, 0] = c00 * factor
    inverse[1, 1] = (a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2]) * factor
    inverse[2, 2] = (a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]) * factor
    inverse[0, 1] = inverse[1, 0] = c01 * factor
    inverse[0, 2] = inverse[2, 0] = c02 * factor
    inverse[1, 2] = inverse[2, 1] = (a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]) * factor
