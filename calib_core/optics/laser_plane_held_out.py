"""Whether the stripes make the camera better or worse, by corners of boards that had no part in finding it."""

from dataclasses import replace

import numpy as np

from calib_core.frames import FloatArray
from calib_core.optics.adjust import Adjusted, Adjustment, State, fit_poses, plane_start

_FOLDS = 3
_LEAST_BOARDS = 6  # of fewer, a fold leaves too few to find a camera by
_LEAST_WORSE = 0.01  # of the mean squared error: less is chance
_WORSE_SIGMAS = 1.0  # of the boards' mean: a doubt is enough to leave the camera to its corners


def stripes_worsen_corners(problem: Adjustment, adjusted: Adjusted) -> float | None:
    """Return by what share the stripes raise held-out corners' mean squared error, None where they do not.

    In each fold camera, boards and plane are fitted to the other boards, once with their stripes and once by their
    corners alone; the left-out boards' corners are judged by both cameras, their poses alone fitted to them.

    Parameters
    ----------
    problem : Adjustment
        Of all boards, weighted, camera and plane free.
    adjusted : Adjusted
        Its solution, where the folds begin.
    """
    first = plane_start(len(problem.band_nears))
    camera = problem.free[problem.free < first]
    seen = np.flatnonzero(_counted(problem) > 0)
    if len(seen) < _LEAST_BOARDS or not len(camera):
        return None
    order = seen[np.argsort(adjusted.state.translations[seen, 2], kind="stable")]
    squares: list[FloatArray] = []
    for fold in range(_FOLDS):
        out = np.sort(order[fold::_FOLDS])
        kept = np.setdiff1d(np.arange(problem.corners.views), out)
        together = _of_views(problem, kept)
        lines = together.lines
        if lines is None or np.count_nonzero(np.diff(lines.ends)) < 2:
            return None  # the boards left do not fix a plane
        apart = replace(together, free=camera, lines=None)
        start = adjusted.state.take(kept)
        try:
            ends = [together.solve(start, 1e-4), apart.solve(start, 1e-4)]
        except np.linalg.LinAlgError:
            return None
        squares.append(np.column_stack([_errors_of(problem, adjusted.state, end, out) for end in ends]))
    both = np.concatenate(squares)
    growth = np.log(both[:, 0] / both[:, 1])
    mean, deviation = float(growth.mean()), float(growth.std(ddof=1) / np.sqrt(len(growth)))
    total = float(both[:, 0].mean() / both[:, 1].mean() - 1)
    return total if total > _LEAST_WORSE and mean > _WORSE_SIGMAS * deviation else None


def _counted(problem: Adjustment) -> FloatArray:
    """Return how many corners of each view count, (V,): those that only stand for a robot's pose do not."""
    weights = problem.corners.weights
    usual = float(np.median(weights[weights > 0])) if np.any(weights > 0) else 1.0
    return np.add.reduceat((weights > 1e-2 * usual).astype(float), problem.corners.ends[:-1])


def _of_views(problem: Adjustment, views: np.ndarray) -> Adjustment:
    assert problem.lines is not None
    return replace(problem, corners=problem.corners.take(views), lines=problem.lines.take(views))


def _errors_of(problem: Adjustment, state: State, end: Adjusted, out: np.ndarray) -> FloatArray:
    """Return the mean squared error (O,), px², of the corners of views that were left out."""
    corners = problem.corners.take(out)
    there = state.take(out)
    begin = State(end.state.shared, there.rotations, there.translations)
    bands = problem.band_nears, problem.band_fars
    residuals = fit_poses(corners, begin, bands, problem.huber).corner_residuals
    counts = corners.weights > 0
    squares = np.minimum((residuals**2).sum(axis=1), (6 / np.maximum(corners.weights, 1e-9)) ** 2) * counts
    return np.add.reduceat(squares, corners.ends[:-1]) / np.maximum(
        np.add.reduceat(counts.astype(float), corners.ends[:-1]), 1
    )
