"""The joint likelihood of all captures of a sphere, with every pose's random error integrated out.

A capture depends on the unknowns (`chain.model`) only through the sphere's centre q in its own frame L: its points
say how likely each q is, and the pose's repeatability says how far q may lie from where the unknowns predict it.
So each capture keeps its own q, which a 3×3 Schur complement (Woodbury) eliminates.  The side of a profile's
sphere (±y) needs no choice here once the start is near, and a great circle simply says nothing of y.

What captures share is unknowns with priors: the sphere's radius and the scanner's errors act on the points, pose
errors that are alike, the arm's length scale and a slow drift on where the sphere is expected.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.model import ChainState, prediction, prior
from calib_core.chain.noise import noise_of
from calib_core.chain.scanner import COUNT
from calib_core.estimation import Minimum, minimise
from calib_core.frames import FloatArray

# Far enough to travel, near enough to stay in the valley.
_NUISANCE_STEP = np.array([1.0, 0.02, 0.02, 0.02, 0.02, 1.0, 1.0, 1.0])
_SHARED_STEP = 10.0  # standard deviations


@dataclass(frozen=True, eq=False)
class ChainLinearisation:
    """The likelihood about one state.

    Attributes
    ----------
    cost, gradient, hessian
        Of the unknowns (the layout', the nuisances, the shared ones), pose errors integrated out.
    centers_in_laser : (K, 3)
        Each capture's own centre, settled, mm.
    information, vector : (K, 3 + n, 3 + n), (K, 3 + n)
        What each capture knows of its own centre and the nuisances: −½ xᵀAx + hᵀx about the present ones.
    gain, share : (K, 3, 3)
        G and N of `kernels.chain.pose_error_gain`.
    offset, jacobian : (K, 3), (K, 3, P)
        Predicted minus present centre, and the prediction's derivative by all unknowns.
    nuisances : slice
        Which of the unknowns they are.
    levers : (K, 3, A) or None
        The prediction's derivative by the readings of the axes.
    precision : (K, 3, 3)
        Of each capture's centre by its pose's own error, 1/mm².
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
    nuisances: slice
    levers: FloatArray | None
    precision: FloatArray


def linearise(
    data: ChainData, state: ChainState, spread: FloatArray, precision: FloatArray, shared: FloatArray | None = None
) -> ChainLinearisation:
    """Return the likelihood about a state, every capture's own centre settled.

    Parameters
    ----------
    data : ChainData
    state : ChainState
        Its own centres are where the settling starts.
    spread, precision, shared
        See `Noise`.
    """
    from calib_core.kernels.chain import nuisance_information, pose_error_gain, settle_centers

    count, active = data.count, data.active
    expected = prediction(data, state)
    predicted = expected.centers_in_laser
    many = 0 if shared is None else shared.shape[2]
    first, last = data.unknowns, data.unknowns + len(active)
    jacobian = np.zeros((count, 3, last + many))
    jacobian[:, :, :first] = expected.jacobian
    if shared is not None and state.shared is not None:
        jacobian[:, :, last:] = shared
        predicted = predicted + shared @ state.shared
    points, shifts = without_scanner_errors(data, state)
    constant, slopes = _anchors_at(data, state)
    own = state.centers_in_laser.copy()
    those, (radii, rays) = (points, shifts, data.counts), spheres_of(data, state)
    cost = constant + settle_centers(
        *those, data.offsets, data.weights, data.effective, rays, data.anchors,
        np.ascontiguousarray(data.anchor_information[:, :3, :3]), np.ascontiguousarray(slopes[:, :3]),
        radii, predicted, precision, own,
    )  # fmt: skip
    sharpness = data.anchor_information.copy()
    gradients = slopes + np.einsum("kij,kj->ki", sharpness[:, :, :3], own - data.anchors)
    nuisance_information(
        *those, data.points, data.basis, data.offsets, data.weights, data.effective, rays, radii, own,
        gradients, sharpness,
    )  # fmt: skip
    information, vector = _among_all(data, sharpness, gradients)
    offset = predicted - own
    gain, share = np.empty((count, 3, 3)), np.empty((count, 3, 3))
    pose_error_gain(information, spread, gain, share)
    known_cost, known_gradient, known_hessian = prior(data, state, many)
    nuisances = slice(first, last)
    hessian, gradient = normal_equations(information, vector, gain, share, offset, jacobian, nuisances)
    return ChainLinearisation(
        cost + known_cost,
        gradient + known_gradient,
        hessian + known_hessian,
        own,
        information,
        vector,
        gain,
        share,
        offset,
        jacobian,
        nuisances,
        expected.levers,
        precision,
    )


def _among_all(data: ChainData, sharpness: FloatArray, gradients: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return information and vector over centre and sought nuisances, by a capture's centre and eight."""
    kept = np.concatenate([np.arange(3), 3 + data.active])
    many = len(data.nuisance_sigmas)
    if many > COUNT:
        at = np.concatenate([np.broadcast_to(np.arange(3), (data.count, 3)), 3 + data.nuisance_of], axis=1)
        rows = np.arange(data.count)[:, None]
        wide, slopes = np.zeros((data.count, 3 + many, 3 + many)), np.zeros((data.count, 3 + many))
        wide[rows[:, :, None], at[:, :, None], at[:, None, :]] = sharpness
        slopes[rows, at] = gradients
        sharpness, gradients = wide, slopes
    return np.ascontiguousarray(sharpness[:, kept[:, None], kept]), -gradients[:, kept]


def without_scanner_errors(data: ChainData, state: ChainState) -> tuple[FloatArray, FloatArray]:
    """Return the profiles' points (M, 3) as a right scanner had given them, and their distances outside, (M,)."""
    points = data.points.copy()
    if len(state.scanner) == COUNT:
        _, scale_x, scale_z, shear, bow, *shapes = state.scanner
        outside = data.basis[:, 1:] @ np.array(shapes)
    else:
        each = np.repeat(data.own(state.scanner), np.diff(data.offsets), axis=0)
        _, scale_x, scale_z, shear, bow = each[:, :5].T
        outside = np.einsum("ij,ij->i", data.basis[:, 1:], each[:, 5:])
    points[:, 0] += scale_x * data.points[:, 0] + shear * data.points[:, 2]
    points[:, 2] += scale_z * data.points[:, 2] + bow * data.basis[:, 0]
    return points, outside


def spheres_of(data: ChainData, state: ChainState) -> tuple[FloatArray, FloatArray]:
    """Return balls' radii (K,), mm, and by how much, in x and z, one unit of measured z moves a point (K, 2)."""
    own = data.own(state.scanner)
    return data.radii_mm + own[:, 0], np.column_stack([own[:, 3], 1 + own[:, 2]])


def _anchors_at(data: ChainData, state: ChainState) -> tuple[float, FloatArray]:
    """Return the constant part of the clouds' and centres' cost, and their slope (K, 11) at their anchors."""
    own = data.own(state.scanner)
    bent = np.einsum("kij,kj->ki", data.anchor_information[:, :, 3:], own)
    cost = np.sum((data.anchor_gradient[:, 3:] + 0.5 * bent[:, 3:]) * own)
    return float(cost), data.anchor_gradient + bent


def normal_equations(
    information: FloatArray,
    vector: FloatArray,
    gain: FloatArray,
    share: FloatArray,
    offset: FloatArray,
    jacobian: FloatArray,
    nuisances: slice,
) -> tuple[FloatArray, FloatArray]:
    """Return Hessian (P, P) and gradient (P,) of all captures with their pose errors integrated out.

    With Λ = A N and η = Nᵀ h a capture's log-likelihood in the predicted centre's change e is −½ eᵀΛe + ηᵀe;
    `offset` is e at the linearisation point.  Nuisances have no pose error: their rows are A's own, less what G
    explains.  Parameters as in `ChainLinearisation`.
    """
    from calib_core.kernels.normal import weighted_rows

    reduced, rest = without_pose_errors(information, vector, gain, share)
    width = jacobian.shape[2]
    weighted, gradient = np.empty_like(jacobian), np.zeros(width)
    weighted_rows(reduced, rest, offset, jacobian, nuisances.start, weighted, gradient)
    # Nuisances have no derivative of the centre, and these rows are what it and they know of each other.
    hessian = jacobian.reshape(-1, width).T @ weighted.reshape(-1, width)
    hessian[nuisances] = hessian[:, nuisances].T
    hessian[nuisances, nuisances] = reduced[:, 3:, 3:].sum(axis=0)
    return (hessian + hessian.T) / 2, gradient


def without_pose_errors(
    information: FloatArray, vector: FloatArray, gain: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return Λ (K, m, m) and η (K, m) of each capture: see `normal_equations`."""
    from calib_core.kernels import normal

    vector = np.ascontiguousarray(vector)
    reduced, rest = np.empty_like(information), np.empty_like(vector)
    normal.without_pose_errors(information, vector, gain, share, reduced, rest)
    return reduced, rest


def retract(state: ChainState, step: FloatArray, at: ChainLinearisation) -> ChainState:
    """Return the state after a step of the unknowns, every capture's own centre following (Schur's back part)."""
    offset = at.offset + at.jacobian @ step
    slope = at.vector[:, :3] - np.einsum("kij,kj->ki", at.information[:, :3, :3], offset)
    slope = slope - at.information[:, :3, 3:] @ step[at.nuisances]
    own_step = offset + np.einsum("kij,kj->ki", at.gain, slope)
    return replace(state.moved(step), centers_in_laser=at.centers_in_laser + own_step)


def fit(data: ChainData, start: ChainState, sigmas: Sigmas) -> Minimum[ChainState, ChainLinearisation]:
    """Return the most likely unknowns for given standard deviations, from a start that is near.

    The covariance of the unknowns is the inverse of the minimum's Hessian.
    """
    noise = noise_of(data, start, sigmas)
    many = noise.shared.shape[2]
    sought = _NUISANCE_STEP[data.kinds[data.active]]
    limit = np.concatenate([data.walk.layout.step_limit(), sought, np.full(many, _SHARED_STEP)])
    begin = replace(start, shared=np.zeros(many), active=data.active)
    precision = noise.precision
    return minimise(lambda s: linearise(data, s, noise.spread, precision, noise.shared), retract, begin, limit)


def linearised_at(data: ChainData, state: ChainState, sigmas: Sigmas) -> ChainLinearisation:
    """Return the likelihood about a state, which need not be the minimum.

    Where the state has no errors that captures share, or those of other sigmas, they are zero.
    """
    noise = noise_of(data, state, sigmas)
    many = noise.shared.shape[2]
    if state.shared is None or len(state.shared) != many:
        state = replace(state, shared=np.zeros(many))
    return linearise(data, replace(state, active=data.active), noise.spread, noise.precision, noise.shared)
