"""Where the fit starts while axes carry the robot: how each of them lies, from the balls' centres alone.

Given the directions of the rotary axes and the scanner's rotation, all else is linear: where balls and axes are,
and the ways of linear axes.  So directions are tried from everywhere, each with many rotations, by x and z of the
centres; the best guesses are refined with their directions free.  The robot's poses, moved by axes that are found,
are those of a robot that stands still.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calib_core.cell.layout import AxisState, Layout, MovedAxis
from calib_core.cell.walk import foot_moves
from calib_core.chain.axes_start import turns_about
from calib_core.chain.guesses import random_rotations
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.spread import robust_costs
from calib_core.chain.start import Centers, Start, centers_of, find_starts
from calib_core.frames import FloatArray, RigidTransform, nearest_rotation, rotation_from_vector, skew, with_third

_ROTATIONS, _ROUNDS = 48, 8
_KEPT, _STEPS = 12, 40
_LEAST_TRIED = 288
_LIKELY, _OTHER = 3, 0.1
_SCALE_SIGMA = 0.02
_FOOT_ROUNDS, _SURE_MM = 2, 0.5
_MOST_TRIED = 700
_SEARCH_CAPTURES = 40
_LEAST_SCALE_MM = 0.3
_TURN_STEP = 1e-5
_RIDGE, _DAMPING = 1e-9, 1e-3


@dataclass(frozen=True, eq=False)
class Foot:
    """The axes (A) that carry the robot, from base outwards, and where they stood in K captures (K, A)."""

    axes: tuple[MovedAxis, ...]
    readings: FloatArray

    def chosen(self, which: np.ndarray) -> "Foot":
        """Return the same of some captures."""
        return replace(self, readings=self.readings[which])


@dataclass(frozen=True, eq=False)
class _Guess:
    """Directions of rotary axes by their places among the axes; the scanner's rotation; all that is linear."""

    ways: dict[int, FloatArray]
    rotation: FloatArray
    linear: FloatArray
    cost: float


def foot_axes(
    observations: Observations, sphere: SphereSize, layout: Layout
) -> tuple[tuple[AxisState, ...], Start]:
    """Return how the axes under the robot lie by one scanner's captures of one ball, and its start by them."""
    readings = np.array([[o.readings.get(axis.name, 0.0) for axis in layout.axes] for o in observations])
    given = centers_of(observations, sphere), Foot(layout.axes, readings), observations[0].carriers.over_robot
    found: list[tuple[tuple[AxisState, ...], Start]] = []
    for axes in find_feet(*given):
        start = find_starts(centers_of(on_foot(observations, layout, axes), sphere))[0]
        for _ in range(_FOOT_ROUNDS):
            axes = better_foot(*given, axes, start)
            start = find_starts(centers_of(on_foot(observations, layout, axes), sphere))[0]
        found.append((axes, start))
        if start.scatter_mm < _SURE_MM:
            break
    return min(found, key=lambda one: one[1].scatter_mm)


def feet_of(
    observations: Observations, sphere: SphereSize, layout: Layout, groups: Sequence[np.ndarray]
) -> tuple[tuple[AxisState, ...], float]:
    """Return how the axes under the robot lie by the scanner whose captures they bring together best; how well.

    `groups`: captures of each scanner.
    """
    found: list[tuple[tuple[AxisState, ...], float]] = []
    for some in sorted(groups, key=len, reverse=True):
        axes, start = foot_axes([observations[k] for k in some], sphere, layout)
        found.append((axes, start.scatter_mm))
        if start.scatter_mm < _SURE_MM:
            break
    return min(found, key=lambda one: one[1])


def on_foot(observations: Observations, layout: Layout, axes: Sequence[AxisState]) -> list[SphereObservation]:
    """Return observations with the robot's poses as the axes under it have moved them."""
    readings = np.array([[o.readings.get(axis.name, 0.0) for axis in layout.axes] for o in observations])
    feet = zip(*foot_moves(layout.axes, axes, readings), strict=True)
    return [
        replace(o, base_from_tool0=RigidTransform.of(turn, shift, "base", "base") @ o.base_from_tool0)
        for o, (turn, shift) in zip(observations, feet, strict=True)
    ]


