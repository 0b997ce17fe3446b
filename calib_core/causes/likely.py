"""Whether poses alone tell that their convention is another: asked at the intake, before anything is measured.

All captures of a session look at one sphere from about the same distance. So a place in the flange's frame stays
near one place of the base, within what the scanner sees; read in a wrong convention it wanders.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.causes.readings import Reading, poses_of, readings
from calib_core.frames import FloatArray, RigidTransform
from calib_core.poses.conventions import CONVENTIONS
from calib_core.records import Cell

_FEWEST = 5
_MOST_LOOKED_AT = 60
_FARTHEST = 1e6
_A_TURN = 360.0
_BEFORE_OTHERS = 1.1  # the right order is told from the next best one
_CLEARLY = 1.8  # simulated and real sets: wrong conventions 1.9 to 9, right ones at most 0.87


@dataclass(frozen=True)
class LikelyConvention:
    """A convention by which poses look at one place far better.

    Attributes
    ----------
    convention : str
    spread_mm : float
        RMS distance of the place from its mean, read by `convention`.
    told_spread_mm : float or None
        The same as the poses are read now; None where they cannot be read so.
    """

    convention: str
    spread_mm: float
    told_spread_mm: float | None


def likely_convention(cell: Cell, rows: Sequence[Sequence[float]]) -> LikelyConvention | None:
    """Return the convention that poses (K rows of the cell's convention's count) are clearly written in instead.

    None where that of the cell does as well, where they are too few, or where they hardly turn.
    """
    now = CONVENTIONS[cell.pose_convention]
    if len(rows) < _FEWEST or any(len(row) != now.count for row in rows) or np.abs(rows).max() > _FARTHEST:
        return None
    told: float | None = None
    best: tuple[float, Reading] | None = None
    for spread_mm, reading in spreads_mm(cell, rows):
        spread = spread_mm / reading.mm_per_unit  # of one kind, whatever the unit
        if reading.convention == now:
            told = spread
        elif best is None or spread < best[0]:
            best = (spread, reading)
    if best is None or (told is not None and told < _CLEARLY * best[0]):
        return None
    unit_mm = best[1].mm_per_unit
    return LikelyConvention(best[1].convention.name, best[0] * unit_mm, None if told is None else told * unit_mm)


def spreads_mm(cell: Cell, rows: Sequence[Sequence[float]]) -> list[tuple[float, Reading]]:
    """Return how far the place that poses look at wanders, RMS, read in each way in which they can be read.

    Parameters
    ----------
    cell : Cell
        Its convention says how many numbers a pose has.
    rows : sequence of K sequences of float
    """
    looked_at = rows[:: -(-len(rows) // _MOST_LOOKED_AT)]
    found: list[tuple[float, Reading]] = []
    for reading in readings(cell, looked_at):
        if reading.way != "as-written" or reading.radians != Reading.told(reading.convention).radians:
            continue
        poses = poses_of(reading, looked_at)
        if poses is not None:
            found.append((_spread_mm(poses), reading))
    return found


@dataclass(frozen=True)
class LikelyColumns:
    """An order of a pose's numbers by which poses look at one place far better: columns that were swapped.

    Attributes
    ----------
    order : tuple of int
        The number k of the convention stands at place order[k].
    spread_mm, told_spread_mm : float
        RMS distance of the place from its mean, with that order and as they are read now.
    """

    order: tuple[int, ...]
    spread_mm: float
    told_spread_mm: float


def likely_columns(cell: Cell, rows: Sequence[Sequence[float]]) -> LikelyColumns | None:
    """Return the order in which poses of six numbers (K rows) clearly stand instead, with columns swapped.

    None where the cell's own order, or another convention, does nearly as well, where they are too few, or where
    they hardly turn.
    """
    now = CONVENTIONS[cell.pose_convention]
    bad = len(rows) < _FEWEST or now.count != 6 or any(len(row) != 6 for row in rows)
    if bad or np.abs(rows).max() > _FARTHEST:
        return None
    numbers = np.array(rows[:: -(-len(rows) // _MOST_LOOKED_AT)], dtype=float)
    reading = Reading.told(now)

    def spread(order: tuple[int, ...]) -> float:
        poses = poses_of(reading, numbers[:, list(order)].tolist())
        return np.inf if poses is None else _spread_mm(poses)

    told = spread((0, 1, 2, 3, 4, 5))
    (best, order), (second, _), *_ = sorted((spread(order), order) for order in _orders(numbers))
    convention = likely_convention(cell, rows)
    if not np.isfinite(told) or told < _CLEARLY * best or second < _BEFORE_OTHERS * best:
        return None
    if convention is not None and convention.spread_mm <= _CLEARLY * best:
        return None
    return LikelyColumns(order, best, told)


def _orders(numbers: FloatArray) -> list[tuple[int, ...]]:
    """Return the orders that are looked for: two places or two angles swapped, both, or the angles first."""
    swaps = [(0, 1, 2), (1, 0, 2), (0, 2, 1), (2, 1, 0)]
    both = [(*a, *(3 + k for k in b)) for a in swaps for b in swaps][1:]
    # Only what is no angle can be a place that stands where the angles should.
    angles_first = np.abs(numbers[:, :3]).max() <= _A_TURN < np.abs(numbers[:, 3:]).max()
    return [*both, (3, 4, 5, 0, 1, 2)] if angles_first else both


def _spread_mm(poses: Sequence[RigidTransform]) -> float:
    """Return how far the place of the flange's frame that stays nearest to one place of the base wanders, RMS."""
    left = np.vstack([np.hstack([pose.rotation, -np.eye(3)]) for pose in poses])
    right = -np.concatenate([pose.translation_mm for pose in poses])
    places = np.linalg.lstsq(left, right, rcond=None)[0]
    return float(np.sqrt(np.mean((left @ places - right) ** 2) * 3))
