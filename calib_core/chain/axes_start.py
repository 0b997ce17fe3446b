"""Where the fit of several axes starts: their directions and places from the balls' own centres in base.

Given the directions of the rotary axes, all else is linear: where axes and balls are, and the way of linear axes.
So directions are tried from everywhere, each profile on the side that is nearer, with a robust loss; the best few
guesses are refined with their directions free.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Final

import numpy as np

from calib_core.cell.layout import AxisState, MovedAxis
from calib_core.cell.walk import Position, Walk, foot_moves
from calib_core.chain.spread import AGREE_MM, robust_costs
from calib_core.errors import MotionError
from calib_core.frames import FloatArray, skew, with_third
from calib_core.messages import templates

_ROUNDS, _REFINED, _STEPS = 6, 8, 25
_RIDGE = 1e-6
_DAMPING = 1e-4
_AT_REST = AxisState(np.eye(3), np.zeros(3), 0.0)
_FAR_MM = 20.0  # a guess whose median misfit is more is none
FITS_MM: Final = 2.0
"""A guess by readings in another unit whose misfit is less tells that unit."""
_UNITS: Final[Mapping[str, Mapping[str, float]]] = {
    "linear": {"inches": 25.4, "metres": 1000.0},
    "rotary": {"radians": float(np.rad2deg(1.0))},
}
"""By which readings in other units are to be multiplied."""
_NAMES: Final = templates({"inches": "inches", "metres": "metres", "radians": "radians"})
_IN_MM, _IN_DEGREES = templates((
    "readings of the axis '{name}' in mm",
    "readings of the axis '{name}' in degrees",
))  # fmt: skip


def axes_start(
    walk: Walk, centers: FloatArray, mounts: tuple[FloatArray, FloatArray], known: Mapping[str, AxisState]
) -> tuple[Position, FloatArray]:
    """Return the guess of axes and places on which most captures agree, and each capture's misfit (K,), mm.

    Parameters
    ----------
    walk : Walk
        Of K captures of balls on axes.
    centers : (K, 2, 3)
        The balls' possible centres in base, on either side of the plane of light.
    mounts : (S, 3, 3), (S, 3)
        Of the scanners, which are kept.
    known : mapping
        Axes under the robot, by their names.

    Raises
    ------
    MotionError
        If no guess fits.
    """
    best = axes_guesses(walk, centers, mounts, known)[0]
    if np.median(best[1]) > _FAR_MM:
        _require_units(walk, centers, mounts, known)
        raise MotionError(
            "captures that show how the axes {axes} move the ball",
            "no axes that fit better than {misfit:.0f} mm",
            "Check the readings of the axes, and that each mounting is one ball: give captures of another a "
            "`mount` of their own. Move one axis at a time between captures, then all together.",
            axes=", ".join(axis.name for axis in walk.layout.axes),
            misfit=float(np.median(best[1])),
        )
    return best


def _require_units(
    walk: Walk, centers: FloatArray, mounts: tuple[FloatArray, FloatArray], known: Mapping[str, AxisState]
) -> None:
    """Raise MotionError where readings of an axis fit in another unit than that of the record."""
    for readings, error in in_other_units(walk.layout.axes, walk.readings):
        misfits = axes_guesses(replace(walk, readings=readings), centers, mounts, known)[0][1]
        if np.median(misfits) < FITS_MM:
            raise error


def in_other_units(axes: Sequence[MovedAxis], readings: FloatArray) -> Iterator[tuple[FloatArray, MotionError]]:
    """Give readings (K, A) with those of all axes of a kind, or of one, in another unit, and what to say then."""
    for kind, units in _UNITS.items():
        own = [a for a, axis in enumerate(axes) if axis.kind == kind]
        one_by_one = [[a] for a in own]
        for some, (unit, factor) in product([own, *one_by_one] if len(own) > 1 else one_by_one, units.items()):
            other = readings.copy()
            other[:, some] *= factor
            if kind == "rotary" and np.ptp(other[:, some], axis=0).max() > 2 * np.pi:
                continue
            yield (
                other,
                MotionError(
                    _IN_MM if kind == "linear" else _IN_DEGREES,
                    "readings that fit in {unit}",
                    "Multiply them by {factor:g}.",
                    "cell.axes",
                    name=", ".join(axes[a].name for a in some), unit=_NAMES[unit], factor=factor,
                ),
            )  # fmt: skip


def axes_guesses(
    walk: Walk, centers: FloatArray, mounts: tuple[FloatArray, FloatArray], known: Mapping[str, AxisState]
) -> list[tuple[Position, FloatArray]]:
    """Return guesses as `axes_start` has them, however badly they fit, the best first."""
    axes = walk.layout.axes
    kept = {a: known[axis.name] for a, axis in enumerate(axes) if axis.name in known}
    rotary = [a for a, axis in enumerate(axes) if axis.kind == "rotary" and walk.layout.rides[:, a].any()]
    feet = [kept.get(a, _AT_REST) for a in range(len(axes))]
    turned, moved = foot_moves(axes, feet, walk.readings)
    on_foot = (walk.over_robot > 0)[:, None, None]
    in_ground = np.where(on_foot, np.einsum("kij,ksj->ksi", turned, centers) + moved[:, None], centers)
    every = [dict(zip(rotary, ways, strict=True)) for ways in product(_ways(), repeat=len(rotary))]
    tried = [_linear(walk, in_ground, ways) for ways in every]
    tried.sort(key=lambda one: one[1])
    best_few = [_position(walk, mounts, *guess, kept) for guess, _ in tried[:_REFINED]]
    found = [refined(walk, centers, one, [*kept]) for one in best_few]
    return sorted(found, key=lambda one: float(robust_costs(one[1])))


def _ways() -> FloatArray:
    """Return directions all over the sphere, (26, 3)."""
    grid = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    return grid / np.linalg.norm(grid, axis=1)[:, None]


_Guess = tuple[dict[int, FloatArray], FloatArray]


def _linear(walk: Walk, centers: FloatArray, ways: dict[int, FloatArray]) -> tuple[_Guess, float]:
    """Return places of balls and axes for directions of the rotary ones, and the robust cost."""
    layout = walk.layout
    rows, many = np.arange(len(centers)), len(layout.places)
    parts = np.zeros((len(centers), 3, 3 * (many + len(layout.axes))))
    for i in range(3):
        parts[rows, i, 3 * walk.place + i] = 1.0
    for a in reversed(range(len(layout.axes))):
        rides = np.flatnonzero(layout.rides[walk.place, a])
        if not len(rides):  # it carries the robot, or nothing that was seen
            continue
        own, reading = slice(3 * (many + a), 3 * (many + a) + 3), walk.readings[rides, a]
        if layout.axes[a].kind == "linear":
            parts[rides, :, own] += reading[:, None, None] * np.eye(3)
        else:
            turn = turns_about(ways[a], reading)
            parts[rides] = turn @ parts[rides]
            parts[rides, :, own] += np.eye(3) - turn
    seen, weight = centers.mean(axis=1), np.ones(len(centers))
    found, off = np.zeros(parts.shape[2]), np.zeros(len(centers))
    for _ in range(_ROUNDS):
        weighted = parts * weight[:, None, None]
        normal = np.einsum("kip,kiq->pq", weighted, parts)
        # Each unknown by its own size: readings far from zero must not pull what few millimetres of way tell.
        ridge = _RIDGE * np.diag(normal) + _RIDGE**2 * np.trace(normal)
        found = np.linalg.solve(normal + np.diag(ridge), np.einsum("kip,ki->p", weighted, seen))
        expected = parts @ found
        apart = np.linalg.norm(centers - expected[:, None], axis=2)
        seen, off = centers[rows, np.argmin(apart, axis=1)], apart.min(axis=1)
        weight = 1 / (1 + (off / max(3 * float(np.median(off)), 1.0)) ** 2)
    return (ways, found), float(robust_costs(off))


def turns_about(way: FloatArray, angles_rad: FloatArray) -> FloatArray:
    """Return the turns by angles (K,) about a direction (3,), (K, 3, 3)."""
    cross = skew(way)
    sine, cosine = np.sin(angles_rad)[:, None, None], np.cos(angles_rad)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def _position(
    walk: Walk,
    mounts: tuple[FloatArray, FloatArray],
    ways: dict[int, FloatArray],
    found: FloatArray,
    kept: Mapping[int, AxisState],
) -> Position:
    layout, vectors = walk.layout, found.reshape(-1, 3)
    many, axes = len(layout.places), list[AxisState]()
    for a in range(len(layout.axes)):
        own = vectors[many + a]
        if a in kept:
            axes.append(kept[a])
        elif a in ways:
            axes.append(AxisState(with_third(ways[a]), own))
        else:
            length = float(np.linalg.norm(own))
            axes.append(AxisState(with_third(own / length) if length > 0 else np.eye(3), np.zeros(3)))
    places = vectors[:many].copy()
    for n, a in zip(*np.nonzero(layout.owns), strict=True):
        places[n] = (places[n] - axes[a].origin) @ axes[a].rotation
    return Position(*mounts, places, tuple(axes))


def refined(walk: Walk, centers: FloatArray, at: Position, kept: Sequence[int]) -> tuple[Position, FloatArray]:
    """Return a guess with all axes and places free, damped Gauss–Newton with Cauchy's loss, and the misfits."""
    layout, rows = walk.layout, np.arange(len(centers))
    free = np.ones(layout.unknowns, dtype=bool)
    free[layout.of_mounts] = False
    free &= ~layout.fixed
    for a, axis in enumerate(layout.axes):
        if a in kept or axis.carries == "robot":
            free[layout.axis(a)] = False

    def look(position: Position) -> tuple[FloatArray, FloatArray, FloatArray]:
        expected, moves, _ = walk.balls(position)
        assert moves is not None
        apart = np.linalg.norm(centers - expected[:, None], axis=2)
        off = expected - centers[rows, np.argmin(apart, axis=1)]
        return off, moves[:, :, free], np.linalg.norm(off, axis=1)

    off, moves, misfit = look(at)
    damping = _DAMPING
    for _ in range(_STEPS):
        weight = 1 / (1 + (misfit / max(3 * float(np.median(misfit)), AGREE_MM)) ** 2)
        normal = np.einsum("k,kip,kiq->pq", weight, moves, moves)
        slope = np.einsum("k,kip,ki->p", weight, moves, off)
        damped = normal + damping * np.diag(np.diag(normal)) + 1e-9 * np.trace(normal) * np.eye(len(normal))
        step = np.zeros(layout.unknowns)
        step[free] = -np.linalg.solve(damped, slope)
        trial = at.moved(layout, np.clip(step, -layout.step_limit() * 3, layout.step_limit() * 3))
        there = look(trial)
        if robust_costs(there[2]) < robust_costs(misfit):
            at, (off, moves, misfit), damping = trial, there, damping / 5
        else:
            damping *= 10
    return at, misfit


def moved_back(walk: Walk, centers: FloatArray, at: Position) -> FloatArray:
    """Return arcs' possible centres (K, 2, 3) as they lie on what carries them."""
    zero, moves, _ = walk.balls(replace(at, places=np.zeros_like(at.places)))
    assert moves is not None
    columns = walk.layout.firsts[walk.place][:, None] + np.arange(3)
    turns = np.take_along_axis(moves, columns[:, None, :], axis=2)
    return np.einsum("kji,ksj->ksi", turns, centers - zero[:, None])