def find_feet(centers: Centers, foot: Foot, over_robot: int) -> list[tuple[AxisState, ...]]:
    """Return how the axes lie by one scanner's captures of one ball: a few guesses, the likeliest first.

    Parameters
    ----------
    centers : Centers
    foot : Foot
        Of the same captures.
    over_robot : {1, -1}
        Whether the flange carries the scanner, or the ball.
    """
    count = len(centers.measured)
    some = np.unique(np.linspace(0, count - 1, min(count, _SEARCH_CAPTURES)).astype(int))
    seen = _Seen(centers.chosen(some), foot.chosen(some), over_robot)
    rotary = [a for a, axis in enumerate(foot.axes) if axis.kind == "rotary"]
    every = [dict(zip(rotary, ways, strict=True)) for ways in product(_ways(len(rotary)), repeat=len(rotary))]
    many = max(_ROTATIONS, _LEAST_TRIED // len(every))
    tried = sorted((one for ways in every for one in seen.searched(ways, many)), key=lambda one: one.cost)
    best = sorted((seen.refined(one) for one in tried[:_KEPT]), key=lambda one: one.cost)
    others = [one for one in best[1:] if abs(one.cost - best[0].cost) > _OTHER]
    return [seen.axes(one) for one in (best[0], *others[: _LIKELY - 1])]


def better_foot(
    centers: Centers, foot: Foot, over_robot: int, axes: Sequence[AxisState], start: Start
) -> tuple[AxisState, ...]:
    """Return how the axes lie once the start tells on which side of the plane of light each ball is."""
    signed = centers.measured.copy()
    signed[:, 1] = np.where(start.sides == 0, signed[:, 1], np.abs(signed[:, 1]) * start.sides)
    seen = _Seen(replace(centers, measured=signed, open_side=np.zeros(len(signed), dtype=bool)), foot, over_robot)
    ways = {a: at.rotation[:, 2] for a, at in enumerate(axes) if foot.axes[a].kind == "rotary"}
    own = [at.origin if a in ways else at.rotation[:, 2] for a, at in enumerate(axes)]
    linear = np.concatenate([start.center, *own, start.rotation.T @ start.translation])
    return seen.axes(seen.refined(_Guess(ways, start.rotation, linear, np.inf)))


def _ways(axes: int) -> FloatArray:
    """Return directions all over the sphere, the fewer the more axes are to be combined."""
    grid = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    for least in (1, 2):
        some = grid[np.abs(grid).sum(axis=1) != least + 1] if len(grid) ** axes > _MOST_TRIED else grid
        grid = some
    return grid / np.linalg.norm(grid, axis=1)[:, None]


class _Seen:
    """Captures to which guesses are fitted."""

    def __init__(self, centers: Centers, foot: Foot, over_robot: int) -> None:
        self._foot, self._over = foot, over_robot
        self._measured = centers.measured
        self._weight = np.ones_like(centers.measured)
        self._weight[:, 1] = np.where(centers.open_side, 0.0, centers.height_weight)
        back = np.swapaxes(centers.rotations, 1, 2)
        moved = -np.einsum("kij,kj->ki", back, centers.translations)
        # base_from_tool0 of a ball on the flange, tool0_from_base of one in base
        self._rotations, self._translations = back, moved

    def searched(self, ways: dict[int, FloatArray], many: int) -> list[_Guess]:
        """Return the best few guesses with directions that are given, of so many rotations."""
        parts, fixed = self._parts(ways)
        rotations = random_rotations(many)
        linear = self._linear(parts, fixed, rotations, np.ones((len(rotations), len(parts))))
        off = self._off(parts, fixed, rotations, linear)
        for _ in range(_ROUNDS):
            rotations, linear = self._stepped(parts, fixed, rotations, linear, off)
            off = self._off(parts, fixed, rotations, linear)
        costs = robust_costs(np.linalg.norm(off, axis=2))
        return [_Guess(ways, rotations[n], linear[n], float(costs[n])) for n in np.argsort(costs)[: many // 24]]

    def refined(self, guess: _Guess) -> _Guess:
        """Return a guess refined with its directions free."""
        damping, guess = _DAMPING, replace(guess, cost=guess.cost + self._stretched(guess))
        for _ in range(_STEPS):
            turns, columns, off = self._derived(guess)
            weight = 1 / (1 + (np.linalg.norm(off, axis=1) / self._scale(off)) ** 2)
            rows = columns.reshape(-1, columns.shape[2])
            weighted = rows * np.repeat(weight, 3)[:, None]
            normal, slope = weighted.T @ rows, weighted.T @ off.ravel()
            for a, unit, stretch in self._ways_of(guess):
                own = 2 * len(guess.ways) + 6 + 3 * a + np.arange(3)
                pull = 1 / np.sqrt(1 + stretch**2)
                normal[np.ix_(own, own)] += pull * np.outer(unit, unit) / _SCALE_SIGMA**2
                slope[own] += pull * unit * stretch / _SCALE_SIGMA
            normal += damping * np.diag(np.diag(normal)) + _RIDGE * np.trace(normal) * np.eye(len(normal))
            step = -np.linalg.solve(normal, slope)
            trial = self._moved(guess, turns, step)
            gain = guess.cost - trial.cost
            damping = damping / 5 if gain > 0 else damping * 10
            guess = trial if gain > 0 else guess
            if damping > 1e6 or 0 < gain < 1e-6:
                break
        return guess

    def _ways_of(self, guess: _Guess) -> list[tuple[int, FloatArray, float]]:
        """Return the linear axes' directions, and by how many standard deviations their scales are not one."""
        ways = [
            (a, guess.linear[3 + 3 * a : 6 + 3 * a]) for a in range(len(self._foot.axes)) if a not in guess.ways
        ]
        lengths = [max(float(np.linalg.norm(way)), 1e-9) for _, way in ways]
        return [(a, way / n, (n - 1) / _SCALE_SIGMA) for (a, way), n in zip(ways, lengths, strict=True)]

    def _stretched(self, guess: _Guess) -> float:
        return sum(float(np.sqrt(1 + stretch**2)) - 1 for _, _, stretch in self._ways_of(guess))

    def axes(self, guess: _Guess) -> tuple[AxisState, ...]:
        """Return the axes of a guess."""
        found: list[AxisState] = []
        for a in range(len(self._foot.axes)):
            own = guess.linear[3 + 3 * a : 6 + 3 * a]
            if a in guess.ways:
                found.append(AxisState(with_third(guess.ways[a]), own))
            else:
                found.append(AxisState(with_third(own / max(float(np.linalg.norm(own)), 1e-9)), np.zeros(3)))
        return tuple(found)

    def _parts(self, ways: dict[int, FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Return how the ball moves before the scanner's carrier with what is linear, (K, 3, m), and the rest."""
        axes, readings = self._foot.axes, self._foot.readings
        parts = np.zeros((len(readings), 3, 3 + 3 * len(axes)))
        parts[:, :, :3], fixed = np.eye(3), np.zeros((len(readings), 3))
        if self._over < 0:
            parts, fixed = self._rotations @ parts, self._translations.copy()
        outwards = range(len(axes))
        for a in outwards if self._over > 0 else reversed(outwards):
            own, amount = slice(3 + 3 * a, 6 + 3 * a), -self._over * readings[:, a]
            if axes[a].kind == "linear":
                parts[:, :, own] += amount[:, None, None] * np.eye(3)
                continue
            turn = turns_about(ways[a], amount)
            parts, fixed = turn @ parts, np.einsum("kij,kj->ki", turn, fixed)
            parts[:, :, own] += np.eye(3) - turn
        if self._over > 0:
            parts = self._rotations @ parts
            fixed = np.einsum("kij,kj->ki", self._rotations, fixed) + self._translations
        return parts, fixed

    def _off(self, parts: FloatArray, fixed: FloatArray, rotations: FloatArray, linear: FloatArray) -> FloatArray:
        """Return what guesses (N) leave over of the centres in L, (N, K, 3), weighted."""
        places = np.einsum("kip,np->nki", parts, linear[:, :-3]) + fixed
        return (places @ rotations - linear[:, None, -3:] - self._measured) * self._weight

    def _linear(
        self, parts: FloatArray, fixed: FloatArray, rotations: FloatArray, weight: FloatArray
    ) -> FloatArray:
        """Return what is linear by least squares for rotations (N, 3, 3)."""
        columns = self._columns(parts, rotations)
        right = (self._measured - fixed @ rotations) * self._weight
        return _solved(columns, right, weight)

    def _columns(self, parts: FloatArray, rotations: FloatArray) -> FloatArray:
        """Return how centres in L follow what is linear, (N, K, 3, m), weighted."""
        turned = np.einsum("nji,kjp->nkip", rotations, parts)
        shifts = np.broadcast_to(-np.eye(3), (*turned.shape[:2], 3, 3))
        return np.concatenate([turned, shifts], axis=3) * self._weight[None, :, :, None]

    def _stepped(
        self, parts: FloatArray, fixed: FloatArray, rotations: FloatArray, linear: FloatArray, off: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return guesses after one step of all, with a robust loss."""
        places = (np.einsum("kip,np->nki", parts, linear[:, :-3]) + fixed) @ rotations
        turns = skew(places) * self._weight[None, :, :, None]
        columns = np.concatenate([turns, self._columns(parts, rotations)], axis=3)
        apart = np.linalg.norm(off, axis=2)
        scale = np.maximum(3 * np.median(apart, axis=1), _LEAST_SCALE_MM)[:, None]
        step = _solved(columns, -off, 1 / (1 + (apart / scale) ** 2))
        length = np.linalg.norm(step[:, :3], axis=1)
        turn = np.array([rotation_from_vector(v) for v in step[:, :3] / np.maximum(length / 0.5, 1.0)[:, None]])
        rotations = nearest_rotation(rotations @ turn)
        return rotations, self._linear(parts, fixed, rotations, 1 / (1 + (apart / scale) ** 2))

    def _derived(self, guess: _Guess) -> tuple[list[int], FloatArray, FloatArray]:
        """Return the rotary axes, how centres follow all that is sought, (K, 3, …), and what is left over."""
        parts, fixed = self._parts(guess.ways)
        one, own = guess.rotation[None], guess.linear[None]
        off = self._off(parts, fixed, one, own)[0]
        places = (parts @ guess.linear[:-3] + fixed) @ guess.rotation
        turns = skew(places) * self._weight[:, :, None]
        tilts: list[FloatArray] = []
        for a, way in guess.ways.items():
            for across in with_third(way)[:, :2].T:
                there = {**guess.ways, a: _tilted(way, _TURN_STEP * across)}
                tilts.append((self._off(*self._parts(there), one, own)[0] - off) / _TURN_STEP)
        stack = np.stack(tilts, axis=2) if tilts else np.zeros((*off.shape, 0))
        return [*guess.ways], np.concatenate([stack, turns, self._columns(parts, one)[0]], axis=2), off

    def _moved(self, guess: _Guess, rotary: Sequence[int], step: FloatArray) -> _Guess:
        ways, count = dict(guess.ways), 2 * len(rotary)
        for n, a in enumerate(rotary):
            own = np.clip(step[2 * n : 2 * n + 2], -0.3, 0.3)
            ways[a] = _tilted(ways[a], with_third(ways[a])[:, :2] @ own)
        turn = step[count : count + 3]
        turn = turn / max(float(np.linalg.norm(turn)) / 0.3, 1.0)
        rotation = nearest_rotation(guess.rotation @ rotation_from_vector(turn))
        linear = guess.linear + step[count + 3 :]
        off = self._off(*self._parts(ways), rotation[None], linear[None])[0]
        there = _Guess(ways, rotation, linear, float(robust_costs(np.linalg.norm(off, axis=1))))
        return replace(there, cost=there.cost + self._stretched(there))

    @staticmethod
    def _scale(off: FloatArray) -> float:
        return max(3 * float(np.median(np.linalg.norm(off, axis=1))), _LEAST_SCALE_MM)


def _solved(columns: FloatArray, right: FloatArray, weight: FloatArray) -> FloatArray:
    """Return weighted least squares of N systems (N, K, 3, m), (N, K, 3)."""
    rows = columns.reshape(len(columns), -1, columns.shape[3])
    weighted = np.swapaxes(rows * np.repeat(weight, 3, axis=1)[:, :, None], 1, 2)
    normal = weighted @ rows
    ridge = _RIDGE * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(normal.shape[1])
    return np.linalg.solve(normal + ridge, weighted @ right.reshape(len(right), -1, 1))[..., 0]


def _tilted(way: FloatArray, by: FloatArray) -> FloatArray:
    return (way + by) / np.linalg.norm(way + by)
