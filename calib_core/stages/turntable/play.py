"""Angles of the table that were captured again: what shows play that nothing else shows.

Play that is taken up from one side alone shifts angle zero, and every capture agrees.  Where an angle is captured
again after the table had been elsewhere, the sphere appears before or behind where it was.
"""

from collections import defaultdict

import numpy as np

from calib_core.findings import Finding
from calib_core.findings.codes import turntable as codes
from calib_core.messages import message
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.turntable.record import TurntableResidual, TurntableResult

ASK_FOR_PLAY = message("To check the table's play, capture an angle again, approached from the other side.")

TableLike = TurntableResult | ChainResult
_SAME_DEG = 0.01
_CELLS = 18_000  # of a turn
_BEYOND_CHANCE = 3.0
_LEAST_DEG = 0.01
_BY_MEDIAN = 1.4826  # a normal distribution's standard deviation by its median deviation


def play_findings(result: TableLike) -> list[Finding]:
    """Return what angles that were captured twice say of the table's play, or that nothing says it."""
    if result.reading_sigma_mm is not None:
        return []  # a linear axis: its captures have no angles
    rows = [row for row in result.residuals if isinstance(row, TurntableResidual) and row.used]
    found = [
        (abs(again.angle_deg - first.angle_deg), first, again)
        for first, again in _pairs(rows)
        if again.angle_deg is not None and first.angle_deg is not None
    ]
    if not found:
        return [codes.PLAY_NOT_CHECKED()]
    apart_deg, first, again = max(found, key=lambda one: one[0])
    names = [first.capture, again.capture]
    twice = {row.capture for _, *pair in found for row in pair}
    others = [row for row in rows if row.capture not in twice] or rows
    beyond = apart_deg > max(_BEYOND_CHANCE * np.sqrt(2) * _sigma_deg(result, others), _LEAST_DEG)
    return [(codes.TABLE_PLAY if beyond else codes.ANGLES_REPEAT)(names, apart_deg=apart_deg)]


def _pairs(rows: list[TurntableResidual]) -> list[tuple[TurntableResidual, TurntableResidual]]:
    """Return each capture of an angle that was captured before, beside the first one of that mounting."""
    found: list[tuple[TurntableResidual, TurntableResidual]] = []
    before = _Before()
    for k, again in enumerate(rows):
        first = before.first_same(again, rows)
        if first is not None and any(not _is_same(row, again) for row in rows[first:k]):
            found.append((rows[first], again))
        before.add(k, again)
    return found


class _Before:
    """The captures so far by their angles: each is compared with its neighbours alone."""

    def __init__(self) -> None:
        self._numbers: dict[tuple[str | None, int], list[int]] = defaultdict(list)
        self._angles: set[tuple[str | None, float]] = set()

    def first_same(self, again: TurntableResidual, rows: list[TurntableResidual]) -> int | None:
        """Return the number of the first capture of the same angle, None if there is none."""
        if again.table_deg is None:
            return None
        own = _cell(again.table_deg)
        near = [self._numbers.get((again.mount, (own + step) % _CELLS), []) for step in (-1, 0, 1)]
        same = (next((n for n in numbers if _is_same(rows[n], again)), None) for numbers in near)
        return min((n for n in same if n is not None), default=None)

    def add(self, number: int, row: TurntableResidual) -> None:
        """Keep a capture, unless one of exactly its angle came before it."""
        if row.table_deg is not None and (row.mount, row.table_deg) not in self._angles:
            self._angles.add((row.mount, row.table_deg))
            self._numbers[row.mount, _cell(row.table_deg)].append(number)


def _cell(angle_deg: float) -> int:
    """Return the cell of an angle's direction; cells are twice as wide as same angles may be apart."""
    return int(angle_deg % 360 / 360 * _CELLS) % _CELLS


def _is_same(one: TurntableResidual, other: TurntableResidual) -> bool:
    return (
        one.mount == other.mount
        and one.table_deg is not None
        and other.table_deg is not None
        and abs((one.table_deg - other.table_deg + 180) % 360 - 180) < _SAME_DEG
    )


def _sigma_deg(result: TableLike, rows: list[TurntableResidual]) -> float:
    """Return how far a capture errs around the axis by chance: as it must, and as most captures do.

    It must by its angle's own error, and its pose's or what carries it; the sphere's centre beside a profile errs
    by more.
    """
    radius_mm = min((mount.radius_mm for mount in result.mounts), default=0.0)
    parts = result.variance_components
    by_pose = np.rad2deg(np.hypot(parts.position_sigma_mm, parts.play_sigma_mm or 0.0) / max(radius_mm, 1.0))
    seen = _BY_MEDIAN * float(np.median([abs(row.angle_deg or 0.0) for row in rows]))
    return max(float(np.hypot(result.angle_sigma_deg, by_pose)), seen)
