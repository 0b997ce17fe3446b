"""Which captures do not belong: a moved sphere, a pose of another capture.  Each is judged by all the others.

Every capture is compared with where the others, without it, expect its sphere; their uncertainty, the pose's
scatter and the capture's own all count.  One that lies off counts less: beyond 2.8 standard deviations (the 95 %
of three components) its pose's variance is taken (d / 2.8)² times as large, so that its pull no longer grows.
Only gross errors are left out.  The set of good captures grows from those on which the robust start agrees,
until it no longer changes, so that bad ones can neither hide each other nor inflate the scatter they are judged
by.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.leave_one_out import without_each
from calib_core.chain.likelihood import spheres_of
from calib_core.chain.model import ChainState
from calib_core.chain.noise import noise_of
from calib_core.chain.observations import Observations
from calib_core.chain.scanner import spheres_seen
from calib_core.chain.sides import with_better_sides
from calib_core.chain.variance import (
    ChainFit,
    GivenSigmas,
    fit_with_sigmas,
    log_probability,
    with_averaged_covariance,
)
from calib_core.frames import FloatArray
from calib_core.messages import Value

_SAME_PLACE_MM = 0.01

# The chance that any good capture of a session lies beyond the limit; smaller where the sigmas are the same
# captures' guess.  Gross is what lies this much farther, in variance: until there it counts, but less.
_FALSE_ALARM = 0.03
_FALSE_ALARM_ESTIMATED = 0.01
_GROSS = 2.5
_ORDINARY = 7.81  # χ² of 3, 95 %
# A scanner's own linearity, as a share of the radius, is no reason to reject a capture: near a great circle a
# tenth of a per cent of the radius is millimetres of y.
_LINEARITY = 1e-3
_UNKNOWN_HEIGHT, _LEAST_HEIGHT = 0.5, 0.05  # of the radius
_MEDIAN_CHI2_3 = 2.366
_CLEAR_EXCESS = 2.0  # the median over a dozen captures' distances² strays that far by chance,
_CLEAR_EXCESS_FREEDOM = 18.0  # and farther over few: all of them then move with few degrees of freedom
_ROUNDS = 12
_SETTLED = 0.3  # of a logarithm of a capture's variance
# Sigmas that were told rightly let estimated ones gain so much, a log-likelihood, once in some hundred sessions.
_CONTRADICTED = 4.0
_LARGER = 1.5
_IMPROBABLE = 2.5  # standard deviations
_LEAST_FREE = 0.1  # of a prior's variance: where captures tell nothing, its own is all that is known


@dataclass(frozen=True, eq=False)
class Judged:
    """The fit to the captures that belong together, and how far each capture is from the others.

    Attributes
    ----------
    fit : ChainFit
        With the nuisances free.
    data : ChainData
        All captures; those that are left out say nothing.
    used : (K,) bool
    squared_distance : (K,)
        Mahalanobis distance², three degrees of freedom, from what the others expect.
    threshold : float
        Beyond it a capture is left out.
    given : tuple of float or None
        Sigmas of position (mm), orientation (rad) and axes' readings that were told and held; None: estimated.
    excess : float
        By how much more than given sigmas say the captures scatter: a ratio of variances, 1 where all is well.
        Where it is more, the sigmas of the fit are estimated instead.
    inflation : float
        By how much the covariance is to be enlarged: where captures scatter more than even estimated sigmas say.
    """

    fit: ChainFit
    data: ChainData
    used: np.ndarray
    squared_distance: FloatArray
    threshold: float
    given: GivenSigmas
    excess: float
    inflation: float = 1.0


def with_more_spread(judged: Judged, spread: FloatArray) -> Judged:
    """Return the same with a covariance (P, P) of the edges' unknowns added."""
    covariance, size = judged.fit.covariance.copy(), len(spread)
    covariance[:size, :size] += spread / judged.inflation
    return replace(judged, fit=replace(judged.fit, covariance=covariance))


def with_doubted_priors(judged: Judged) -> Judged:
    """Return the same, less sure where a radius or an error by incidence lies beyond what is believed of it.

    The covariance then holds by how much the unknowns would move if nothing were believed of it.
    """
    data, covariance = judged.data, judged.fit.covariance.copy()
    if data.tool_prior is not None:
        return judged
    for column, nuisance in enumerate(data.active, data.unknowns):
        sigma, found = data.nuisance_sigmas[nuisance], judged.fit.state.scanner[nuisance]
        if not data.of_files[nuisance] and abs(found) > _IMPROBABLE * sigma:
            column_by_one = judged.fit.covariance[:, column] / sigma
            step = column_by_one * found / sigma / max(1 - column_by_one[column] / sigma, _LEAST_FREE)
            covariance += np.outer(step, step)
    return replace(judged, fit=replace(judged.fit, covariance=covariance))


