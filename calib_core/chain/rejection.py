"""Which captures do not belong: a moved sphere, a pose of another capture.  Each is judged by all the others.

Every capture is compared with where the others, without it, expect its sphere; their uncertainty, the pose's
scatter and the capture's own all count.  The set of good captures grows from those on which the robust start
agrees, until it no longer changes, so that bad ones can neither hide each other nor inflate the scatter they
are judged by.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.likelihood import ChainLinearisation, own_equations, pose_spread
from calib_core.chain.model import ChainData, ChainState, prediction
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.sides import with_better_sides
from calib_core.chain.start import Start
from calib_core.chain.variance import ChainFit, GivenSigmas, fit_with_sigmas
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray

# The chance that any good capture of a session is rejected; smaller where the sigmas are the same captures' guess.
_FALSE_ALARM = 0.03
_FALSE_ALARM_ESTIMATED = 0.01
# A scanner's own linearity, as a share of the radius, is no reason to reject a capture: near a great circle a
# tenth of a per cent of the radius is millimetres of y.
_LINEARITY = 1e-3
_MEDIAN_CHI2_3 = 2.366
_CLEAR_EXCESS = 2.0  # the median over a dozen captures' distances² strays that far by chance,
_CLEAR_EXCESS_FREEDOM = 18.0  # and farther over few: all of them then move with few degrees of freedom
_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class Judged:
    """The fit to the captures that belong together, and how far each capture is from the others.

    Attributes
    ----------
    fit : ChainFit
        Of the used captures.
    data : ChainData
        The used captures.
    used : (K,) bool
    squared_distance : (K,)
        Mahalanobis distance², three degrees of freedom, from what the others expect.
    threshold : float
        Beyond it a capture is rejected.
    excess : float
        By how much more than the sigmas say the captures scatter: a ratio of variances, 1 where all is well.
    """

    fit: ChainFit
    data: ChainData
    used: np.ndarray
    squared_distance: FloatArray
    threshold: float
    excess: float


def judge(
    observations: list[SphereObservation],
    sphere: SphereSize,
    data: ChainData,
    start: Start,
    position_mm: float | None,
    orientation_rad: float | None,
) -> Judged:
    """Return the captures that belong together, fitted, and the distances of all."""
    state = ChainState.predicted(data, start.rotation, start.translation, start.center)
    return judge_from(observations, sphere, data, state, _core(start), (position_mm, orientation_rad, 0.0))


def judge_from(
    observations: list[SphereObservation],
    sphere: SphereSize,
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    sigmas: GivenSigmas,
) -> Judged:
    """Return the captures that belong together, grown from those of a mask (K,) on which a near state agrees.

    Parameters
    ----------
    observations, sphere, data
        All captures, and the same as arrays.
    state : ChainState
        Near the answer.
    core : (K,) bool
    sigmas : of a pose's position (mm) and orientation (rad) and of the table's angle (rad); None: estimated
    """
    judged = _grown(observations, sphere, data, state, core, sigmas)
    other = with_better_sides(judged.data, judged.fit)
    if other is None:
        return judged
    tool = other.tool_rotation, other.tool_translation
    whole = ChainState.predicted(data, *tool, other.center, other.table)
    own = whole.centers_in_laser.copy()
    own[judged.used] = other.centers_in_laser
    return _grown(observations, sphere, data, replace(whole, centers_in_laser=own), judged.used, sigmas)


def _grown(
    observations: list[SphereObservation],
    sphere: SphereSize,
    data: ChainData,
    state: ChainState,
    used: np.ndarray,
    sigmas: GivenSigmas,
) -> Judged:
    """Let the set of used captures grow or shrink until it no longer changes."""
    count = data.count
    history: list[bytes] = []
    while True:
        judged = judge_these(observations, sphere, data, state, used, sigmas)
        squared = judged.squared_distance
        history.append(used.tobytes())
        belongs = squared <= judged.threshold
        if belongs.sum() < max(4, count // 2):  # never fewer than half: then nothing is known well enough
            belongs = squared <= np.sort(squared)[max(4, (count + 1) // 2) - 1]
        if belongs.tobytes() in history or len(history) > _ROUNDS:
            return judged
        used = belongs


def judge_these(
    observations: list[SphereObservation],
    sphere: SphereSize,
    data: ChainData,
    state: ChainState,
    used: np.ndarray,
    sigmas: GivenSigmas,
) -> Judged:
    """Return the fit to the captures of a mask (K,), right or wrong, and how far all are from it."""
    chosen = data.chosen(used)
    fit = fit_with_sigmas(chosen, replace(state, centers_in_laser=state.centers_in_laser[used]), *sigmas)
    squared = _squared_distances(observations, sphere, data, used, fit)
    freedom = 3 * int(used.sum()) - data.free_unknowns
    threshold = _threshold(data.count, freedom, None in sigmas)
    ratio = float(np.median(squared)) / _MEDIAN_CHI2_3
    excess = ratio if ratio > max(_CLEAR_EXCESS, 1 + _CLEAR_EXCESS_FREEDOM / max(freedom, 1)) else 1.0
    return Judged(fit, chosen, used, squared, threshold * excess, excess)


def _core(start: Start) -> np.ndarray:
    """Return the captures on which the start agrees: within twice the median misfit, and at least half of them."""
    limit = max(2.0 * start.scatter_mm, float(np.sort(start.misfit_mm)[min(5, len(start.misfit_mm) - 1)]))
    return start.misfit_mm <= limit


def _threshold(count: int, freedom: int, estimated: bool) -> float:
    from scipy.special import chdtri, fdtri  # scipy.stats has them too, but takes a second to import

    if not estimated:
        return float(chdtri(3, _FALSE_ALARM / count))
    return float(3 * fdtri(3, max(freedom, 3), 1 - _FALSE_ALARM_ESTIMATED / count))


@dataclass(frozen=True, eq=False)
class WithoutOne:
    """The unknowns' step (K, P) and covariance (K, P, P) when each used capture is left out."""

    steps: FloatArray
    covariances: FloatArray


