"""Whether a stream tells each reading twice, or some after later ones: no pose is wrong by it, but it is told.

Both are seen without a clock while the device moves: what is told twice changes with every second reading alone,
and what is out of order goes back and forth with each.
"""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.messages import message
from server.live.freshness import differ
from server.sources.device import Sample

_IN_A_ROW = 6  # readings; an arm that shakes goes less far, or not so often
_TWICE_IN_A_ROW = 10
_LEAST_MM, _LEAST_DEG = 1.0, 0.2
_TOLD_FOR_S = 5.0


class StreamOrder:
    """Watches the order of a robot's or table's readings."""

    def __init__(self) -> None:
        self._last: Sample | None = None
        self._step: FloatArray | None = None
        self._changed = False
        self._every_second = self._back_and_forth = 0
        self._said_s, self._said = -np.inf, ""

    def take(self, sample: Sample) -> None:
        """Take the next reading."""
        last, self._last = self._last, sample
        if last is None:
            return
        before, self._changed = self._changed, differ(last, sample)
        self._every_second = self._every_second + 1 if self._changed != before else 0
        step, self._step = self._step, _step(last, sample)
        is_back = step is not None and self._step is not None and step @ self._step < 0
        self._back_and_forth = self._back_and_forth + 1 if is_back else 0
        if self._back_and_forth >= _IN_A_ROW:
            self._said_s = sample.host_time_s
            self._said = message("Its readings arrive out of order: where it rests, they are used all the same.")
        elif self._every_second >= _TWICE_IN_A_ROW:
            self._said_s = sample.host_time_s
            self._said = message("Each of its readings arrives twice: it is used once.")

    def said(self, now_s: float) -> str:
        """Return what is to be told of the order, "" where it was right in the last seconds."""
        return self._said if now_s - self._said_s < _TOLD_FOR_S else ""


def _step(one: Sample, other: Sample) -> FloatArray | None:
    """Return the way from a reading to the next, None where it is too short to say anything."""
    if one.base_from_tool0 is not None and other.base_from_tool0 is not None:
        way_mm = other.base_from_tool0.translation_mm - one.base_from_tool0.translation_mm
        return way_mm if np.linalg.norm(way_mm) >= _LEAST_MM else None
    if one.table_deg is not None and other.table_deg is not None:
        turn_deg = (other.table_deg - one.table_deg + 180.0) % 360.0 - 180.0
        return np.array([turn_deg]) if abs(turn_deg) >= _LEAST_DEG else None
    return None
