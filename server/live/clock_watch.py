"""Whether the clocks of robot and scanner still tell what they told when their offset was measured.

A reading tells its device's time and arrives a little later; the least of (arrival − device time) over some
seconds is the clock's own distance from this computer's, the transport's best case included.  What it changes by
since the measurement, of scanner against robot, is drift.
"""

from collections import deque
from dataclasses import dataclass

from server.sources.device import Reading

LEAST_DRIFT_S = 0.004
"""Less is not told from what transport and a busy computer make of it."""
_BUCKET_S = 1.0
_BUCKETS = 5
_FEWEST = 3


class ClockEnvelope:
    """The least of arrival minus device time over the last five seconds, in steps of one second."""

    def __init__(self) -> None:
        self._buckets: deque[tuple[int, float]] = deque(maxlen=_BUCKETS)

    def take(self, reading: Reading) -> None:
        """Take a reading; one without a device time is passed over."""
        if reading.device_time_s is None:
            return
        bucket, apart_s = int(reading.host_time_s / _BUCKET_S), reading.host_time_s - reading.device_time_s
        if self._buckets and self._buckets[-1][0] == bucket:
            self._buckets[-1] = bucket, min(self._buckets[-1][1], apart_s)
        else:
            self._buckets.append((bucket, apart_s))

    def clear(self) -> None:
        """Forget all: the device was away."""
        self._buckets.clear()

    @property
    def apart_s(self) -> float | None:
        """The least, None before three seconds of readings."""
        return min(apart_s for _, apart_s in self._buckets) if len(self._buckets) >= _FEWEST else None


@dataclass
class ClockWatch:
    """Envelopes of both clocks, and where they stood when the offset was measured."""

    robot: ClockEnvelope
    scanner: ClockEnvelope
    measured_s: float | None = None

    @classmethod
    def new(cls) -> "ClockWatch":
        """Return one that has heard nothing."""
        return cls(ClockEnvelope(), ClockEnvelope())

    def mark(self) -> None:
        """The offset has just been measured."""
        self.measured_s = self._between_s()

    @property
    def drift_s(self) -> float:
        """How much more the scanner's clock tells against the robot's than when the offset was measured."""
        now_s = self._between_s()
        return 0.0 if now_s is None or self.measured_s is None else now_s - self.measured_s

    @property
    def warning(self) -> str:
        """What is said of a drift, empty where there is none."""
        drift_s = self.drift_s
        if abs(drift_s) < LEAST_DRIFT_S:
            return ""
        drifted = f"The clocks have drifted by {1000 * drift_s:+.0f} ms"
        return f"{drifted} since their offset was measured: measure it again."

    def _between_s(self) -> float | None:
        robot_s, scanner_s = self.robot.apart_s, self.scanner.apart_s
        return None if robot_s is None or scanner_s is None else robot_s - scanner_s
