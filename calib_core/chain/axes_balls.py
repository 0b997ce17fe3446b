"""Several balls that one axis carries in one mounting: which arc is of which, found together with the axes.

Balls of a plate lie near each other beside the way on which axes carry them.  So axes are sought first as if all
were one ball; turned back by these, arcs gather about their balls, well enough to tell them apart, and axes that
know the balls gather them better.  Balls all around a table do not lie so: an axis that alone moves what it
carries is sought by the circles of few arcs, too.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from calib_core.cell.layout import Layout
from calib_core.cell.walk import Position, Walk
from calib_core.chain.axes_start import moved_back, refined
from calib_core.chain.spread import robust_costs
from calib_core.chain.table import TableReadings
from calib_core.chain.table_start import best_start, has_circle
from calib_core.frames import FloatArray

_MOST_BALLS: Final = 4
_LEAST: Final = 3
"""Arcs of a ball; fewer tell nothing of it."""
_TOGETHER_MM: Final = 4.0
_ENOUGH: Final = 0.85
"""Of a mounting's arcs: where so many agree with its balls, there are no more balls."""
_TRIED, _SEEDS, _MIDDLES, _ROUNDS = 3, 12, 6, 6

Guess = tuple[Position, FloatArray]


def balls_on_axes(walk: Walk, centers: FloatArray, guesses: Sequence[Guess]) -> np.ndarray | None:
    """Return which ball of its mounting each arc is of, (K,) from 0 on, −1 where of none.

    None where one ball in each mounting explains them, or no balls do.

    Parameters
    ----------
    walk : Walk
        Of K arcs, one place for each mounting.
    centers : (K, 2, 3)
        Where their balls may be in base, on either side of the plane of light.
    guesses : sequence
        Axes and places as if each mounting had one ball, the best first, with misfits.
    """
    for at in (by_circles(walk, centers, guesses[0][0]), *(at for at, _ in guesses[:_TRIED])):
        ball, misfit = _told_apart(walk, centers, at)
        if np.mean(misfit < _TOGETHER_MM) > _ENOUGH:
            break
    else:
        return None
    if ball.max() == 0:
        return None
    ball = np.where(misfit < _TOGETHER_MM, ball, -1)
    numbered = np.full(len(ball), -1)
    for place in np.unique(walk.place):
        each = [
            (walk.place == place) & (ball == one) for one in dict.fromkeys(ball[walk.place == place]) if one >= 0
        ]
        for n, own in enumerate(own for own in each if own.sum() >= _LEAST):
            numbered[own] = n
    return numbered


def by_circles(walk: Walk, centers: FloatArray, at: Position) -> Position:
    """Return a guess with every rotary axis that alone moved what it carries where circles of few arcs have it."""
    layout, axes = walk.layout, list(at.axes)
    moving = layout.rides[walk.place] & (np.abs(walk.readings) > 0)
    for a in layout.carrying:
        alone = layout.rides[walk.place, a] & ~np.delete(moving, a, axis=1).any(axis=1)
        places, mounts = np.unique(walk.place[alone], return_inverse=True)
        readings = TableReadings(walk.readings[alone, a], mounts, len(places))
        if layout.axes[a].kind == "rotary" and has_circle(readings):
            axes[a] = best_start(readings, centers[alone]).state.axis
    return replace(at, axes=tuple(axes))


def _told_apart(walk: Walk, centers: FloatArray, at: Position) -> tuple[np.ndarray, FloatArray]:
    """Return the arcs' balls and how far each lies from its own, with one more ball where most do not fit."""
    ball, misfit = np.zeros(len(centers), dtype=int), np.full(len(centers), np.inf)
    counts = np.ones(len(walk.layout.places), dtype=int)
    for _ in range(len(counts) * (_MOST_BALLS - 1) + 1):
        for _ in range(_ROUNDS):
            before, ball = ball, _gathered(walk, centers, at, counts)
            split = _split(walk, ball)
            own = _placed(split, at, walk, centers)
            moved, misfit = refined(split, centers, own, [])
            at = _about_middles(walk, split, moved)
            if (before == ball).all():
                break
        fits = [np.mean(misfit[walk.place == n] < _TOGETHER_MM) for n in range(len(counts))]
        poor = [n for n, share in enumerate(fits) if share < _ENOUGH and counts[n] < _MOST_BALLS]
        if not poor:
            break
        counts[min(poor, key=lambda n: fits[n])] += 1
    return ball, misfit


def _gathered(walk: Walk, centers: FloatArray, at: Position, counts: np.ndarray) -> np.ndarray:
    """Return which ball of its mounting each arc is of, by axes that are known roughly."""
    back, ball = moved_back(walk, centers, at), np.zeros(len(centers), dtype=int)
    rng = np.random.default_rng(len(centers))
    for place in range(len(counts)):
        own = np.flatnonzero(walk.place == place)
        if counts[place] == 1 or len(own) < counts[place]:
            continue
        tried = [_middles(back[own], int(counts[place]), rng) for _ in range(_SEEDS)]
        ball[own] = min(tried, key=lambda one: one[0])[1]
    return ball


def _middles(both: FloatArray, count: int, rng: np.random.Generator) -> tuple[float, np.ndarray]:
    """Return the cost of a division of arcs (K, 2, 3) among so many middles, begun at random, and the division."""
    some = rng.choice(len(both), count, replace=False)
    middles = both[some, rng.integers(0, 2, count)]
    ball, off = np.zeros(len(both), dtype=int), np.zeros(len(both))
    for _ in range(_MIDDLES):
        apart = np.linalg.norm(both[:, None] - middles[None, :, None], axis=3)
        side = np.argmin(apart, axis=2)
        nearest = np.min(apart, axis=2)
        ball, off = np.argmin(nearest, axis=1), nearest.min(axis=1)
        seen = both[np.arange(len(both)), side[np.arange(len(both)), ball]]
        for n in np.unique(ball):
            middles[n] = np.median(seen[ball == n], axis=0)
    return float(robust_costs(off)), ball


def _split(walk: Walk, ball: np.ndarray) -> Walk:
    """Return the walk with a place for each ball of a mounting."""
    layout = walk.layout
    pairs = sorted(set(zip(walk.place.tolist(), ball.tolist(), strict=True)))
    places = tuple((layout.places[place][0], f"{layout.places[place][1]} {n}") for place, n in pairs)
    numbers = {pair: n for n, pair in enumerate(pairs)}
    own = np.array([numbers[pair] for pair in zip(walk.place.tolist(), ball.tolist(), strict=True)])
    return replace(walk, layout=Layout(layout.mounts, places, layout.axes), place=own)


def _placed(split: Walk, at: Position, walk: Walk, centers: FloatArray) -> Position:
    """Return the axes of a guess with each ball where its arcs lie."""
    back = moved_back(walk, centers, at)
    places = [middle_of_arcs(back[split.place == n]) for n in range(len(split.layout.places))]
    return replace(at, places=np.array(places))


def middle_of_arcs(both: FloatArray) -> FloatArray:
    """Return where most of one ball's arcs, of possible centres (K, 2, 3), have it."""
    flat = both.reshape(-1, 3)
    apart = np.linalg.norm(both[None] - flat[:, None, None], axis=3).min(axis=2)
    return flat[int(np.argmin(robust_costs(apart)))]


def _about_middles(walk: Walk, split: Walk, at: Position) -> Position:
    """Return a guess with one place for each mounting."""
    of = np.array([walk.place[split.place == n][0] for n in range(len(split.layout.places))])
    places = [at.places[of == n].mean(axis=0) for n in range(len(walk.layout.places))]
    return replace(at, places=np.array(places))
