"""Which capture has which pose: recorded poses handed out anew where some were swapped or shifted."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.causes.search import cost_of
from calib_core.frames import FloatArray

_MOST_COST = 6.0  # of a capture that fits no pose
_MOVED_COST = 1.5  # of giving a capture another one's pose: with so many to choose from, some fit by chance
_FITS = 5.0
_MISFITS = 3.0  # how much worse a capture has to fit its own pose than another's
_LEAST_OFF_MM = 0.5
_LONGEST_SEARCHED = 40


@dataclass(frozen=True, eq=False)
class Order:
    """Poses handed out: `pose_of` (K,) is the place of each capture's pose, −1 where none fits, `own` (K,) was."""

    pose_of: np.ndarray
    own: np.ndarray
    cost: float

    @property
    def moved(self) -> list[int]:
        """The captures that get another one's pose."""
        return [k for k, place in enumerate(self.pose_of.tolist()) if place not in (self.own[k], -1)]

    @property
    def lost(self) -> list[int]:
        """The captures whose pose went to another one and that fit none."""
        taken = set(self.pose_of.tolist())
        return [k for k, place in enumerate(self.pose_of.tolist()) if place == -1 and self.own[k] in taken]

    @property
    def swapped(self) -> bool:
        """Whether the moved captures go in pairs that exchange their poses."""
        given = dict(zip(self.own.tolist(), self.pose_of.tolist(), strict=True))
        return bool(self.moved) and all(given.get(given[self.own[k]]) == self.own[k] for k in self.moved)

    @property
    def step(self) -> int | None:
        """By how many places the poses are shifted, None where the moved captures do not agree on one."""
        moved = self.moved
        steps = [int(self.pose_of[k] - self.own[k]) for k in moved]
        usual = max(set(steps), key=steps.count) if steps else 0
        run = [k for k, step in zip(moved, steps, strict=True) if step == usual]
        whole = len(run) >= max(2, len(moved) - 1) and run == list(range(run[0], run[-1] + 1))
        return usual if usual and whole else None


def shifts(count: int) -> Iterator[np.ndarray]:
    """Give the ways in which poses from one capture on may belong to the one before or after, −1 for none."""
    if count > _LONGEST_SEARCHED:
        firsts: Sequence[int] = [0]
    else:
        firsts = range(count - 2)
    for first in firsts:
        for step in (1, -1):
            places = np.arange(count)
            places[first:] += step
            if step < 0:
                places[first] = -1
            places[places >= count] = -1
            yield places


def handed_out(misfits_mm: FloatArray, scale_mm: float, own: np.ndarray, allowed: bool = True) -> Order:
    """Return the poses handed out so that the captures fit best; every pose is given once.

    Parameters
    ----------
    misfits_mm : (K, N)
        Of captures (rows) at recorded poses (columns).
    scale_mm : float
    own : (K,)
        Which of the poses was recorded with each capture.
    allowed : bool, optional
        Whether captures may get another one's pose at all.
    """
    from scipy.optimize import linear_sum_assignment

    everyone = np.arange(len(misfits_mm))
    costs = np.minimum(cost_of(misfits_mm, scale_mm), _MOST_COST)
    as_told = costs[everyone, own]
    if not allowed:
        return Order(own, own, float(as_told.sum()))
    costs += _MOVED_COST
    costs[everyone, own] = as_told
    rows, places = linear_sum_assignment(costs)
    pose_of = own.copy()
    for capture, place in zip(rows.tolist(), places.tolist(), strict=True):
        if place == own[capture]:
            continue
        here, there = misfits_mm[capture, own[capture]], misfits_mm[capture, place]
        fits = there < _FITS * scale_mm and here > max(_LEAST_OFF_MM, _MISFITS * there)
        pose_of[capture] = place if fits else -1
    taken = set(pose_of[(pose_of != own) & (pose_of >= 0)].tolist())
    for capture in everyone.tolist():  # one that fits nothing better keeps its own, unless another one has that
        if pose_of[capture] == -1 and own[capture] not in taken:
            pose_of[capture] = own[capture]
    cost = np.where(pose_of == -1, _MOST_COST, costs[everyone, pose_of]).sum()
    return Order(pose_of, own, float(cost))


def whole_orders(names: Sequence[str]) -> list[tuple[str, np.ndarray]]:
    """Return the wrong orders in which a list of poses as a whole may stand, by what is said of them.

    Parameters
    ----------
    names : sequence of K str
        The captures, in the session's order.

    Returns
    -------
    list of (str, (K,))
        How, as the code `pose-list-order` says it, and the place of each capture's pose.
    """
    count = len(names)
    places = np.arange(count)
    by_text = _rank([str(k + 1) for k in range(count)], str)
    mixed = np.argsort(np.concatenate([places[::2], places[1::2]]))
    found = [
        ("names", by_text),
        ("captures", np.argsort(by_text)),
        ("names", _rank(names, str)),
        ("captures", _rank(names, _counted)),
        ("reversed", places[::-1].copy()),
        ("mixed", mixed),
        ("mixed", np.argsort(mixed)),
    ]
    steps = range(1, count) if count <= _LONGEST_SEARCHED else (1, count - 1)
    found += [("rotated", (places + step) % count) for step in steps]
    return [(said, order) for said, order in found if (order != places).any()]


def _rank(names: Sequence[str], key: Callable[[str], Any]) -> np.ndarray:
    """Return the place (K,) that each name has when all are sorted."""
    order = sorted(range(len(names)), key=lambda k: key(names[k]))
    return np.argsort(np.array(order))


def _counted(name: str) -> tuple[tuple[int, int | str], ...]:
    return tuple((0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", name) if part)
