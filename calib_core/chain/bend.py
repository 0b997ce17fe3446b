"""A sheet of light that is bent: points lie off its plane by the square of x, one unknown of the scanner more.

It is sought only where a score test finds it: how much likelier all captures get with it.  How the likelihood
follows it is found by differences, all captures' own centres settled anew.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from calib_core.chain.answer import radii_of
from calib_core.chain.chain_data import ChainData
from calib_core.chain.likelihood import linearised_at
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations, SphereObservation
from calib_core.chain.rejection import Judged, judge_from, with_more_spread
from calib_core.chain.score import Scores
from calib_core.chain.unmodelled import LEAST_MM, RARE, can_show, unmodelled_of
from calib_core.chain.variance import GivenSigmas
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray
from calib_core.sphere.circle import circle_step

_BELIEVED_MM: Final = 5.0
_TRIED_MM: Final = 0.05
_ROUNDS: Final = 4
_SURE: Final = 1e-6  # a tool that was changed midway looks bent by chances of 1 in 3,000
_SETTLED: Final = 0.1  # of its standard deviation


@dataclass(frozen=True, eq=False)
class Bend:
    """How far a scanner's light lies off its plane along y at the stripe's ends, mm, and what that does.

    `by_one` (P,) is how the unknowns move with one standard deviation of it; `chance` how rare so much is.
    """

    size_mm: float
    sigma_mm: float
    half_width_mm: float
    chance: float
    by_one: FloatArray
    scanner: str = ""

    @property
    def solved(self) -> bool:
        """Whether nothing else feigns it, so that it is taken out of the points."""
        return self.chance < _SURE

    def at_mm(self, x_mm: float) -> float:
        """Return how far the light lies off its plane at a distance from the stripe's middle."""
        return self.size_mm * (x_mm / self.half_width_mm) ** 2


Bends = tuple[Bend, ...]
"""Of the scanners whose light is bent."""


def straightened(
    observations: Observations, data: ChainData, judged: Judged, given: GivenSigmas
) -> tuple[list[SphereObservation], ChainData, Judged, Bends]:
    """Return captures and arrays with their points where bent sheets of light were, the answer, and the bends.

    Where the captures show no bend, or poses that lag explain them better, all is as it was.  One that something
    else might feign is not taken out of the points.
    """
    seen, bends = list(observations), list[Bend]()
    lag = unmodelled_of(judged)
    lags = lag.chance if lag is not None and lag.said else RARE
    for which in range(len(data.walk.layout.mounts)) if len(data.points) else ():
        seen, data, judged, bend = _straightened(seen, data, judged, given, which, lags)
        bends += [bend] if bend is not None else []
    return seen, data, judged, tuple(bends)


def _straightened(
    observations: list[SphereObservation],
    data: ChainData,
    judged: Judged,
    given: GivenSigmas,
    which: int,
    rare: float,
) -> tuple[list[SphereObservation], ChainData, Judged, Bend | None]:
    """Return the same for one of the scanners, whose bend is one where chance is below `rare`."""
    found = _bend_at(judged, which, 0.0) if can_show(judged, which) else None
    as_it_was = observations, data, judged, None
    if found is None or found.chance >= rare or abs(found.size_mm) <= LEAST_MM:
        return as_it_was
    if not found.solved:
        return observations, data, judged, found
    chance, seen, bent = found.chance, observations, data
    for _ in range(_ROUNDS):
        state = judged.fit.state
        seen, bent = unbent(observations, data, state, (found,))
        judged = judge_from(seen, bent, state, judged.used, given)
        after = _bend_at(judged, which, found.size_mm)
        if after is None:
            return as_it_was
        settled = abs(after.size_mm - found.size_mm) < _SETTLED * after.sigma_mm
        found = after
        if settled:
            break
    return seen, bent, judged, replace(found, chance=chance)


def by_all(judged: Judged, bends: Bends) -> Bends:
    """Return bends that some of the captures show without those that chance explains in what all show of them."""
    here = [None if bend.solved else _bend_at(judged, _number(judged, bend), 0.0) for bend in bends]
    return tuple(bend for bend, one in zip(bends, here, strict=True) if one is None or one.chance < RARE)


def doubted(judged: Judged, bends: Bends) -> Judged:
    """Return captures judged, less sure by what is unknown of bends that were found of them or of others."""
    spread = np.zeros((judged.data.width,) * 2)
    for bend in bends:
        here = _bend_at(judged, _number(judged, bend), bend.size_mm if bend.solved else 0.0)
        if here is not None:
            step = here.by_one if bend.solved else here.by_one * bend.size_mm / here.sigma_mm
            spread += np.outer(step, step)
    return with_more_spread(judged, spread) if bends else judged


def _number(judged: Judged, bend: Bend) -> int:
    return [name for name, _ in judged.data.walk.layout.mounts].index(bend.scanner)


