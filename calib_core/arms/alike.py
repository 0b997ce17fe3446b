"""Pose errors that are alike where poses are alike: gears, links and joints err smoothly over the arm's space.

Their covariance between two poses is exp(−½ d²), d² = (|Δposition| / reach)² + (angle / reach)².  It is never
formed as a whole: a pivoted Cholesky factor of a few columns holds what matters, at a cost that grows with the
number of captures alone, and what it leaves out is each capture's own.
"""

import numpy as np

from calib_core.frames import FloatArray

REACH_MM = 400.0
REACH_RAD = 0.5
"""Over which distances errors of arms were found to be alike: 200–800 mm and 0.3–0.7 rad."""

MOST_COLUMNS = 20
_NEGLIGIBLE = 0.003  # of the variance


def alike_factor(rotations: FloatArray, translations: FloatArray, reach: float = 1.0) -> FloatArray:
    """Return a factor F (K, m) with F Fᵀ the correlation of K poses' errors, but for what F leaves out.

    Parameters
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0, mm.
    reach : float
        A factor on `REACH_MM` and `REACH_RAD`.
    """
    return alike_factors((rotations, translations), None, reach)[0]


Poses = tuple[FloatArray, FloatArray]
"""Rotations (K, 3, 3) and translations (K, 3), mm, of base_from_tool0."""


def alike_factors(poses: Poses, others: Poses | None, reach: float) -> tuple[FloatArray, FloatArray]:
    """Return the factor of some poses, and beside it the rows (N, m) of others that are added one at a time.

    An added pose's error is the row times what the columns stand for, and a rest of its own: 1 − |row|².
    """
    from calib_core.kernels.alike import pivoted_factor

    features = _features(poses, reach)
    count = len(features)
    most = min(count, MOST_COLUMNS)
    factor, pivots = np.zeros((count, most)), np.zeros(most, dtype=np.int64)
    columns = pivoted_factor(features, pivots, most, _NEGLIGIBLE, factor) if count else 0
    factor, pivots = factor[:, :columns], pivots[:columns]
    if others is None or columns == 0:
        return factor, np.zeros((0 if others is None else len(others[0]), columns))
    apart = _features(others, reach)[:, None] - features[pivots]
    correlation = np.exp(-0.5 * np.sum(apart**2, axis=2))
    return factor, np.linalg.solve(factor[pivots], correlation.T).T


def alike_pivots(rotations: FloatArray, translations: FloatArray, reach: float = 1.0) -> np.ndarray:
    """Return which of K poses, (m,), stand for all in `alike_factor`: one a column, the most telling first."""
    from calib_core.kernels.alike import pivoted_factor

    features = _features((rotations, translations), reach)
    most = min(len(features), MOST_COLUMNS)
    factor, pivots = np.zeros((len(features), most)), np.zeros(most, dtype=np.int64)
    return pivots[: pivoted_factor(features, pivots, most, _NEGLIGIBLE, factor)]


def alike_correlation(poses: Poses, reach: float, others: Poses | None = None) -> FloatArray:
    """Return the correlation (N, m) of errors at N other poses, or at the same, with those at m poses."""
    places = _features(poses, reach)
    at = places if others is None else _features(others, reach)
    return np.exp(-0.5 * np.sum((at[:, None] - places) ** 2, axis=2))


def alike_weights(poses: Poses, others: Poses, reach: float) -> FloatArray:
    """Return by which weights (N, m) the errors at m poses give those at N others, as far as they are alike."""
    weights = np.linalg.solve(alike_correlation(poses, reach), alike_correlation(poses, reach, others).T)
    return np.ascontiguousarray(weights.T, dtype=float)


def _features(poses: Poses, reach: float) -> FloatArray:
    rotations, translations = poses
    # The distance of two rotation matrices as vectors is √2 · 2 sin(angle / 2).
    turned = rotations.reshape(-1, 9) / (np.sqrt(2) * REACH_RAD * reach)
    return np.ascontiguousarray(np.hstack([turned, translations / (REACH_MM * reach)]))


def visits(rotations: FloatArray, translations: FloatArray) -> FloatArray:
    """Return how many of K captures were taken in each one's pose, (K,): they share its error."""
    count = len(rotations)
    numbers = np.hstack([np.round(rotations.reshape(count, 9), 5), np.round(translations, 2)])
    _, member, many = np.unique(numbers, axis=0, return_inverse=True, return_counts=True)
    return many[member.ravel()].astype(float)