def judge_from(
    observations: Observations, data: ChainData, state: ChainState, core: np.ndarray, sigmas: GivenSigmas
) -> Judged:
    """Return the captures that belong together, grown from those of a mask (K,) on which a near state agrees.

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays.
    state : ChainState
        Near the answer.
    core : (K,) bool
    sigmas : of a pose's position (mm) and orientation (rad) and of each axis's readings; None: estimated
    """
    judged = _grown(observations, data, state, core, sigmas)
    other = with_better_sides(judged.data, judged.fit, without_each(judged.fit.minimum.at))
    if other is not None:
        judged = _grown(observations, data, other, judged.used, sigmas, judged)
    excess = judged.excess
    if any(sigmas) and (excess > 1 or _is_contradicted(judged.data, judged.fit, sigmas)):
        sigmas = estimated(sigmas)
        judged = _grown(observations, data, judged.fit.state, judged.used, sigmas, judged)
    fit = with_averaged_covariance(judged.data, judged.fit, sigmas)
    return replace(judged, fit=fit, excess=excess, inflation=judged.excess)


def estimated(given: GivenSigmas) -> GivenSigmas:
    """Return the same with nothing told but that there is no error at all."""
    return tuple(0.0 if sigma == 0 else None for sigma in given)


def _is_contradicted(data: ChainData, told: ChainFit, given: GivenSigmas) -> bool:
    """Return whether captures, fitted by what was told, say that each errs by itself by more than that.

    What poses share would take up part of it, as if poses that are alike erred alike.
    """
    free = fit_with_sigmas(data, told.state, estimated(given), told.sigmas, 2)
    pairs = [
        (told.sigmas.position_mm, free.sigmas.position_mm),
        (told.sigmas.orientation_rad, free.sigmas.orientation_rad),
        *zip(told.sigmas.axes, free.sigmas.axes, strict=True),
    ]
    if not any(found > _LARGER * one for (one, found), sigma in zip(pairs, given, strict=True) if sigma):
        return False
    gain = log_probability(data, free, estimated(given)) - log_probability(data, told, given)
    return gain > _CONTRADICTED


