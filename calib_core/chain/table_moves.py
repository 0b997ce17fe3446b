"""Whether the table, or the sphere on it, moved while it was captured.

A table that was pushed is elsewhere from some capture on: most likely from a mounting on, when hands were at it.
One that creeps goes on from the first capture to the last.  A sphere that was touched stands elsewhere on the
table for the rest of its mounting, and one whose clamp gives goes on through it.  Each is a score test.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final, Literal

import numpy as np

from calib_core.chain.incidents import by_place
from calib_core.chain.rejection import Judged
from calib_core.chain.score import Scores, more_than_chance
from calib_core.findings import Code, Finding
from calib_core.findings.codes import turntable as codes
from calib_core.frames import FloatArray

Moved = Literal["table-pushed", "table-creeps", "sphere-reseated", "clamp-gives"]

_CODES: Final[dict[Moved, Code]] = {
    "table-pushed": codes.TABLE_PUSHED,
    "table-creeps": codes.TABLE_CREEPS,
    "sphere-reseated": codes.SPHERE_RESEATED,
    "clamp-gives": codes.CLAMP_GIVES,
}
FAR_MM: Final = 5.0
"""How far a table, or a ball on it, is believed to move by mishap."""
_LEAST_MM: Final = 0.05
_LEAST_BESIDE: Final = 2  # captures on either side of a change: one alone is told by rejection
_RARE: Final[dict[Moved, float]] = {
    "table-pushed": 0.0003,
    "table-creeps": 0.001,
    "sphere-reseated": 0.0005,
    "clamp-gives": 0.0005,
}
"""How often a table that stands still may be taken to have moved so, over all places of a change."""
_AT_BORDERS: Final = 0.7  # of that chance is for pushes between two mountings


@dataclass(frozen=True, eq=False)
class TableMove:
    """One move: what moved, which captures of the table are after it, how far, and what it did to the answer.

    `rarity` is how often so much comes of chance, by what is left of the misfit, over how often it may be said
    falsely; `step` (P,) is by how much the unknowns move with it, and `share` how much of its square is more than
    chance.
    """

    kind: Moved
    captures: tuple[int, ...]
    shift_mm: float
    rarity: float
    step: FloatArray
    share: float

    @property
    def said(self) -> bool:
        """Whether chance does not explain it and it is large enough to matter."""
        return self.rarity < 1 and self.shift_mm > _LEAST_MM

    def finding(self, names: Sequence[str]) -> Finding:
        """Return what is noticed of it, of captures on all tables by their names."""
        own = [names[k] for k in self.captures]
        return _CODES[self.kind](own, shift_mm=self.shift_mm, since=own[0], until=own[-1])


@dataclass(frozen=True, eq=False)
class _Trial:
    kind: Moved
    captures: np.ndarray
    rows: FloatArray
    rare: float


def table_move_of(judged: Judged, count: int, scores: Scores) -> TableMove | None:
    """Return the move of a table that chance explains least, None where captures are too few to show one.

    Parameters
    ----------
    judged : Judged
        Of captures of tables, with others before them or alone.
    count : int
        How many of the last captures are the tables', in the order in which they were taken.
    scores : Scores
        Of the same.
    """
    layout, before = judged.data.walk.layout, judged.data.count - count
    tables = [a for a in layout.carrying if layout.axes[a].kind == "rotary" and layout.stands_alone(a)]
    found: list[TableMove] = []
    for trial in (trial for a in tables for trial in _trials(judged, a, before)):
        width = trial.rows.shape[2]
        gain, size, step = scores.gained(trial.rows, FAR_MM)
        rarity = scores.chance(gain, width) * len(tables) / trial.rare
        some, shift_mm = tuple((trial.captures - before).tolist()), float(np.linalg.norm(size))
        share = more_than_chance(gain, width)
        found.append(TableMove(trial.kind, some, shift_mm, rarity, step[: judged.data.width], share))
    return min(found, key=lambda one: one.rarity, default=None)


def _trials(judged: Judged, table: int, before: int) -> Iterator[_Trial]:
    """Yield every move of a table that is tried, with its share of the chance of a false one."""
    places = judged.data.walk.place
    own = np.flatnonzero(np.isin(places, judged.data.walk.layout.on_axis(table)))
    own = own[own >= before]
    count, number = len(own), np.full(judged.data.count, -1)
    number[own] = np.arange(count)
    heard = judged.used[own]
    runs = _runs(places[own])
    by_axis, by_ball = _by_table(judged, table), by_place(judged)

    def beside(first: int, start: int, end: int) -> bool:
        return all(int(np.count_nonzero(side)) >= _LEAST_BESIDE for side in (heard[start:first], heard[first:end]))

    borders = [start for start, _ in runs[1:] if beside(start, 0, count)]
    inside = [k for start, end in runs for k in range(start + 1, end) if beside(k, 0, count)]
    for some, share in ((borders, _AT_BORDERS), (inside, 1 - _AT_BORDERS)):
        for k in some:
            rows = by_axis * (number >= k)[:, None, None]
            rows = rows[:, :, :2] if some is borders else rows
            yield _Trial("table-pushed", own[k:], rows, share * _RARE["table-pushed"] / len(some))
    course = np.clip(number / max(count - 1, 1), 0.0, None)
    if beside(count // 2, 0, count):
        yield _Trial("table-creeps", own, by_axis * course[:, None, None], _RARE["table-creeps"])
    reseated = [(k, end) for start, end in runs for k in range(start + 1, end) if beside(k, start, end)]
    for k, end in reseated:
        rows = by_ball * ((number >= k) & (number < end))[:, None, None]
        yield _Trial("sphere-reseated", own[k:end], rows, _RARE["sphere-reseated"] / len(reseated))
    gives = [(start, end) for start, end in runs if beside((start + end) // 2, start, end)]
    for start, end in gives:
        weights = np.where((number >= start) & (number < end), (number - start) / max(end - 1 - start, 1), 0.0)
        rows = by_ball * weights[:, None, None]
        yield _Trial("clamp-gives", own[start:end], rows, _RARE["clamp-gives"] / len(gives))


def _runs(places: np.ndarray) -> list[tuple[int, int]]:
    """Return where each mounting begins and ends among captures in their order."""
    starts = [0, *(np.flatnonzero(np.diff(places)) + 1).tolist(), len(places)]
    return list(pairwise(starts))


def _by_table(judged: Judged, table: int) -> FloatArray:
    """Return how a shift of a table along its own axes moves each capture's expected sphere, (K, 3, 3)."""
    at, first = judged.fit.minimum.at, judged.data.walk.layout.axis(table).start
    along = by_place(judged)[:, :, 2:]  # a rotary axis carries its spheres along itself as it stands
    return np.concatenate([at.jacobian[:, :, first + 2 : first + 4], along], axis=2)
