"""Drift within a session: whether the scanner, or the sphere, moved slowly while it was captured, and had settled.

A shift of the scanner in its own frame, or of the sphere in base, follows time as exp(−t/τ) or as a straight line.
How much likelier the captures get with it, and how large it is, follows from the normal equations at the answer (a
score test), for every course at once.  The slow drift that the answer has room for (`chain.model`) is taken back
first: else it would have explained part of what is sought.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.incidents import by_mount, by_place
from calib_core.chain.likelihood import ChainLinearisation, without_pose_errors
from calib_core.chain.observations import Observations
from calib_core.chain.rejection import Judged
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray

Moved = Literal["scanner", "sphere", "scanner-or-sphere"]

LEAST_CAPTURES: Final = 8
"""With fewer, a drift is hardly told from poses that err."""

_CONSTANTS: Final = (0.2, 0.4, 0.8)  # of the session's length; the straight line is beyond them
_SETTLED_BY: Final = 0.4
_FAR_MM: Final = 5.0
_CHANCE: Final = 1e-5  # of one course; what the model leaves out of real arms comes on top
_FIRM: Final = 0.4  # of the gain that must be left without any one capture
_LEAST_LEFT: Final = 0.1  # of the scatter: estimated sigmas have swallowed no more of a drift
_ALIKE: Final = 4.0
_STILL_OFF: Final = 0.25  # of the drift: captures that lie farther off are to be taken again
_LEAST_BESIDE: Final = 2
_LEAST_MM: Final = 0.05


@dataclass(frozen=True, eq=False)
class WarmUp:
    """How far scanner or sphere drifted from a session's first used capture to its last.

    Attributes
    ----------
    moved : str
        What explains it; both where the captures do not tell them apart.
    drift_mm, uncertainty_mm : float
        Its length, and ± along it (k = 2).
    found : bool
        Whether it is beyond doubt.
    settled : bool
        Whether it had come to rest by the session's end.
    timed : bool
        Whether `at` are seconds; otherwise they are the captures' places in their order.
    constant : float or None
        τ in units of `at`; None of a straight line.
    captures : tuple of str
        Those that were taken while it was still far from its end.
    chance : float
        How often a scanner and a sphere that stand still look as much like it.
    at, offset_mm, sigma_mm, course_mm : (K,)
        When each used capture was taken, how far it lies along the drift, by itself, and what the drift says.
    names : tuple of str
        The used captures.
    """

    moved: Moved
    drift_mm: float
    uncertainty_mm: float
    found: bool
    settled: bool
    timed: bool
    constant: float | None
    captures: tuple[str, ...]
    names: tuple[str, ...]
    at: FloatArray
    offset_mm: FloatArray
    sigma_mm: FloatArray
    course_mm: FloatArray
    chance: float


@dataclass(frozen=True, eq=False)
class _Said:
    """What each used capture says of a shift of its own: score (K, 3), information (K, 3, 3), and by all else."""

    score: FloatArray
    square: FloatArray
    cross: FloatArray


@dataclass(frozen=True, eq=False)
class _Scores(_Said):
    """The same of all together; `alone`: the error of a stop's pose counts as each of its captures' own."""

    moved: Moved
    alone: _Said
    covariance: FloatArray  # of all other unknowns (P, P)
    pull: FloatArray  # of the drift taken back on them (P,)
    misfit: float  # χ² of all captures without any drift


@dataclass(frozen=True, eq=False)
class _Drift:
    """One course: its weights (K,), 1 at the start and 0 at the end, and the shift at the start."""

    scores: _Scores
    constant: float | None
    weights: FloatArray
    start_mm: FloatArray
    covariance: FloatArray
    gain: float

    @property
    def freedom(self) -> int:
        """The degrees of freedom that are left beside it."""
        return max(3 * len(self.weights) - 12, 1)

    @property
    def scale(self) -> float:
        """By how much what is left scatters more, in variance, than the sigmas say."""
        return max(self.scores.misfit - self.gain, _LEAST_LEFT * self.scores.misfit) / self.freedom

    @property
    def chance(self) -> float:
        """How often chance gives as much, whatever the sigmas (an F test)."""
        from scipy.special import fdtrc

        return float(fdtrc(3, self.freedom, self.gain / 3 / self.scale))


def warm_up_of(observations: Observations, judged: Judged, taken_at_s: Mapping[str, float]) -> WarmUp | None:
    """Return how far scanner or sphere drifted within a session, None of one with too few captures.

    Parameters
    ----------
    observations : K captures of the still sphere, in the order in which they were taken
    judged : Judged
    taken_at_s : mapping
        When captures were taken, by their ids; the order alone counts where not all are told.
    """
    used = np.array([k for k, one in enumerate(judged.used) if one])
    names = [o.capture for o, one in zip(observations, judged.used, strict=True) if one]
    if len(dict.fromkeys(names)) < LEAST_CAPTURES:
        return None
    at, timed = _times(names, taken_at_s)
    sought = _scores(judged, used)
    every = [_best(scores, at) for scores in sought]
    best = max(every, key=lambda one: one.gain)
    alike = min(one.gain for one in every) > best.gain - _ALIKE * best.scale
    drift_mm = float(np.linalg.norm(best.start_mm))
    way = best.start_mm / max(drift_mm, 1e-12)
    sigma = float(np.sqrt(way @ best.covariance @ way * best.scale))
    offset, own_sigma = _along(best, way)
    found = best.chance < _CHANCE and drift_mm > _LEAST_MM and _is_firm(best, offset, own_sigma)
    found = found and best.gain > max(_largest_step(scores) for scores in sought)
    return WarmUp(
        moved="scanner-or-sphere" if alike else best.scores.moved,
        drift_mm=drift_mm,
        uncertainty_mm=2 * sigma,
        found=found,
        settled=best.constant is not None and best.constant <= _SETTLED_BY * np.ptp(at),
        timed=timed,
        constant=best.constant,
        captures=tuple(
            dict.fromkeys(n for n, w in zip(names, best.weights.tolist(), strict=True) if w > _STILL_OFF)
        ),
        names=tuple(names),
        at=at,
        offset_mm=offset,
        sigma_mm=own_sigma * np.sqrt(best.scale),
        course_mm=best.weights * drift_mm,
        chance=best.chance,
    )


def _times(names: Sequence[str], taken_at_s: Mapping[str, float]) -> tuple[FloatArray, bool]:
    """Return when captures were taken, from the first on: in seconds, or else in their order."""
    if all(name in taken_at_s for name in names):
        told = np.array([taken_at_s[name] for name in names], dtype=float)
        if np.ptp(told) > 0 and np.all(np.diff(told) >= 0):
            return told - told[0], True
    places = {name: place for place, name in enumerate(dict.fromkeys(names))}
    return np.array([float(places[name]) for name in names]), False


def _scores(judged: Judged, used: np.ndarray) -> list[_Scores]:
    """Return what each capture says of a shift of scanner or sphere, the answer's own drift taken back."""
    at, data, state = judged.fit.minimum.at, judged.data, judged.fit.state
    count = at.jacobian.shape[2]
    others = np.ones(count, dtype=bool)
    pull, taken_back, columns = np.zeros(count), np.zeros(0), slice(0, 0)
    if data.drift_sigma_mm > 0 and state.shared is not None:
        first = data.width + (data.arm_scale_sigma > 0)
        columns = slice(first, first + 3)
        others[columns] = False
        taken_back = state.shared[columns.start - data.width : columns.stop - data.width]
        pull = at.hessian[:, columns] @ taken_back
    reduced, rest, by_all = _of_shifts(at, columns, taken_back)
    alone = _of_shifts(_each_alone(data, at, state.shared), columns, taken_back)
    covariance = covariance_of(at.hessian[np.ix_(others, others)])
    inverse = np.linalg.pinv(reduced[used, :3, :3], hermitian=True)
    misfit = float(np.einsum("ki,kij,kj->", rest[used], inverse, rest[used]))
    misfit -= float(pull[others] @ covariance @ pull[others])
    # What is believed of shared pose errors and of the scanner is part of it: they take up scatter, too.
    shared = np.empty(0) if state.shared is None else data.unlikely(state.shared)
    believed = np.concatenate([state.scanner[data.active] / data.nuisance_sigmas[data.active], shared])
    misfit += float((believed**2)[others[data.unknowns :]].sum())
    found: list[_Scores] = []
    moves: list[tuple[Moved, FloatArray]] = [
        ("scanner", by_mount(judged)[:, :, 3:] @ state.position.mount_rotations[data.walk.scanner]),
        ("sphere", by_place(judged)),
    ]
    for moved, own in moves:
        turned = np.swapaxes(own, 1, 2)[used]
        said, by_itself = (
            (
                np.einsum("kpi,ki->kp", turned, left[used]),
                turned @ sharp[used, :3, :3] @ own[used],
                (turned @ by_others[used])[:, :, others],
            )
            for sharp, left, by_others in ((reduced, rest, by_all), alone)
        )
        found.append(_Scores(*said, moved, _Said(*by_itself), covariance, pull[others], misfit))
    return found


