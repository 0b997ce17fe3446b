"""Whether poses alone tell that their convention is another: asked at the intake, before anything is measured.

All captures of a session look at one sphere from about the same distance. So a place in the flange's frame stays
near one place of the base, within what the scanner sees; read in a wrong convention it wanders.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.causes.readings import Reading, poses_of, readings
from calib_core.frames import RigidTransform
from calib_core.records import Cell
from calib_core.robots import CONVENTIONS

_FEWEST = 5
_MOST_LOOKED_AT = 60
_FARTHEST = 1e6
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
    looked_at = rows[:: -(-len(rows) // _MOST_LOOKED_AT)]
    told: float | None = None
    best: tuple[float, Reading] | None = None
    for reading in readings(cell, looked_at):
        if reading.way != "as-written" or reading.radians != Reading.told(reading.convention).radians:
            continue
        poses = poses_of(reading, looked_at)
        if poses is None:
            continue
        spread = _spread_mm(poses) / reading.mm_per_unit  # of one kind, whatever the unit
        if reading.convention == now:
            told = spread
        elif best is None or spread < best[0]:
            best = (spread, reading)
    if best is None or (told is not None and told < _CLEARLY * best[0]):
        return None
    unit_mm = best[1].mm_per_unit
    return LikelyConvention(best[1].convention.name, best[0] * unit_mm, None if told is None else told * unit_mm)


def _spread_mm(poses: Sequence[RigidTransform]) -> float:
    """Return how far the place of the flange's frame that stays nearest to one place of the base wanders, RMS."""
    left = np.vstack([np.hstack([pose.rotation, -np.eye(3)]) for pose in poses])
    right = -np.concatenate([pose.translation_mm for pose in poses])
    places = np.linalg.lstsq(left, right, rcond=None)[0]
    return float(np.sqrt(np.mean((left @ places - right) ** 2) * 3))
