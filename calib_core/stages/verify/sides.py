"""Which side of the plane of light each profile saw the sphere on, where the tool may be off.

A tool that is off by more than its own uncertainty, or that was brought without one, puts the sphere elsewhere by
as much; a profile near a great circle then seems to lie on the other side, and a search with the tool as it is
takes wrong sides that agree better.  So tool and sphere are fitted together, from captures' own guesses, and the
sides follow from where the fit expects the sphere.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.stages.verify.tool import Tool

_OFF: Final = np.array([0.02] * 3 + [5.0] * 3)  # rad and mm: by how much a tool in use may be off
_SCATTER_MM: Final = 0.1  # of captures about the sphere, at least: what is not told of the robot
_CUTOFF: Final = 3.0  # Cauchy's loss, in standard deviations
_ROUNDS, _FLIP_ROUNDS = 10, 4
_STARTS: Final = 24
_NEAR_MM: Final = 10.0  # from the plane of light: farther ones are not tried on the other side one by one
_SURE: Final = 10.0  # −2 log-likelihood: 150 to 1
_MATTERS_MM: Final = 0.1


@dataclass(frozen=True, eq=False)
class Sides:
    """The likeliest sides.

    Attributes
    ----------
    sides : (K,)
        ±1; 0 where a capture has no side to choose.
    mount_from_laser : RigidTransform
        As these captures see it.
    center_mm : (3,)
    open : bool
        Whether other sides are nearly as likely and ask for another tool.
    """

    sides: np.ndarray
    mount_from_laser: RigidTransform
    center_mm: FloatArray
    open: bool


def likeliest_sides(observations: Observations, sphere: SphereSize, tool: Tool) -> Sides:
    """Return the sides on which captures of a still sphere agree best, whatever the tool's error."""
    search = _Search(observations, sphere, tool)
    ends: dict[bytes, _End] = {}
    for center in search.guesses():
        end = search.settled(search.at(tool.mount_from_laser, center))
        known = ends.get(end.sides.tobytes())
        if known is None or end.cost < known.cost:
            ends[end.sides.tobytes()] = end
    best = min(ends.values(), key=lambda end: end.cost)
    while True:
        flipped = search.flipped(best)
        ends |= {end.sides.tobytes(): end for end in flipped}
        better = min(flipped, key=lambda end: end.cost, default=best)
        if better.cost >= best.cost - 1e-6:
            break
        best = better
    scale = max(best.cost / max(3 * len(observations) - 9, 1), 1.0)
    point = search.seen_mm.mean(axis=0) * [1.0, 0.0, 1.0]
    here = best.tool.apply(point)
    rivals = [end for end in ends.values() if end is not best and end.cost < best.cost + _SURE * scale]
    is_open = any(float(np.linalg.norm(end.tool.apply(point) - here)) > _MATTERS_MM for end in rivals)
    return Sides(best.sides, best.tool, best.center, is_open)


@dataclass(frozen=True, eq=False)
class _End:
    tool: RigidTransform
    center: FloatArray
    sides: np.ndarray
    cost: float


