"""Hot loops of the chain's normal equations: a solve makes them thousands of times, for other sigmas each."""

import numpy as np
from numba import njit

from calib_core.frames import FloatArray


@njit(cache=True, nogil=True, error_model="numpy")
def without_pose_errors(
    information: FloatArray,
    vector: FloatArray,
    gain: FloatArray,
    share: FloatArray,
    reduced: FloatArray,
    rest: FloatArray,
) -> None:
    """Write Λ (K, m, m) and η (K, m) of each capture, m ≥ 3: see `chain.likelihood.normal_equations`.

    Parameters
    ----------
    information, vector, gain, share : (K, m, m), (K, m), (K, 3, 3), (K, 3, 3)
        See `chain.likelihood.ChainLinearisation`.
    reduced, rest : (K, m, m), (K, m)
        Written.
    """
    m = vector.shape[1]
    explained = np.empty((m, 3))
    for k in range(len(vector)):
        a, s, g, out = information[k], share[k], gain[k], reduced[k]
        for i in range(3):
            for j in range(3):
                out[i, j] = a[i, 0] * s[0, j] + a[i, 1] * s[1, j] + a[i, 2] * s[2, j]
        for i in range(3):
            for j in range(i):  # rounding alone makes A N unsymmetric
                out[i, j] = out[j, i] = (out[i, j] + out[j, i]) / 2
            for j in range(3, m):
                out[i, j] = s[0, i] * a[0, j] + s[1, i] * a[1, j] + s[2, i] * a[2, j]
                out[j, i] = out[i, j]
            rest[k, i] = s[0, i] * vector[k, 0] + s[1, i] * vector[k, 1] + s[2, i] * vector[k, 2]
        for i in range(3, m):
            rest[k, i] = vector[k, i]
            for j in range(3):
                explained[i, j] = a[i, 0] * g[0, j] + a[i, 1] * g[1, j] + a[i, 2] * g[2, j]
                rest[k, i] -= explained[i, j] * vector[k, j]
            for j in range(3, m):
                out[i, j] = a[i, j]
                for n in range(3):
                    out[i, j] -= explained[i, n] * a[n, j]


@njit(cache=True, nogil=True, error_model="numpy")
def weighted_rows(
    reduced: FloatArray,
    rest: FloatArray,
    offset: FloatArray,
    jacobian: FloatArray,
    first: int,
    weighted: FloatArray,
    gradient: FloatArray,
) -> None:
    """Write Λ times each capture's rows, which with the rows themselves make the Hessian; add to the gradient.

    A capture's rows are its centre's derivatives by all unknowns and, of each nuisance, the one at the nuisance.

    Parameters
    ----------
    reduced, rest : (K, m, m), (K, m)
        Λ and η.
    offset, jacobian : (K, 3), (K, 3, P)
        See `chain.likelihood.ChainLinearisation`.
    first : int
        Where the m − 3 nuisances begin among the unknowns.
    weighted : (K, 3, P)
        Written: of the centre alone.
    gradient : (P,)
        Added to.
    """
    m, width = rest.shape[1], jacobian.shape[2]
    for k in range(len(rest)):
        told, rows, out = reduced[k], jacobian[k], weighted[k]
        for i in range(3):
            pull = rest[k, i]
            for j in range(3):
                pull -= told[i, j] * offset[k, j]
            for p in range(width):
                out[i, p] = told[i, 0] * rows[0, p] + told[i, 1] * rows[1, p] + told[i, 2] * rows[2, p]
                gradient[p] -= rows[i, p] * pull
            for j in range(3, m):
                out[i, first + j - 3] += told[i, j]
        for j in range(3, m):
            pull = rest[k, j]
            for i in range(3):
                pull -= told[j, i] * offset[k, i]
            gradient[first + j - 3] -= pull
