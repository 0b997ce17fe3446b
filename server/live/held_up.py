"""When this computer did not let the workbench run: nobody looked, and what came meanwhile is stamped too late."""

import math
import threading
from collections import deque

from server.background import BackgroundThread
from server.sources.device import host_now_s

HELD_UP_S = 0.35
"""A beat that comes later by more leaves open what was before it, as a gap between poses does (`Rules.gap_s`)."""
_BEHIND_S = 1.0
"""Exposures that arrived so long after the last that was looked at show what nobody saw."""
_EVERY_S = 0.05
_MOST_GAPS = 200


class Pulse(BackgroundThread):
    """Beats by a thread of its own, as all threads of a process wait for one interpreter, and keeps its gaps."""

    def __init__(self) -> None:
        super().__init__("pulse")
        self._gaps: deque[tuple[float, float]] = deque(maxlen=_MOST_GAPS)
        self._beat_s = host_now_s()
        self.newest_s = -math.inf  # when the newest exposure arrived
        self._lock = threading.Lock()
        self.start()

    def held_s(self, since_s: float, until_s: float) -> float:
        """Return the longest gap that reaches into an interval, one that lasts included; 0 where there is none."""
        with self._lock:
            gaps = [*self._gaps, (self._beat_s, host_now_s())]
        return max(
            (
                ended_s - began_s
                for began_s, ended_s in gaps
                if ended_s - began_s > HELD_UP_S and began_s < until_s and ended_s > since_s
            ),
            default=0.0,
        )

    def unwatched_s(self, since_s: float, until_s: float) -> float:
        """Return for how long nobody looked at a stretch; 0 where somebody did."""
        behind_s = min(self.newest_s, until_s) - since_s
        return max(self.held_s(since_s, until_s), behind_s if behind_s > _BEHIND_S else 0.0)

    def _work(self) -> None:
        while not self._stopping.wait(_EVERY_S):
            now_s = host_now_s()
            with self._lock:
                if now_s - self._beat_s > HELD_UP_S:
                    self._gaps.append((self._beat_s, now_s))
                self._beat_s = now_s