def unbent(
    observations: Observations, data: ChainData, state: ChainState, bends: Bends
) -> tuple[list[SphereObservation], ChainData]:
    """Return captures and arrays with their points where bent sheets of light were that are solved.

    Parameters
    ----------
    observations, data
        Captures, and the same as arrays, their points in one plane.
    state : ChainState
        Where it expects the balls, profiles are looked at from the plane that the light is in there.
    bends : tuple of Bend
    """
    solved = {bend.scanner: bend for bend in bends if bend.solved}
    if not solved:
        return list(observations), data
    balls = zip(observations, data.walk.seen(state.position), radii_of(data, state), strict=True)
    seen = [
        _flattened(o, bend, center, radius_mm, bend.at_mm(center[0])) if (bend := solved.get(o.scanner)) else o
        for o, center, radius_mm in balls
    ]
    points, names = data.points, [name for name, _ in data.walk.layout.mounts]
    for name in solved.keys() & {*names}:
        points = _off_the_plane(points, solved[name], _of_scanner(data, names.index(name)))
    return seen, replace(data, points=points)


def _of_scanner(data: ChainData, which: int) -> np.ndarray:
    """Return which points are of one of the scanners, (M,)."""
    return np.repeat(data.walk.scanner == which, np.diff(data.offsets))


def in_one_plane(
    observations: Observations, sheet_per_mm: float, centers: FloatArray, radius_mm: float
) -> list[SphereObservation]:
    """Return profiles of a bent sheet of light with their points in the plane y = 0, as far from the ball.

    Parameters
    ----------
    observations : K captures
    sheet_per_mm : float
        How far the light lies off its plane along y, over the square of x.
    centers : (K, 3)
        The ball in L, as each capture should see it.
    radius_mm : float
    """
    bend = _of_one(sheet_per_mm, 1.0)
    return [_flattened(o, bend, c, radius_mm, 0.0) for o, c in zip(observations, centers, strict=True)]


def _bend_at(judged: Judged, which: int, size_mm: float) -> Bend | None:
    """Return a scanner's likeliest bend by the likelihood's slope at the one that points have, if it peaks."""
    data, state, sigmas = judged.data, judged.fit.state, judged.fit.sigmas
    here, own = linearised_at(data, state, sigmas), _of_scanner(data, which)
    one, other = (
        linearised_at(replace(data, points=_off_the_plane(data.points, more, own)), state, sigmas)
        for more in (_of_one(_TRIED_MM, data.half_width_mm), _of_one(-_TRIED_MM, data.half_width_mm))
    )
    slope = (one.cost - other.cost) / (2 * _TRIED_MM) + size_mm / _BELIEVED_MM**2
    curvature = (one.cost + other.cost - 2 * here.cost) / _TRIED_MM**2
    cross = (one.gradient - other.gradient) / (2 * _TRIED_MM)
    step = covariance_of(here.hessian) @ cross
    # What the answer leaves of its own slope is taken out.
    slope -= float(step @ here.gradient)
    information = curvature - float(cross @ step) + 1 / _BELIEVED_MM**2
    if information <= 0:
        return None
    sigma_mm = float(information**-0.5)
    return Bend(
        size_mm=size_mm - slope / information,
        sigma_mm=sigma_mm,
        half_width_mm=data.half_width_mm,
        chance=Scores.of(judged).chance(slope**2 / information, 1),
        by_one=-sigma_mm * step[: data.width],
        scanner=data.walk.layout.mounts[which][0],
    )


def _of_one(size_mm: float, half_width_mm: float) -> Bend:
    return Bend(size_mm, 0.0, half_width_mm, 1.0, np.empty(0))


def _off_the_plane(points: FloatArray, bend: Bend, some: np.ndarray | slice = slice(None)) -> FloatArray:
    moved = points.copy()
    moved[some, 1] += bend.size_mm * (points[some, 0] / bend.half_width_mm) ** 2
    return moved


def _flattened(
    observation: SphereObservation, bend: Bend, center: FloatArray, radius_mm: float, level: float
) -> SphereObservation:
    """Return a profile with its points in the plane y = `level`.

    Each keeps its distance to the sphere about `center` (3,), where the answer expects it.
    """
    if observation.circle_radius_mm is None:
        return observation
    points = _off_the_plane(observation.points_in_laser_mm, bend)
    height = np.clip(level - center[1], -radius_mm, radius_mm)
    apart = points[:, [0, 2]] - center[[0, 2]]
    square = np.maximum(np.sum(apart**2, axis=1), 1e-12)
    more = (height + points[:, 1] - level) ** 2 - height**2
    flat = center[[0, 2]] + apart * np.sqrt(np.maximum(1 + more / square, 0.0))[:, None]
    x, z, radius = circle_step(flat, np.array([*center[[0, 2]], observation.circle_radius_mm])).parameters
    return replace(
        observation,
        points_in_laser_mm=np.insert(flat, 1, level, axis=1),
        center_in_laser_mm=np.array([x, level, z]),
        circle_radius_mm=float(radius),
    )