def _grown(
    observations: Observations,
    data: ChainData,
    state: ChainState,
    used: np.ndarray,
    sigmas: GivenSigmas,
    before: Judged | None = None,
) -> Judged:
    """Let the set of used captures grow or shrink, and weights follow, until neither changes."""
    count = data.count
    history: list[bytes] = []
    scale = data.pose_scale if before is None else before.data.pose_scale
    guess = before.fit if before else None
    while True:
        judged = judge_these(observations, replace(data, pose_scale=scale), state, used, sigmas, guess)
        squared = judged.squared_distance
        history.append(used.tobytes())
        belongs = squared <= judged.threshold
        if belongs.sum() < max(4, count // 2):  # never fewer than half: then nothing is known well enough
            belongs = squared <= np.sort(squared)[max(4, (count + 1) // 2) - 1]
        # Beside the others: were all to lose weight, the estimated sigmas would only shrink to make up for it.
        ordinary = _ORDINARY * max(1.0, float(np.median(squared[used])) / _MEDIAN_CHI2_3)
        after = data.pose_scale * np.maximum(squared / ordinary, 1.0)
        settled = bool(np.abs(np.log(after / scale))[belongs].max(initial=0.0) < _SETTLED)
        same = belongs.tobytes() == used.tobytes()
        if (same and settled) or (not same and belongs.tobytes() in history) or len(history) > _ROUNDS:
            return judged
        used, scale, guess, state = belongs, after, judged.fit, judged.fit.state


def judge_these(
    observations: Observations,
    data: ChainData,
    state: ChainState,
    used: np.ndarray,
    sigmas: GivenSigmas,
    guess: ChainFit | None = None,
) -> Judged:
    """Return the fit to the captures of a mask (K,), right or wrong, and how far all are from it."""
    heard = data.silent(used)
    found = fit_with_sigmas(heard, state, sigmas, guess.sigmas if guess else None, 1 if guess else 2)
    squared = _squared_distances(observations, data, found)
    freedom = 3 * int(used.sum()) - data.free_unknowns
    threshold = _GROSS * _threshold(data.count, freedom, None in sigmas)
    ratio = float(np.median(squared)) / _MEDIAN_CHI2_3
    excess = ratio if ratio > max(_CLEAR_EXCESS, 1 + _CLEAR_EXCESS_FREEDOM / max(freedom, 1)) else 1.0
    return Judged(found, heard, used, squared, threshold * excess, sigmas, excess)


def core_of(misfit_mm: FloatArray) -> np.ndarray:
    """Return the captures on which a start agrees: within twice the median misfit, and at least half of them."""
    limit = max(2.0 * float(np.median(misfit_mm)), float(np.sort(misfit_mm)[min(5, len(misfit_mm) - 1)]))
    return misfit_mm <= limit


def _threshold(count: int, freedom: int, estimated: bool) -> float:
    from scipy.special import chdtri, fdtri  # scipy.stats has them too, but takes a second to import

    if not estimated:
        return float(chdtri(3, _FALSE_ALARM / count))
    return float(3 * fdtri(3, max(freedom, 3), 1 - _FALSE_ALARM_ESTIMATED / count))


def _squared_distances(observations: Observations, data: ChainData, found: ChainFit) -> FloatArray:
    """Return each capture's squared Mahalanobis distance from what the other used captures expect, (K,)."""
    state, at = found.state, found.minimum.at
    radii, _ = spheres_of(data, state)
    without = without_each(at)
    centers = at.centers_in_laser + at.offset + without.moved
    ordinary = replace(data, pose_scale=np.minimum(data.pose_scale, 1.0))
    spread = noise_of(ordinary, state, found.sigmas).spread + without.spread
    measured, circle_mm = spheres_seen(observations, data.own(state.scanner), data.half_width_mm, radii)
    profile = np.isfinite(circle_mm)
    off, rows = measured - centers, np.broadcast_to(np.eye(3), spread.shape).copy()
    # Of a profile the circle was measured: x, z and radius.
    beside = centers[profile, 1] - measured[profile, 1]  # the light
    cut = np.sqrt(np.maximum(radii[profile] ** 2 - beside**2, 1e-6))
    off[profile] = np.column_stack([off[profile][:, [0, 2]], circle_mm[profile] - cut])
    rows[profile] = [[1.0, 0, 0], [0, 0, 1.0], [0, 0, 0]]
    # Far beyond the sphere the slope would explode; the distance then speaks by x and z.
    rows[profile, 2, 1] = np.clip(-beside / cut, -10, 10)
    own = np.array([o.center_covariance for o in observations])
    own = data.points_per_independent[:, None, None] * own
    own[profile, 2, 2] += (_LINEARITY * radii[profile]) ** 2
    # Where the others hardly know y, no slope of the circle holds: its height is compared, on the better side.
    unknown = np.flatnonzero(profile & (spread[:, 1, 1] > (_UNKNOWN_HEIGHT * radii) ** 2))
    height = np.sqrt(np.maximum(radii**2 - circle_mm**2, (_LEAST_HEIGHT * radii) ** 2))[unknown]
    rows[unknown, 2] = [0, 1.0, 0]
    own[unknown, 2] *= (circle_mm[unknown] / height)[:, None]
    own[unknown, :, 2] *= (circle_mm[unknown] / height)[:, None]
    covariance = own + rows @ spread @ np.swapaxes(rows, 1, 2)
    other = off.copy()
    beside = (centers - measured)[unknown, 1]
    off[unknown, 2], other[unknown, 2] = height - beside, -height - beside
    return np.minimum(_squares(off, covariance), _squares(other, covariance))


def _squares(off: FloatArray, covariance: FloatArray) -> FloatArray:
    return np.einsum("ki,ki->k", off, np.linalg.solve(covariance, off[:, :, None])[:, :, 0])


def rejection_reasons(
    observations: Observations, used: np.ndarray, squared_distance: FloatArray, offset_mm: FloatArray
) -> dict[str, dict[str, Value]]:
    """Return what is to be said of each capture that is not used, by capture.

    Parameters
    ----------
    observations : K captures
    used : (K,) bool
    squared_distance : (K,)
        Mahalanobis distance² from what the others expect.
    offset_mm : (K, 3)
        The capture's own sphere centre minus the solved one, along the axes of what carries it.
    """
    positions = np.array([o.base_from_tool0.translation_mm for o in observations])
    found: dict[str, dict[str, Value]] = {}
    for k in np.flatnonzero(~used).tolist():
        one, offset = observations[k], offset_mm[k]
        in_base = offset if one.carriers.ball == "base" else one.base_from_tool0.rotation @ offset
        x, y, z = in_base.tolist()
        twin = _same_pose(positions, observations, k)
        found[observations[k].capture] = {
            "distance_mm": float(np.linalg.norm(offset)),
            "x_mm": x,
            "y_mm": y,
            "z_mm": z,
            "times": float(np.sqrt(squared_distance[k] / 3)),
            "likely": "moved" if twin is None else "twin",
            "twin": twin or "",
        }
    return found


def _same_pose(positions: FloatArray, observations: Observations, k: int) -> str | None:
    near = np.linalg.norm(positions - positions[k], axis=1) < _SAME_PLACE_MM
    near[k] = False
    twins = np.flatnonzero(near)
    return observations[int(twins[0])].capture if len(twins) else None