def _of_shifts(
    at: ChainLinearisation, drift: slice, taken_back: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what captures say of their balls' places, without a drift: information, vector, and by all else."""
    reduced, rest = without_pose_errors(at.information, at.vector, at.gain, at.share)
    by_all = reduced[:, :3, :3] @ at.jacobian
    by_all[:, :, at.nuisances] += reduced[:, :3, 3:]
    rest = rest[:, :3] - np.einsum("kij,kj->ki", reduced[:, :3, :3], at.offset)
    return reduced, rest + by_all[:, :, drift] @ taken_back, by_all


def _each_alone(data: ChainData, at: ChainLinearisation, shared: FloatArray | None) -> ChainLinearisation:
    """Return the likelihood in which the error of a stop's pose is the own one of each capture there.

    Several captures of a stop tell its error to a hundredth of a millimetre: beside it no capture is off.
    """
    if data.stops == 0 or shared is None:
        return at
    from calib_core.kernels.chain import pose_error_gain

    last = len(shared) - (0 if data.arm_columns is None else data.arm_columns.shape[2])
    found = shared[last - data.of_stops : last]
    stops = slice(data.width + last - len(found), data.width + last)
    by_stop = at.jacobian[:, :, stops]
    spread = np.linalg.inv(at.precision) + by_stop @ np.swapaxes(by_stop, 1, 2)
    gain, share, jacobian = np.empty_like(at.gain), np.empty_like(at.share), at.jacobian.copy()
    pose_error_gain(at.information, spread, gain, share)
    jacobian[:, :, stops] = 0.0
    return replace(at, gain=gain, share=share, jacobian=jacobian, offset=at.offset - by_stop @ found)


def _best(scores: _Scores, at: FloatArray) -> _Drift:
    """Return the likeliest course of a drift."""
    share = (at - at[0]) / np.ptp(at)
    courses: list[tuple[float | None, FloatArray]] = [(None, 1 - share)]
    for constant in _CONSTANTS:
        falling = np.exp(-share / constant)
        courses.append((constant * float(np.ptp(at)), (falling - falling[-1]) / (falling[0] - falling[-1])))
    tried = [_drift(scores, constant, weights) for constant, weights in courses]
    return max(tried, key=lambda one: one.gain)


def _largest_step(scores: _Scores) -> float:
    """Return the gain of the likeliest sudden shift between two captures: that is no drift."""
    count = len(scores.score)
    first = np.arange(count)
    return max(
        _drift(scores, None, (first < k).astype(float)).gain
        for k in range(_LEAST_BESIDE, count - _LEAST_BESIDE + 1)
    )


def _drift(scores: _Scores, constant: float | None, weights: FloatArray) -> _Drift:
    cross = np.einsum("k,kpq->pq", weights, scores.cross)
    information = np.einsum("k,kpq->pq", weights**2, scores.square) - cross @ scores.covariance @ cross.T
    information = information + np.eye(3) / _FAR_MM**2
    score = weights @ scores.score - cross @ scores.covariance @ scores.pull
    covariance = np.linalg.inv(information)
    start = covariance @ score
    return _Drift(scores, constant, weights, start, covariance, float(score @ start))


def _is_firm(drift: _Drift, offset_mm: FloatArray, sigma_mm: FloatArray) -> bool:
    """Return whether no single capture makes the drift."""
    every = np.ones(len(offset_mm), dtype=bool)
    whole = _steepness(drift.weights, offset_mm, sigma_mm, every)
    for k in range(len(offset_mm)):
        every[k] = False
        if _steepness(drift.weights, offset_mm, sigma_mm, every) < _FIRM * whole:
            return False
        every[k] = True
    return True


def _steepness(weights: FloatArray, offset_mm: FloatArray, sigma_mm: FloatArray, some: np.ndarray) -> float:
    """Return the slope of offsets over weights in its standard deviations."""
    x, y, w = weights[some], offset_mm[some], 1 / sigma_mm[some] ** 2
    x = x - np.average(x, weights=w)
    return float((w * x) @ y / np.sqrt((w * x) @ x))


def _along(drift: _Drift, way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far each capture lies along the drift (K,), from where it ends, and its standard deviation (K,).

    What is left of a capture beside the drift, and the drift added again.
    """
    scores, start, alone = drift.scores, drift.start_mm, drift.scores.alone
    cross = np.einsum("k,kpq->pq", drift.weights, scores.cross)
    others = scores.covariance @ (scores.pull - cross.T @ start)
    left = alone.score - alone.cross @ others - drift.weights[:, None] * (alone.square @ start)
    sigma = 1 / np.sqrt(np.maximum(np.einsum("i,kij,j->k", way, alone.square, way), 1e-6))
    return (left @ way) * sigma**2 + drift.weights * float(way @ start), sigma
