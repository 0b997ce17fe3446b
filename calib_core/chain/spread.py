"""Which captures of a long session are searched, so that a search does not grow with the session's square.

A search looks for the place on which most captures agree, among their own places.  In a long session few of them
propose places first; then, where it matters, the ones nearest to the middle of all are tried against all: the best
of all is among these, so that nothing but time is lost.
"""

import numpy as np

from calib_core.frames import FloatArray

SEARCHED_OF_A_MOUNTING = 60
"""More captures of one mounting do not make a search safer, only slower."""

TRIALS_BY_ALL = 12
"""So many of the best trials all captures of a long session are asked about."""

AGREE_MM = 1.0
"""Scale of the robust loss: about the worst that a first TCP leaves."""

_STEPS_TO_THE_MIDDLE = 12
_SECTOR_RAD = np.deg2rad(10.0)
_DIRECTION_RAD = np.deg2rad(1.0)


def spread_captures(mounts: np.ndarray, angles_rad: FloatArray) -> np.ndarray:
    """Return the captures to search (ascending): few of each mounting, from all around the table.

    Mountings with no more captures than are searched keep them all.  Of others every sector gives one capture
    before any gives a second, and other directions in it before the same again, so that rare ones are not lost;
    which one is random, with a fixed seed: captures taken in a rhythm (two rounds, the sphere moved between them)
    are never all of one kind.

    Parameters
    ----------
    mounts : (K,) int
        Below 0: captures that are not of the table, never searched.
    angles_rad : (K,)
    """
    turned = np.mod(angles_rad, 2 * np.pi)
    sectors, directions = np.floor(turned / _SECTOR_RAD), np.floor(turned / _DIRECTION_RAD)
    few: list[np.ndarray] = []
    for mount in np.unique(mounts[mounts >= 0]):
        own = np.flatnonzero(mounts == mount)
        if len(own) > SEARCHED_OF_A_MOUNTING:
            own = np.random.default_rng(len(own)).permutation(own)
            for kind in (directions, sectors):
                own = own[np.argsort(_occurrence(kind[own]), kind="stable")]
            own = own[:SEARCHED_OF_A_MOUNTING]
        few.append(own)
    return np.sort(np.concatenate(few))


def spread_over(count: int) -> np.ndarray:
    """Return as many of so many captures as are searched, spread over them."""
    return np.unique(np.linspace(0, count - 1, min(count, SEARCHED_OF_A_MOUNTING)).astype(int))


def nearest_side(guesses: FloatArray, places: FloatArray) -> FloatArray:
    """Return the distances (N, K) of N guesses (N, D) from the nearer side of K captures (K, 2, D)."""
    return np.linalg.norm(guesses[:, None, None] - places[None], axis=3).min(axis=2)


def most_agreed(places: FloatArray, few: np.ndarray, exact: bool) -> FloatArray:
    """Return that place of a mounting's captures on which most of them agree.

    Parameters
    ----------
    places : (K, 2, D)
        On either side, mm.
    few : (K,) bool
        Those searched; where that is all, the place is the best one.
    exact : bool
        Whether all captures propose and judge, not these alone.
    """
    own = places[few]
    if not exact or few.all():
        return _best_of(own.reshape(-1, places.shape[2]), own)
    middle = _best_of(own.reshape(-1, places.shape[2]), places)
    for _ in range(_STEPS_TO_THE_MIDDLE):
        squared = ((places - middle) ** 2).sum(axis=2)
        nearer = np.argmin(squared, axis=1)
        rows = np.arange(len(places))
        weight = 1 / (1 + squared[rows, nearer] / AGREE_MM**2)
        middle = weight @ places[rows, nearer] / weight.sum()
    guesses = places.reshape(-1, places.shape[2])
    near = np.argsort(np.linalg.norm(guesses - middle, axis=1), kind="stable")[:SEARCHED_OF_A_MOUNTING]
    return _best_of(guesses[np.sort(near)], places)


def robust_costs(distances_mm: FloatArray) -> FloatArray:
    """Return the robust cost of captures (…, K) that lie so far off."""
    return np.asarray(np.sum(np.log1p((distances_mm / AGREE_MM) ** 2), axis=-1))


def _best_of(guesses: FloatArray, places: FloatArray) -> FloatArray:
    from calib_core.kernels.guesses import guess_costs

    costs = np.empty(len(guesses))
    guess_costs(np.ascontiguousarray(guesses), np.ascontiguousarray(places), AGREE_MM, costs)
    return guesses[int(np.argmin(costs))]


def _occurrence(values: np.ndarray) -> np.ndarray:
    """Return for each value how many equal ones are before it."""
    order = np.argsort(values, kind="stable")
    _, first, counts = np.unique(values[order], return_index=True, return_counts=True)
    occurrence = np.empty(len(values), dtype=int)
    occurrence[order] = np.arange(len(values)) - np.repeat(first, counts)
    return occurrence
