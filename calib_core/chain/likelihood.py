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

from calib_core.arms.alike import alike_factor
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.model import ChainState, prediction, prior
from calib_core.chain.scanner import COUNT
from calib_core.estimation import Minimum, minimise
from calib_core.frames import FloatArray

# Far enough to travel, near enough to stay in the valley.
_NUISANCE_STEP = np.array([1.0, 0.02, 0.02, 0.02, 0.02, 1.0, 1.0, 1.0])
_SHARED_STEP = 10.0  # standard deviations
_LEAST_SIGMA_MM = 1e-4  # keeps the prior of a capture's own centre invertible


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


@dataclass(frozen=True, eq=False)
class Noise:
    """What the errors of robot and table do to each capture's centre in L.

    Attributes
    ----------
    spread : (K, 3, 3)
        Covariance by what is each capture's own, mm².
    shared : (K, 3, L)
        How it moves with one standard deviation of each error that captures share, mm.
    """

    spread: FloatArray
    shared: FloatArray

    @property
    def precision(self) -> FloatArray:
        """The spread's inverse, (K, 3, 3)."""
        return np.asarray(np.linalg.inv(self.spread), dtype=float)


def pose_spread(levers: FloatArray, sigmas: Sigmas) -> FloatArray:
    """Return the covariance (K, 3, 3), mm², of the sphere's centre in L by random errors of the robot.

    A position error moves it by itself; an orientation error ω about the flange by ω × p, with p the lever from
    the flange to the centre.

    Parameters
    ----------
    levers : (K, 3)
        From the flange to the sphere's centre, in L, mm.
    sigmas : Sigmas
    """
    moved = _spread(np.broadcast_to(np.eye(3), (len(levers), 3, 3)), sigmas.position_mm)
    return moved + sigmas.orientation_rad**2 * _turning(levers[:, :, None] * levers[:, None, :])


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


def noise_of(data: ChainData, state: ChainState, sigmas: Sigmas) -> Noise:
    """Return what errors of robot and table do to each capture's centre, as a state sees it."""
    levers = prediction(data, state).levers if data.walk.layout.axes else None
    factor = np.empty((data.count, 0))
    if sigmas.is_alike:
        factor = alike_factor(*data.walk.poses, sigmas.reach)
    middle = data.walk.translations.mean(axis=0)
    return NoiseShapes.at(data, state.centers_in_laser, state, levers, middle).noise(sigmas, factor)


@dataclass(frozen=True, eq=False)
class NoiseShapes:
    """What errors of robot and table of unit size do to each capture's centre: many sigmas are tried at one state.

    Attributes
    ----------
    moving, turning, axes : (K, 3, 3), (K, 3, 3), (A, K, 3, 3)
        Covariance by a position's error, by an orientation's about any axis, and by each axis's reading.
    stops : (K, c)
        1 where a capture is of a stop of the robot that several share, whose own error is theirs together.
    scale : (K, 1, 1)
        By how much a capture's own pose variance is larger.
    moves : (K, 3, 6)
        By a shift of the flange along base's axes, and by its turn about them.
    drawn : (K, 3, c)
        By one standard deviation each of the arm's lengths and the drift.
    arm : (K, 3, p)
        The same of the arm's own terms.
    """

    moving: FloatArray
    turning: FloatArray
    axes: FloatArray
    scale: FloatArray
    stops: FloatArray
    moves: FloatArray
    drawn: FloatArray
    arm: FloatArray

    @classmethod
    def at(
        cls,
        data: ChainData,
        centers_in_laser: FloatArray,
        state: ChainState,
        levers: FloatArray | None,
        middle: FloatArray,
    ) -> "NoiseShapes":
        """Return those of captures whose spheres are seen at (K, 3), by a state's tool."""
        walk = data.walk
        laser_from_base = walk.laser_from_base(state.position)
        drawn = [np.empty((data.count, 3, 0))]
        if data.arm_scale_sigma > 0:
            from_middle = walk.translations - middle
            drawn.append(laser_from_base @ from_middle[:, :, None] * data.arm_scale_sigma)
        if data.drift_sigma_mm > 0:
            drawn.append(laser_from_base * (data.order * data.drift_sigma_mm)[:, None, None])
        arms, untold = data.levers(state.position, centers_in_laser)
        by_axis = np.empty((0, data.count, 3)) if levers is None else np.moveaxis(levers, 2, 0)
        return cls(
            moving=np.abs(walk.over_robot)[:, None, None] * np.eye(3),
            turning=_turning(arms[:, :, None] * arms[:, None, :] + untold),
            axes=by_axis[:, :, :, None] * by_axis[:, :, None, :],
            scale=data.pose_scale[:, None, None],
            stops=(data.stop[:, None] == np.arange(data.stops)).astype(float),
            moves=walk.moves(laser_from_base, arms),
            drawn=np.concatenate(drawn, axis=2),
            arm=np.empty((data.count, 3, 0)) if data.arm_columns is None else data.arm_columns,
        )

    def noise(self, sigmas: Sigmas, factor: FloatArray) -> Noise:
        """Return the noise of some sigmas, with a factor (K, m) of the alike part."""
        spread = self._by_pose(sigmas.position_mm, sigmas.orientation_rad)
        together = [self.drawn]
        if self.stops.size:
            spread[self.stops.any(axis=1)] = _LEAST_SIGMA_MM**2 * np.eye(3)
            moved = self._drawn(sigmas.position_mm, sigmas.orientation_rad, self.stops)
            together.append(np.sqrt(self.scale) * moved)
        for sigma, axis in zip(sigmas.axes, self.axes, strict=False):
            spread += sigma**2 * axis
        spread *= self.scale
        together.append(self.arm)
        if not sigmas.is_alike:
            return Noise(spread, np.concatenate(together, axis=2))
        left = np.maximum(1 - np.sum(factor**2, axis=1), 0.0)
        alike = self._by_pose(sigmas.alike_position_mm, sigmas.alike_orientation_rad)
        spread += left[:, None, None] * alike
        together.insert(1, self._drawn(sigmas.alike_position_mm, sigmas.alike_orientation_rad, factor))
        return Noise(spread, np.concatenate(together, axis=2))

    def mean_square(self, sigmas: Sigmas) -> float:
        """Return the mean square, mm², of what poses' own errors and those that are alike do to captures."""
        own = self._by_pose(sigmas.position_mm, sigmas.orientation_rad)
        alike = self._by_pose(sigmas.alike_position_mm, sigmas.alike_orientation_rad)
        return float(np.trace(own + alike, axis1=1, axis2=2).mean())

    def _drawn(self, position_mm: float, orientation_rad: float, factor: FloatArray) -> FloatArray:
        """Return how captures move by errors of unit variance that they have by a factor (K, m), (K, 3, 6 m)."""
        moves = self.moves * np.repeat([position_mm, orientation_rad], 3)
        return (moves[:, :, None, :] * factor[:, None, :, None]).reshape(len(moves), 3, -1)

    def _by_pose(self, position_mm: float, orientation_rad: float) -> FloatArray:
        return _spread(self.moving, position_mm) + orientation_rad**2 * self.turning


def _turning(squared: FloatArray) -> FloatArray:
    """Return the covariance (K, 3, 3) of the ends of levers by turns of unit variance, by their squares l lᵀ."""
    return np.trace(squared, axis1=1, axis2=2)[:, None, None] * np.eye(3) - squared


def _spread(moving: FloatArray, position_mm: float) -> FloatArray:
    return np.maximum(position_mm**2 * moving, _LEAST_SIGMA_MM**2 * np.eye(3))
