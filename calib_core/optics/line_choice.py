"""Which of the lines that the boards offer lie in one plane: the plane of light's."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.optics.board_lines import Trace

_MOST_PAIRS = 3000
_LEAST_VIEWS = 3
_LOG_CHANCE = -3.0  # one session in a thousand takes what no laser laid
_OFF_SHARE = 0.003  # of the distance: boards' poses are off by less
_DOUBTFUL_WEIGHT = 0.2
_MOST_WEIGHT = 30.0
_STRAY_SCATTERS = 6.0
_STRAY_WIDTHS = 3.0  # one laser's line is as wide on every board, grazing ones apart
_OWN_VIEWS = 3  # at so many boards' one place a line that no plane explains is the board's own


@dataclass(frozen=True, eq=False)
class PlacedTrace:
    """A line on a board with where its ends are in the camera's frame, and how far off the plane these may be.

    Attributes
    ----------
    chance : float
        How often a line that lies anywhere on the sheet is in a given plane.
    on_board_mm : (2, 3) or None
        Where its ends are on the board; None where it is not known which of the board's corners are seen.
    """

    trace: Trace
    ends_mm: FloatArray
    off_mm: float
    chance: float
    on_board_mm: FloatArray | None = None

    @classmethod
    def of(
        cls, trace: Trace, points_mm: FloatArray, board_from_camera: RigidTransform | None = None
    ) -> "PlacedTrace":
        """Return the trace whose points (N, 3) on the line are given."""
        center = points_mm.mean(axis=0)
        direction = np.linalg.svd(points_mm - center, full_matrices=False)[2][0]
        low, high = np.percentile((points_mm - center) @ direction, [5, 95])
        off = _OFF_SHARE * float(np.linalg.norm(center))
        both_ends = min(2 * off / trace.room_mm, 1.0) ** 2
        ends = center + np.outer([low, high], direction)
        return cls(
            trace, ends, off, both_ends, None if board_from_camera is None else board_from_camera.apply(ends)
        )

    @property
    def weight(self) -> float:
        """How much it counts."""
        return min(-self.trace.log_chance, _MOST_WEIGHT) * (_DOUBTFUL_WEIGHT if self.trace.is_doubtful else 1.0)


def choose_traces(views: Sequence[Sequence[PlacedTrace]]) -> tuple[list[Trace | None], list[int]]:
    """Return each view's line, and the views whose lines lie in one plane; of others the surest line is told."""
    every, own = _apart_from_own_lines(views)
    views = [[placed for number, placed in every if number == view] for view in range(len(views))]
    agrees = _in_one_plane(every, len(views))
    offered: dict[int, list[PlacedTrace]] = {}
    for (number, placed), fits in zip(every, agrees, strict=True):
        if fits:
            offered.setdefault(number, []).append(placed)
    best = {number: max(here, key=_rank) for number, here in offered.items()}
    best |= _in_the_plane(own, best)
    chosen: list[Trace | None] = [None] * len(views)
    for number, first in best.items():
        # A line is seen in several ways: one that is far too wide, as along the other axis, spoils no other.
        fine = [placed for placed in offered.get(number, [first]) if not _strays(best, number, placed)]
        if fine:
            chosen[number] = max(fine, key=_rank).trace
    found = [one for one in chosen if one is not None]
    sure = sum(one.is_sure for one in found)
    # Patterns of many boards lie in some plane by chance: lines that are not sure count where chance does not
    # explain that so many agree.
    supported = len(found) >= _LEAST_VIEWS and (
        sure >= len(found) / 2 or _log_chance_of_plane(views, len(found)) < _LOG_CHANCE
    )
    if not supported:
        chosen = [None] * len(views)
    agreeing = [number for number, trace in enumerate(chosen) if trace is not None]
    for number, view in enumerate(views):
        others = [one.trace for one in view if one.trace.is_sure]
        if chosen[number] is None and others:
            chosen[number] = min(others, key=lambda one: one.log_chance)
    return chosen, agreeing


def _apart_from_own_lines(
    views: Sequence[Sequence[PlacedTrace]],
) -> tuple[list[tuple[int, PlacedTrace]], list[tuple[int, PlacedTrace]]]:
    """Return the lines by view, and apart those of the boards' own: tape, a print, an edge of the pattern.

    These lie at one place of several boards and in no plane.
    """
    lines: list[tuple[int, PlacedTrace]] = []
    own: list[tuple[int, PlacedTrace]] = []
    every = [(number, placed) for number, view in enumerate(views) for placed in view]
    for (number, placed), there in zip(every, _at_one_place([placed for _, placed in every]), strict=True):
        alike = {number: placed}
        for index in np.flatnonzero(there):
            alike.setdefault(*every[index])
        is_own = len(alike) >= _OWN_VIEWS and not _lie_in_a_plane(list(alike.values()))
        (own if is_own else lines).append((number, placed))
    return lines, own


def _in_the_plane(
    own: Sequence[tuple[int, PlacedTrace]], best: Mapping[int, PlacedTrace]
) -> dict[int, PlacedTrace]:
    """Return lines of further views that lie in the others' plane after all: light where the board has a line."""
    if len(best) < _LEAST_VIEWS:
        return {}
    ends = np.concatenate([placed.ends_mm for placed in best.values()])
    normals, distances = _planes(ends[None])
    return {
        number: placed
        for number, placed in own
        if number not in best and np.abs(placed.ends_mm @ normals[0] - distances[0]).max() <= placed.off_mm
    }