def without_each(at: ChainLinearisation) -> WithoutOne:
    """Return what the unknowns become without each capture, from the linearisation at the minimum."""
    own = own_equations(at)
    covariances = np.array([covariance_of(at.hessian - h) for h in own.hessians])
    steps = np.einsum("kpq,kq->kp", covariances, own.gradients - at.gradient)
    return WithoutOne(steps, covariances)


def _squared_distances(
    observations: list[SphereObservation], sphere: SphereSize, data: ChainData, used: np.ndarray, fit: ChainFit
) -> FloatArray:
    """Return each capture's squared Mahalanobis distance from what the other used captures expect, (K,)."""
    state, width = fit.state, data.unknowns
    expected = prediction(data, state)
    predicted, jacobian = expected.centers_in_laser, expected.jacobian
    without = without_each(fit.minimum.at)
    covariances = np.broadcast_to(fit.covariance[:width, :width], (data.count, width, width)).copy()
    covariances[used] = without.covariances[:, :width, :width]
    centers = predicted.copy()
    centers[used] += np.einsum("kij,kj->ki", jacobian[used], without.steps[:, :width])
    spread = pose_spread(predicted, state.tool_in_laser, fit.sigmas, expected.levers)
    spread = spread + jacobian @ covariances @ np.swapaxes(jacobian, 1, 2)
    return np.array(
        [_squared_distance(o, sphere, q, s) for o, q, s in zip(observations, centers, spread, strict=True)]
    )


def _squared_distance(
    observation: SphereObservation, sphere: SphereSize, expected: FloatArray, spread: FloatArray
) -> float:
    """Return the squared distance of one measured centre, or circle (x, z, r), from the expected sphere's."""
    measured = observation.center_in_laser_mm
    if observation.circle_radius_mm is None:
        off, rows = measured - expected, np.eye(3)
    else:
        cut = np.sqrt(max(sphere.radius_mm**2 - expected[1] ** 2, 1e-6))
        # Far beyond the sphere the slope would explode; the distance then speaks by x and z.
        slope = float(np.clip(-expected[1] / cut, -10, 10))
        off = np.array([*(measured - expected)[[0, 2]], observation.circle_radius_mm - cut])
        rows = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, slope, 0]])
    covariance = observation.center_covariance + rows @ spread @ rows.T
    if observation.circle_radius_mm is not None:
        covariance[2, 2] += (_LINEARITY * sphere.radius_mm) ** 2
    return float(off @ np.linalg.solve(covariance, off))