class _Search:
    """Captures as arrays, and fits of tool and sphere to them."""

    def __init__(self, observations: Observations, sphere: SphereSize, tool: Tool) -> None:
        self._given = tool.mount_from_laser
        self._rotations = np.array([o.ball_from_scanner.rotation for o in observations])
        self._places = np.array([o.ball_from_scanner.translation_mm for o in observations])
        self.seen_mm = np.array([o.sphere_center_in_laser_mm(sphere, 1) for o in observations])
        self._told = np.array([0 if o.circle_radius_mm is None else (o.side or 0) for o in observations])
        self._open = np.array([o.circle_radius_mm is not None and o.side is None for o in observations])
        self._precision = np.array([_precision(o, sphere, tool) for o in observations])
        wide = tool.covariance + np.diag(_OFF**2)
        self._prior = np.linalg.inv(wide)

    def guesses(self) -> list[FloatArray]:
        """Return where the sphere may be on what carries it, by captures spread over all, on either side."""
        count = len(self.seen_mm)
        some = np.unique(np.linspace(0, count - 1, min(count, _STARTS // 2)).astype(int))
        found: list[FloatArray] = []
        for k in some.tolist():
            for side in (1, -1) if self._open[k] else (self._told[k] or 1,):
                in_tool = self._given.apply(self.seen_mm[k] * np.array([1.0, side, 1.0]))
                found.append(self._rotations[k] @ in_tool + self._places[k])
        return found

    def at(self, tool: RigidTransform, center: FloatArray) -> _End:
        """Return a guess with the sides as it expects them."""
        expected = self._expected(tool, center)
        sides = np.where(self._open, np.where(expected[:, 1] < 0, -1, 1), self._told)
        return _End(tool, center, sides, np.inf)

    def settled(self, guess: _End) -> _End:
        """Return a guess fitted, the sides following, until they stay."""
        for _ in range(_ROUNDS):
            fitted = self._stepped(self._stepped(guess))
            moved = self.at(fitted.tool, fitted.center)
            if np.array_equal(moved.sides, guess.sides) and guess.cost - fitted.cost < 1e-3:
                return fitted
            guess = _End(moved.tool, moved.center, moved.sides, fitted.cost)
        return self._stepped(guess)

    def flipped(self, best: _End) -> list[_End]:
        """Return fits with each capture that is near the plane of light on its other side."""
        found: list[_End] = []
        for k in np.flatnonzero(self._open & (np.abs(self.seen_mm[:, 1]) < _NEAR_MM)).tolist():
            sides = best.sides.copy()
            sides[k] *= -1
            end = _End(best.tool, best.center, sides, np.inf)
            for _ in range(_FLIP_ROUNDS):
                end = self._stepped(end)
            found.append(end)
        return found

    def _expected(self, tool: RigidTransform, center: FloatArray) -> FloatArray:
        in_tool = np.einsum("kji,kj->ki", self._rotations, center - self._places)
        return (in_tool - tool.translation_mm) @ tool.rotation

    def _stepped(self, end: _End) -> _End:
        """Return a fit after one robust Gauss–Newton step, its sides held."""
        expected = self._expected(end.tool, end.center)
        off = self.seen_mm - expected
        off[:, 1] = self.seen_mm[:, 1] * np.where(end.sides == 0, 1, end.sides) - expected[:, 1]
        squared = np.einsum("ki,kij,kj->k", off, self._precision, off)
        weight = self._precision / (1 + squared / _CUTOFF**2)[:, None, None]
        by_center = np.swapaxes(self._rotations @ end.tool.rotation, 1, 2)
        shifted = np.broadcast_to(-end.tool.rotation.T, by_center.shape)
        design = np.concatenate([by_center, skew(expected), shifted], axis=2)
        turned = np.swapaxes(design, 1, 2) @ weight
        deviation = self._given.difference(end.tool)
        information, slope = (turned @ design).sum(axis=0), (turned @ off[..., None]).sum(axis=0)[:, 0]
        information[3:, 3:] += self._prior
        slope[3:] -= self._prior @ deviation
        step = np.linalg.solve(information + 1e-12 * np.trace(information) * np.eye(9), slope)
        cost = float(_CUTOFF**2 * np.log1p(squared / _CUTOFF**2).sum() + deviation @ self._prior @ deviation)
        return _End(end.tool.perturbed(step[3:]), end.center + step[:3], end.sides, cost)


def _precision(o: SphereObservation, sphere: SphereSize, tool: Tool) -> FloatArray:
    """Return the inverse covariance (3, 3) of a capture's own centre in L on one side."""
    noise = np.asarray(o.center_covariance, dtype=float)[:3, :3] * o.points_per_independent
    if o.circle_radius_mm is not None:  # of a profile x, z and the circle's radius, which tells y
        height = np.sqrt(max(sphere.radius_mm**2 - o.circle_radius_mm**2, (0.05 * sphere.radius_mm) ** 2))
        rows = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, o.circle_radius_mm / height], [0.0, 1.0, 0.0]])
        noise = rows @ noise @ rows.T
    seen = tool.mount_from_laser.apply(o.center_in_laser_mm)
    lever = float(np.linalg.norm(seen if o.carriers.over_robot > 0 else o.ball_from_scanner.apply(seen)))
    own = max(_SCATTER_MM, float(np.hypot(tool.position_sigma_mm, tool.orientation_sigma_rad * lever)))
    return np.asarray(np.linalg.inv(noise + own**2 * np.eye(3)), dtype=float)
