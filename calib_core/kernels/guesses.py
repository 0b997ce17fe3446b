"""Hot loop of the search for a start: each of many guesses of tool and sphere refined by robust Gauss–Newton."""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def refine_guesses(
    arm_rotations: FloatArray,
    arm_translations: FloatArray,
    measured: FloatArray,
    weight: FloatArray,
    iterations: int,
    rotations: FloatArray,
    linear: FloatArray,
    misfit: FloatArray,
) -> None:
    """Refine guesses by damped Gauss–Newton with Cauchy's loss about their own median residual.

    Parameters
    ----------
    arm_rotations, arm_translations, measured, weight : (N or 1, K, 3, 3), (N or 1, K, 3), …
        What each guess, or every one, is to agree with: see `chain/guesses.py`.
    iterations : int
    rotations, linear : (N, 3, 3), (N, 6)
        R_s; the sphere's centre in base and R_sᵀT_s, mm.  Refined.
    misfit : (N, K, 3)
        Predicted minus measured centres in L, mm.  Written.
    """
    captures = measured.shape[1]
    squared = np.empty(captures)
    rows = np.zeros((3, 9))
    normal = np.empty((9, 9))
    vector = np.empty(9)
    turned = np.empty((3, 3))
    axes = np.empty((3, 3))
    in_laser = np.empty(3)
    for n in range(len(rotations)):
        own = n if len(arm_rotations) > 1 else 0
        own_measured = n if len(measured) > 1 else 0
        own_weight = n if len(weight) > 1 else 0
        for iteration in range(iterations + 1):
            for k in range(captures):
                _axes_in_base(arm_rotations[own, k], rotations[n], axes)
                squared[k] = 0.0
                for i in range(3):
                    value = 0.0
                    for j in range(3):
                        value += axes[i, j] * (linear[n, j] - arm_translations[own, k, j])
                    misfit[n, k, i] = value - linear[n, 3 + i] - measured[own_measured, k, i]
                    squared[k] += weight[own_weight, k, i] * misfit[n, k, i] ** 2
            if iteration == iterations:
                break
            scale = max(np.median(squared), 1e-4)
            normal[:] = 0.0
            vector[:] = 0.0
            for k in range(captures):
                _axes_in_base(arm_rotations[own, k], rotations[n], axes)
                for i in range(3):
                    in_laser[i] = measured[own_measured, k, i] + misfit[n, k, i] + linear[n, 3 + i]
                _rows(in_laser, axes, rows)
                robust = 1.0 / (1.0 + squared[k] / (6.0 * scale))
                for i in range(3):
                    counts = weight[own_weight, k, i] * robust
                    for p in range(9):
                        along = counts * rows[i, p]
                        vector[p] += along * misfit[n, k, i]
                        for q in range(p + 1):
                            normal[p, q] += along * rows[i, q]
            _step(normal, vector)
            length = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
            shortened = min(1.0, 0.5 / max(length, 1e-12))
            for p in range(9):
                vector[p] *= -shortened
            _turn(rotations[n], vector, turned)
            for p in range(6):
                linear[n, p] += vector[3 + p]


@njit(cache=True, nogil=True, error_model="numpy")
def _axes_in_base(arm: FloatArray, scanner: FloatArray, axes: FloatArray) -> None:
    """Write the axes of L in base as rows: (R_arm R_s)ᵀ."""
    for i in range(3):
        for j in range(3):
            axes[i, j] = arm[j, 0] * scanner[0, i] + arm[j, 1] * scanner[1, i] + arm[j, 2] * scanner[2, i]


@njit(cache=True, nogil=True, error_model="numpy")
def _rows(in_laser: FloatArray, axes: FloatArray, rows: FloatArray) -> None:
    """Write the derivatives of a predicted centre by rotation, centre in base and R_sᵀT_s."""
    x, y, z = in_laser[0], in_laser[1], in_laser[2]
    rows[0, 1], rows[0, 2] = -z, y
    rows[1, 0], rows[1, 2] = z, -x
    rows[2, 0], rows[2, 1] = -y, x
    for i in range(3):
        for j in range(3):
            rows[i, 3 + j] = axes[i, j]
        rows[i, 6 + i] = -1.0


@njit(cache=True, nogil=True, error_model="numpy")
def _step(normal: FloatArray, vector: FloatArray) -> None:
    """Solve the damped equations by Cholesky; `normal` (its lower half) and `vector` are overwritten."""
    largest = 0.0
    for p in range(9):
        largest = max(largest, normal[p, p])
    for p in range(9):
        normal[p, p] += 1e-5 * normal[p, p] + 1e-9 * largest
    for p in range(9):
        for q in range(p + 1):
            value = normal[p, q]
            for r in range(q):
                value -= normal[p, r] * normal[q, r]
            normal[p, q] = value / normal[q, q] if q < p else np.sqrt(max(value, 1e-300))
    for p in range(9):
        for q in range(p):
            vector[p] -= normal[p, q] * vector[q]
        vector[p] /= normal[p, p]
    for p in range(8, -1, -1):
        for q in range(p + 1, 9):
            vector[p] -= normal[q, p] * vector[q]
        vector[p] /= normal[p, p]


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(rotation: FloatArray, vector: FloatArray, turned: FloatArray) -> None:
    """Turn a rotation about its own axes by a rotation vector (Rodrigues)."""
    angle = np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if angle < 1e-12:
        return
    x, y, z = vector[0] / angle, vector[1] / angle, vector[2] / angle
    cosine, sine = np.cos(angle), np.sin(angle)
    rest = 1.0 - cosine
    by = (
        (cosine + x * x * rest, x * y * rest - z * sine, x * z * rest + y * sine),
        (y * x * rest + z * sine, cosine + y * y * rest, y * z * rest - x * sine),
        (z * x * rest - y * sine, z * y * rest + x * sine, cosine + z * z * rest),
    )
    for i in range(3):
        for j in range(3):
            turned[i, j] = rotation[i, 0] * by[0][j] + rotation[i, 1] * by[1][j] + rotation[i, 2] * by[2][j]
    for i in range(3):
        for j in range(3):
            rotation[i, j] = turned[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def guess_costs(guesses: FloatArray, places: FloatArray, scale_mm: float, costs: FloatArray) -> None:
    """Write the robust cost (N,) of guesses (N, D): Σ log(1 + (d / scale)²), d to the nearer side of each capture.

    Parameters
    ----------
    guesses, places : (N, D), (K, 2, D)
        mm.
    scale_mm : float
    costs : (N,)
    """
    for n in range(len(guesses)):
        cost, product = 0.0, 1.0
        for k in range(len(places)):
            nearest = np.inf
            for side in range(2):
                squared = 0.0
                for d in range(guesses.shape[1]):
                    squared += (guesses[n, d] - places[k, side, d]) ** 2
                nearest = min(nearest, squared)
            product *= 1.0 + nearest / scale_mm**2
            if product > 1e200:  # one logarithm for many captures
                cost += np.log(product)
                product = 1.0
        costs[n] = cost + np.log(product)
