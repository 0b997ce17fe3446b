"""The joint likelihood of all captures of a sphere, with every pose's random error integrated out.

A capture depends on the unknowns (`chain.model`) only through the sphere's centre q in its own frame L: its points
say how likely each q is, and the pose's repeatability says how far q may lie from where the unknowns predict it.
So each capture keeps its own q, which a 3×3 Schur complement (Woodbury) eliminates.  The side of a profile's
sphere (±y) needs no choice here once the start is near, and a great circle simply says nothing of y.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.model import ChainData, ChainState, Sigmas, prediction, prior
from calib_core.estimation import Minimum, minimise
from calib_core.frames import FloatArray

_STEP_LIMIT = np.array(
    [0.1] * 3 + [20.0] * 6
)  # rad and mm: far enough to travel, near enough to stay in the valley
_LEAST_SIGMA_MM = 1e-4  # keeps the prior of a capture's own centre invertible


@dataclass(frozen=True, eq=False)
class ChainLinearisation:
    """The likelihood about one state.

    Attributes
    ----------
    cost, gradient, hessian
        Of the unknowns (9, the table's, the radius), pose errors integrated out.
    centers_in_laser : (K, 3)
        Each capture's own centre, settled, mm.
    information, vector : (K, m, m), (K, m)
        What each capture knows of its own (centre[, radius]): −½ xᵀAx + hᵀx about the present one.
    gain, share : (K, 3, 3)
        G and N of `kernels.chain.pose_error_gain`.
    offset, jacobian : (K, 3), (K, 3, P)
        Predicted minus present centre, and the prediction's derivative.
    levers : (K, 3) or None
        The prediction's derivative by the table's angle.
    """

    cost: float
    gradient: FloatArray
    hessian: FloatArray
    centers_in_laser: FloatArray
    information: FloatArray
    vector: FloatArray
    gain: FloatArray
    share: FloatArray
    offset: FloatArray
    jacobian: FloatArray
    levers: FloatArray | None


def pose_spread(
    predicted: FloatArray, tool_in_laser: FloatArray, sigmas: Sigmas, levers: FloatArray | None = None
) -> FloatArray:
    """Return the covariance (K, 3, 3), mm², of the sphere's centre in L by random errors of robot and table.

    A position error moves it by itself; an orientation error ω about the flange by ω × p, with p the arm from the
    flange to the centre; an error of the table's angle by its lever: a term of rank one.

    Parameters
    ----------
    predicted : (K, 3)
        The sphere's centre in L, mm.
    tool_in_laser : (3,)
        R_sᵀ T_s: the arm from the flange to the origin of L, in L, mm.
    sigmas : Sigmas
    levers : (K, 3), optional
        How the centre moves with the table's angle, mm/rad.
    """
    arms = predicted + tool_in_laser
    turning = np.einsum("ki,ki->k", arms, arms)[:, None, None] * np.eye(3) - arms[:, :, None] * arms[:, None, :]
    position = max(sigmas.position_mm, _LEAST_SIGMA_MM)
    spread = position**2 * np.eye(3) + sigmas.orientation_rad**2 * turning
    if levers is not None and sigmas.angle_rad > 0:
        spread += sigmas.angle_rad**2 * levers[:, :, None] * levers[:, None, :]
    return spread


def linearise(data: ChainData, state: ChainState, spread: FloatArray, precision: FloatArray) -> ChainLinearisation:
    """Return the likelihood about a state, every capture's own centre settled.

    Parameters
    ----------
    data : ChainData
    state : ChainState
        Its own centres are where the settling starts.
    spread, precision : (K, 3, 3)
        Covariance of each capture's centre by its pose error, mm², and its inverse.
    """
    from calib_core.kernels.chain import (
        marginal_normal_equations,
        pose_error_gain,
        settle_centers,
    )

    count, size = data.count, 4 if data.free_radius else 3
    expected = prediction(data, state)
    predicted, jacobian = expected.centers_in_laser, expected.jacobian
    own, slopes, sharpness = state.centers_in_laser.copy(), np.empty((count, 4)), np.empty((count, 4, 4))
    anchors = data.anchors, data.anchor_information, data.anchor_gradient
    cost = settle_centers(
        data.points, data.offsets, data.weights, *anchors, data.radius_mm, state.radius_mm,
        predicted, precision, own, slopes, sharpness,
    )  # fmt: skip
    information = np.ascontiguousarray(sharpness[:, :size, :size])
    vector = np.ascontiguousarray(-slopes[:, :size])
    offset = predicted - own
    gain, share = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    pose_error_gain(information, spread, gain, share)
    width = data.unknowns + size - 3
    hessian, gradient = np.empty((width, width)), np.empty(width)
    marginal_normal_equations(information, vector, gain, share, offset, jacobian, hessian, gradient)
    known_cost, known_gradient, known_hessian = prior(data, state)
    hessian += known_hessian
    gradient += known_gradient
    return ChainLinearisation(
        cost + known_cost,
        gradient,
        hessian,
        own,
        information,
        vector,
        gain,
        share,
        offset,
        jacobian,
        expected.levers,
    )


def retract(state: ChainState, step: FloatArray, at: ChainLinearisation) -> ChainState:
    """Return the state after a step of the unknowns, every capture's own centre following (Schur's back part)."""
    width = at.jacobian.shape[2]
    offset = at.offset + at.jacobian @ step[:width]
    slope = at.vector[:, :3] - np.einsum("kij,kj->ki", at.information[:, :3, :3], offset)
    if len(step) > width:
        slope = slope - at.information[:, :3, 3] * step[width]
    own_step = offset + np.einsum("kij,kj->ki", at.gain, slope)
    return replace(state.moved(step), centers_in_laser=at.centers_in_laser + own_step)


def fit(data: ChainData, start: ChainState, sigmas: Sigmas) -> Minimum[ChainState, ChainLinearisation]:
    """Return the most likely unknowns for given standard deviations, from a start that is near.

    The covariance of the unknowns is the inverse of the minimum's Hessian.
    """
    spread, precision = _noise(data, start, sigmas)
    limit = _STEP_LIMIT if data.table is None else np.concatenate([_STEP_LIMIT, data.table.step_limit()])
    limit = np.append(limit, 1.0) if data.free_radius else limit
    return minimise(lambda s: linearise(data, s, spread, precision), retract, start, limit)


def linearised_at(data: ChainData, state: ChainState, sigmas: Sigmas) -> ChainLinearisation:
    """Return the likelihood about a state, which need not be the minimum."""
    return linearise(data, state, *_noise(data, state, sigmas))


@dataclass(frozen=True, eq=False)
class OwnEquations:
    """What each capture adds to the normal equations at a linearisation, its pose error integrated out.

    Attributes
    ----------
    rows : (K, m, P')
        Of the predicted centre (and the radius, where m = 4) by the unknowns.
    reduced : (K, m, m)
        Information on the predicted centre.
    hessians, gradients : (K, P', P'), (K, P')
    """

    rows: FloatArray
    reduced: FloatArray
    hessians: FloatArray
    gradients: FloatArray


def own_equations(at: ChainLinearisation) -> OwnEquations:
    """Return each capture's own part of the normal equations."""
    from calib_core.kernels.chain import without_pose_error

    size = at.information.shape[1]
    reduced, rest = np.empty_like(at.information), np.empty_like(at.vector)
    for k in range(len(rest)):
        without_pose_error(at.information[k], at.vector[k], at.gain[k], at.share[k], reduced[k], rest[k])
    rest -= np.einsum("kij,kj->ki", reduced[:, :, :3], at.offset)
    rows = at.jacobian
    if size == 4:
        rows = np.zeros((len(rows), 4, at.jacobian.shape[2] + 1))
        rows[:, :3, :-1] = at.jacobian
        rows[:, 3, -1] = 1.0
    hessians = np.swapaxes(rows, 1, 2) @ reduced @ rows
    return OwnEquations(rows, reduced, hessians, -np.einsum("kip,ki->kp", rows, rest))


def _noise(data: ChainData, state: ChainState, sigmas: Sigmas) -> tuple[FloatArray, FloatArray]:
    """Return the covariance of each capture's centre by the errors of robot and table, and its inverse."""
    levers = None if data.table is None else prediction(data, state).levers
    spread = pose_spread(state.centers_in_laser, state.tool_in_laser, sigmas, levers)
    return spread, np.asarray(np.linalg.inv(spread), dtype=float)
