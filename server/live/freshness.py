"""Whether what a device tells is new: its stamp advances, does not lag, and the pose is one of one arm.

A stream may go on while its content stands still: a gateway repeats its last package, a buffer lags, two programs
publish under one name.  Each leaves its mark on the device's clock, or jumps faster than any arm.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.messages import message
from server.sources.device import Clock, Reading, Sample

STANDS_S = 0.35
"""A clock that has not advanced for longer stands; poses further apart are not joined either (`Rules.gap_s`)."""

_LAG_S = 0.25
_OTHER_CLOCK_S = 20.0  # no stream is so late: a device that starts anew takes longer, and its clock begins anew
_DRIFT = 2e-4  # of two clocks, seconds a second, some times over
_FASTEST_MM_S = 20_000.0
_LEAST_JUMP_MM = 1.0
_SAME_MM = 0.01
_FASTEST_DEG_S = 3600.0
_LEAST_JUMP_DEG = 1.0
_SAME_DEG = 0.01
_THERE_AND_BACK_S = 2.0  # a table that tells itself where it arrives alone takes longer for both ways


@dataclass(frozen=True)
class Judged:
    """What is to be done with a reading: whether it tells something new, and why the device is not fresh."""

    is_new: bool
    why: str = ""


class Freshness:
    """Watches the readings of one device.

    Parameters
    ----------
    clock : Clock
        What the source's stamps mean.
    before : Freshness, optional
        Of the connection before to the same device: how soon its readings arrived at best is known from it.
    """

    def __init__(self, clock: Clock, before: "Freshness | None" = None) -> None:
        self._clock = clock
        self._last: Reading | None = None
        self._before_last: Reading | None = None
        self._advanced_s = 0.0
        self._least_apart_s = before._least_apart_s if before else np.inf
        self._least_at_s = before._least_at_s if before else 0.0
        self.baseline: object = before.baseline if before else object()
        """Another one with each clock that begins anew: whether it was late from then on, it cannot tell."""

    @property
    def is_timed(self) -> bool:
        """Whether readings tell when they were made, each of them."""
        return self._clock == "every-reading" and self._last is not None and self._last.device_time_s is not None

    def judge(self, sample: Reading) -> Judged:
        """Take the next reading, and say whether it is new."""
        jumped = _jump(self._before_last, self._last, sample)
        self._before_last, before, self._last = self._last, self._last, sample
        stamp_s = sample.device_time_s
        if before is None or stamp_s is None or before.device_time_s is None or self._clock == "none":
            self._advanced_s = sample.host_time_s
            return Judged(not jumped, jumped)
        if stamp_s > before.device_time_s:
            self._advanced_s = sample.host_time_s
            why = jumped or (self._lag(sample) if self._clock == "every-reading" else "")
            return Judged(not why, why)
        if self._clock == "on-change":
            self._advanced_s = sample.host_time_s
            changed = differ(before, sample)
            return Judged(
                not changed, "Not fresh: its values change and their time stamp does not." if changed else ""
            )
        stands_s = sample.host_time_s - self._advanced_s
        if stands_s <= STANDS_S:
            return Judged(is_new=False)
        return Judged(
            is_new=False,
            why=message(
                "Not fresh: its clock has stood for {stands_s:.1f} s: it repeats one reading.", stands_s=stands_s
            ),
        )

    def _lag(self, sample: Reading) -> str:
        """Return how much later than at best a reading arrived, where that is too late for a capture."""
        assert sample.device_time_s is not None
        apart_s = sample.host_time_s - sample.device_time_s
        least_s = self._least_apart_s + _DRIFT * (sample.host_time_s - self._least_at_s)
        is_other = np.isfinite(least_s) and abs(apart_s - least_s) > _OTHER_CLOCK_S  # it was switched on anew
        if apart_s <= least_s or is_other:
            self.baseline = object() if is_other else self.baseline
            self._least_apart_s, self._least_at_s = apart_s, sample.host_time_s
            return ""
        lag_s = apart_s - least_s
        return (
            message("Not fresh: it tells what was {lag_s:.1f} s ago: its readings arrive late.", lag_s=lag_s)
            if lag_s > _LAG_S
            else ""
        )


def differ(one: Reading, other: Reading) -> bool:
    """Return whether two readings tell another pose or angle."""
    if not isinstance(one, Sample) or not isinstance(other, Sample):
        return False
    if one.table_deg != other.table_deg:
        return True
    if one.base_from_tool0 is None or other.base_from_tool0 is None:
        return one.joints_deg != other.joints_deg
    return not np.array_equal(one.base_from_tool0.matrix, other.base_from_tool0.matrix)


def _jump(before: Reading | None, last: Reading | None, sample: Reading) -> str:
    """Return what is said of a flange or table that is at two places at once: two programs tell one each.

    Readings that were held up arrive together, and look like a fast flange; but one that goes on, not back.
    """
    if before is None or last is None:
        return ""
    time_s = max(sample.host_time_s - last.host_time_s, 1e-3)
    way_mm, left_mm = _way_mm(last, sample), _way_mm(before, sample)
    if _is_back(way_mm, left_mm, time_s, _LEAST_JUMP_MM, _SAME_MM, _FASTEST_MM_S):
        return message(
            "Not fresh: its pose jumps by {way_mm:.0f} mm and back: two programs may be telling it.", way_mm=way_mm
        )
    turn_deg, left_deg = _turn_deg(last, sample), _turn_deg(before, sample)
    quick = sample.host_time_s - before.host_time_s < _THERE_AND_BACK_S
    if quick and _is_back(turn_deg, left_deg, time_s, _LEAST_JUMP_DEG, _SAME_DEG, _FASTEST_DEG_S):
        return message(
            "Not fresh: its angle jumps by {turn_deg:.1f}° and back: two programs may be telling it.",
            turn_deg=turn_deg,
        )
    return ""


def _is_back(way: float, left: float, time_s: float, least: float, same: float, fastest_per_s: float) -> bool:
    """Return whether a way leads back to where it came from, or there faster than anything moves."""
    return way >= least and left < (same if way / time_s < fastest_per_s else way / 2)


def _way_mm(one: Reading, other: Reading) -> float:
    if not isinstance(one, Sample) or not isinstance(other, Sample):
        return 0.0
    if one.base_from_tool0 is None or other.base_from_tool0 is None:
        return 0.0
    return float(np.linalg.norm(other.base_from_tool0.translation_mm - one.base_from_tool0.translation_mm))


def _turn_deg(one: Reading, other: Reading) -> float:
    """Return how far a table turned, the shorter way round."""
    if not isinstance(one, Sample) or not isinstance(other, Sample):
        return 0.0
    if one.table_deg is None or other.table_deg is None:
        return 0.0
    return abs((other.table_deg - one.table_deg + 180.0) % 360.0 - 180.0)