def _at_one_place(lines: Sequence[PlacedTrace]) -> np.ndarray:
    """Return which of lines are the same one of their boards, (T, T): the ends of each lie on the other."""
    nowhere = np.full((2, 3), np.nan)
    ends = np.array([nowhere if one.on_board_mm is None else one.on_board_mm for one in lines]).reshape(-1, 2, 3)
    off = np.array([one.off_mm for one in lines])
    along = ends[:, 1] - ends[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    beside = np.array(
        [
            np.linalg.norm(np.cross(ends - start, way), axis=2).max(axis=1)
            for start, way in zip(ends[:, 0], along, strict=True)
        ]
    ).reshape(len(lines), len(lines))
    return np.maximum(beside, beside.T) <= np.maximum.outer(off, off)


def _lie_in_a_plane(placed: Sequence[PlacedTrace]) -> bool:
    ends = np.concatenate([one.ends_mm for one in placed])
    normals, distances = _planes(ends[None])
    return float(np.abs(ends @ normals[0] - distances[0]).max()) <= max(one.off_mm for one in placed)


def _rank(placed: PlacedTrace) -> tuple[bool, float]:
    return placed.trace.rank


def _strays(best: Mapping[int, PlacedTrace], number: int, here: PlacedTrace) -> bool:
    """Return whether a view's line that is not sure is far wider than the others or off their plane as none is."""
    others = [placed for view, placed in best.items() if view != number]
    sure = [placed for placed in others if placed.trace.is_sure]
    others = sure if len(sure) >= _LEAST_VIEWS else others
    if here.trace.is_sure or len(others) < _LEAST_VIEWS:
        return False
    if here.trace.width_mm > _STRAY_WIDTHS * float(np.median([placed.trace.width_mm for placed in others])):
        return True
    ends = np.concatenate([placed.ends_mm for placed in others])
    normals, distances = _planes(ends[None])
    usual = float(np.sqrt(np.mean((ends @ normals[0] - distances[0]) ** 2)))
    off = float(np.abs(here.ends_mm @ normals[0] - distances[0]).max())
    return off > _STRAY_SCATTERS * max(usual, here.trace.scatter_mm)


def _log_chance_of_plane(views: Sequence[Sequence[PlacedTrace]], agreeing: int) -> float:
    """Return the decimal logarithm of how many planes in which so many views agree chance would give.

    Two views' lines lay one; each further view has a line in it as often as its lines' chances say.
    """
    from scipy.special import betainc

    lines = np.array([len(view) for view in views])
    pairs = (lines.sum() ** 2 - (lines**2).sum()) / 2
    share = float(np.mean([1 - np.prod([1 - one.chance for one in view]) for view in views if view]))
    others, more = int((lines > 0).sum()) - 2, agreeing - 2
    tail = float(betainc(more, others - more + 1, min(share, 0.999)))
    return float(np.log10(max(pairs, 1.0)) + np.log10(max(tail, 1e-300)))


def _in_one_plane(every: Sequence[tuple[int, PlacedTrace]], views: int) -> np.ndarray:
    """Return which lines (T,) lie in the plane that most of the views' evidence agrees on."""
    if len({number for number, _ in every}) < _LEAST_VIEWS:
        return np.zeros(len(every), dtype=bool)
    owner = np.array([number for number, _ in every])
    ends = np.array([placed.ends_mm for _, placed in every])
    off = np.array([placed.off_mm for _, placed in every])
    weight = np.array([placed.weight for _, placed in every])
    first, second = _pairs(owner)
    best, best_score = np.zeros(len(every), dtype=bool), 0.0
    for start in range(0, len(first), 200):
        some = slice(start, start + 200)
        four = np.concatenate([ends[first[some]], ends[second[some]]], axis=1)
        normals, distances = _planes(four)
        away = np.abs(np.einsum("tek,pk->pte", ends, normals) - distances[:, None, None]).max(axis=2)
        fits = away <= off
        own = fits[np.arange(len(four)), first[some]] & fits[np.arange(len(four)), second[some]]
        scores = np.zeros((len(four), views))
        for trace in range(len(every)):
            np.maximum(scores[:, owner[trace]], fits[:, trace] * weight[trace], out=scores[:, owner[trace]])
        total = scores.sum(axis=1) * own
        place = int(np.argmax(total))
        if total[place] > best_score:
            best, best_score = fits[place], float(total[place])
    for _ in range(2):
        if best.sum() < 2:
            break
        normals, distances = _planes(ends[best].reshape(1, -1, 3))
        best = np.abs(ends @ normals[0] - distances[0]).max(axis=1) <= off
    return best


def _pairs(owner: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of lines of different views, some of them where there are many."""
    first, second = np.triu_indices(len(owner), 1)
    apart = owner[first] != owner[second]
    first, second = first[apart], second[apart]
    if len(first) > _MOST_PAIRS:
        some = np.random.default_rng(0).choice(len(first), _MOST_PAIRS, replace=False)
        first, second = first[some], second[some]
    return first, second


def _planes(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the planes' normals (P, 3) and distances (P,) nearest to points (P, N, 3)."""
    centers = points.mean(axis=1)
    normals = np.linalg.svd(points - centers[:, None], full_matrices=False)[2][:, 2]
    return normals, (normals * centers).sum(axis=1)
