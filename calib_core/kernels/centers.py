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

    Residuals are R_sᵀ (R_0ᵀ (c − T_0) − T_s) − X in L; the unknowns are the rotation of the mount (on the
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


@njit(cache=True, nogil=True, error_model="numpy")
def approach_centers(
    rotations: FloatArray,
    translations: FloatArray,
    weights: FloatArray,
    measured: FloatArray,
    tool_rotation: FloatArray,
    tool_translation: FloatArray,
    center: FloatArray,
    step_limit: FloatArray,
    tolerance: float,
) -> bool:
    """Take Gauss–Newton's full steps while they lower the cost; return whether they ended at a minimum.

    The last step is smaller than `tolerance` in half squared standard deviations; it is taken unchecked.

    Parameters
    ----------
    rotations, translations, weights, measured
        See `center_normal_equations`.
    tool_rotation, tool_translation, center : (3, 3), (3,), (3,)
        Changed in place.
    step_limit : (9,)
        A step beyond it is no job for full steps: ends unfinished.
    """
    hessian = np.empty((9, 9))
    gradient = np.empty(9)
    before = np.inf
    for _ in range(20):
        cost = center_normal_equations(
            rotations, translations, weights, measured, tool_rotation, tool_translation, center, hessian, gradient
        )
        if not cost <= before:
            return False
        before = cost
        step = np.linalg.solve(hessian, -gradient)
        predicted = 0.0
        for p in range(9):
            if not abs(step[p]) < step_limit[p]:
                return False
            predicted -= step[p] * gradient[p]
        turn(tool_rotation, step[0], step[1], step[2])
        for p in range(3):
            tool_translation[p] += step[3 + p]
            center[p] += step[6 + p]
        if predicted < tolerance:
            return True
    return False


@njit(cache=True, nogil=True, error_model="numpy")
def turn(rotation: FloatArray, x: float, y: float, z: float) -> None:
    """Multiply a rotation on the right by that of a vector (rad), by its unit quaternion."""
    angle = np.sqrt(x * x + y * y + z * z)
    s = 0.5 * np.sinc(0.5 * angle / np.pi)
    w, i, j, k = np.cos(0.5 * angle), x * s, y * s, z * s
    b00, b01, b02 = 1 - 2 * (j * j + k * k), 2 * (i * j - k * w), 2 * (i * k + j * w)
    b10, b11, b12 = 2 * (i * j + k * w), 1 - 2 * (i * i + k * k), 2 * (j * k - i * w)
    b20, b21, b22 = 2 * (i * k - j * w), 2 * (j * k + i * w), 1 - 2 * (i * i + j * j)
    for row in range(3):
        a0, a1, a2 = rotation[row, 0], rotation[row, 1], rotation[row, 2]
        rotation[row, 0] = a0 * b00 + a1 * b10 + a2 * b20
        rotation[row, 1] = a0 * b01 + a1 * b11 + a2 * b21
        rotation[row, 2] = a0 * b02 + a1 * b12 + a2 * b22
