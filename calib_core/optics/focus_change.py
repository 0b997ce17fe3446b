"""Whether boards were seen with the focal length of others or a told camera: a lens focused anew has another."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.frames import FloatArray
from calib_core.kernels.bundle import SHAPE_TERMS
from calib_core.optics.adjust import Adjustment, Corners, State, plane_start, shape_start, shared_vector
from calib_core.optics.camera_model import CameraModel

_LEAST_VIEWS = 4  # in each series: fewer do not tell how they scatter
_LEAST_BESIDE_TOLD = 6  # their boards' shape is found with them
_HUBER = 3.0
_SIGMAS, _LEAST_CHANGE = 4.0, 0.005  # less is chance, or no harm


@dataclass(frozen=True)
class FocusChange:
    """By what factor the focal length of boards differs from that of others, or from the told one, and its σ."""

    factor: float
    sigma: float
    is_of_told: bool = False


def is_changed(focus: FocusChange) -> bool:
    """Return whether focal lengths differ by more than chance, and so much that it does harm."""
    change = abs(focus.factor - 1.0)
    return change > max(_SIGMAS * focus.sigma, _LEAST_CHANGE)


def focus_change(
    camera: CameraModel, corners: Corners, start: State, free: np.ndarray, first: int
) -> FocusChange | None:
    """Return how the focal length of the first views differs from that of the others; None where few tell.

    One step from the camera that suits all of them, with a focal length of their own for the first: the normal
    equations of each view tell what it asks for, and how much the views differ tells how well that is known.

    Parameters
    ----------
    camera : CameraModel
        Where to begin.
    corners : Corners
        Weighed by their noise.
    start : State
        Of all views.
    free : (C,)
        Places of the camera's parameters, and the board's, that are not known.
    first : int
        How many views are of the first series.
    """
    bands, near, far = camera.bands
    free = free[free < plane_start(len(bands))]
    if min(first, corners.views - first) < _LEAST_VIEWS or not np.isin([0, 1], free).all():
        return None
    problem = Adjustment(corners, near, far, free, _HUBER)
    shared = start.shared.copy()
    shared[: plane_start(len(bands))] = shared_vector(camera.camera_matrix, bands)[: plane_start(len(bands))]
    try:
        end = problem.solve(replace(start, shared=shared))
    except np.linalg.LinAlgError:
        return None
    own = np.where(np.isin(free, [0, 1]), end.state.shared[free], 0.0)  # a factor of both focal lengths
    hessians, gradients = _of_each(problem, end.state)
    every = hessians.sum(axis=0)
    theirs = hessians[:first].sum(axis=0) @ own
    known_by_all = np.linalg.solve(every, theirs)
    known = float(own @ theirs - theirs @ known_by_all)
    if known <= 0:
        return None

    def scores(gradients: FloatArray) -> FloatArray:
        asked = -gradients @ known_by_all
        asked[:first] += gradients[:first] @ own
        return asked

    change = -float(scores(gradients).sum()) / known
    steps = np.tile(-np.linalg.solve(every, gradients.sum(axis=0)) - known_by_all * change, (corners.views, 1))
    steps[:first] += own * change
    left = scores(gradients + np.einsum("vij,vj->vi", hessians, steps))
    freedom = corners.views / (corners.views - 1)
    by_scatter = float(np.sqrt(freedom * (left**2).sum())) / known
    return FocusChange(1.0 + change, max(by_scatter, 1.0 / float(np.sqrt(known))))


def beside_told(camera: CameraModel, corners: Corners, start: State) -> FocusChange | None:
    """Return how the focal length of boards differs from a told camera's; None where few tell.

    The principal point may have moved with it, and the boards may be bent: a bend looks like another focal length.

    Parameters
    ----------
    camera : CameraModel
    corners : Corners
        Weighed by their noise, each known to be that of its place.
    start : State
    """
    bands, near, far = camera.bands
    if corners.views < _LEAST_BESIDE_TOLD:
        return None
    shape = shape_start(len(bands))
    free = np.array([0, 1, 2, 3, *range(shape, shape + SHAPE_TERMS)], dtype=np.int64)
    problem = Adjustment(corners, near, far, free, _HUBER)
    try:
        end = problem.solve(start)
        focal = np.diag(camera.camera_matrix)[:2]
        weights = np.linalg.solve(end.covariance[:2, :2] / np.outer(focal, focal), np.ones(2))
    except np.linalg.LinAlgError:
        return None
    told = np.zeros(len(free))
    told[:2] = weights / weights.sum() / focal
    _, gradients = _of_each(problem, end.state)
    freedom = corners.views / (corners.views - 1)
    by_scatter = float(np.sqrt(freedom * ((gradients @ end.covariance @ told) ** 2).sum()))
    stated = float(np.sqrt(told @ end.covariance @ told))
    return FocusChange(float(told[:2] @ end.state.shared[:2]), max(by_scatter, stated), is_of_told=True)


def _of_each(problem: Adjustment, state: State) -> tuple[FloatArray, FloatArray]:
    """Return each view's normal equations of the shared parameters, (V, C, C) and (V, C), its pose eliminated."""
    found = [
        replace(problem, corners=problem.corners.take([view])).equations(state.take([view]))
        for view in range(problem.corners.views)
    ]
    return np.array([one.hessian for one in found]), np.array([one.gradient for one in found])
