"""Whether the clocks of robot and scanner still tell what they told when their offset was measured.

A reading tells its device's time and arrives a little later; the least of (arrival − device time) over some
seconds is the clock's own distance from this computer's, the transport's best case included.  What it changes by
since the measurement, of scanner against robot, is drift.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

from calib_core.clock_offset import ClockOffset, clock_offset
from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.messages import message
from server.sources.device import Reading, Sample
from server.store.models import Data

LEAST_DRIFT_S = 0.004
"""Less is not told from what transport and a busy computer make of it."""
_BUCKET_S = 1.0
_BUCKETS = 5
_FEWEST = 3


class SeenArc(NamedTuple):
    """When an arc was seen, whether by its device's clock, and where: x, z and radius, mm."""

    time_s: float
    by_device: bool
    arc: FloatArray


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
    def is_unsure(self) -> bool:
        """Whether a device was away since the measurement and has not been heard for long enough: it may drift."""
        return self.measured_s is not None and self._between_s() is None

    @property
    def warning(self) -> str:
        """What is said of a drift, empty where there is none."""
        drift_s = self.drift_s
        if abs(drift_s) < LEAST_DRIFT_S:
            return ""
        drifted = message("The clocks have drifted by {drift_s:+.0f} ms", drift_s=1000 * drift_s)
        return message("{drifted} since their offset was measured: measure it again.", drifted=drifted)

    def _between_s(self) -> float | None:
        robot_s, scanner_s = self.robot.apart_s, self.scanner.apart_s
        return None if robot_s is None or scanner_s is None else robot_s - scanner_s


class MeasuredClocks:
    """The offset between the clocks of scanner and robot as it was measured, which devices' clocks, and the watch.

    It is kept across a restart of this server: where the clocks stood to each other does not depend on this
    computer's own.

    Parameters
    ----------
    kept : mapping
        What `keep` was told, empty where nothing was measured.
    keep : callable
        Keeps it.
    """

    def __init__(self, kept: Data | None = None, keep: Callable[[Data], object] = lambda _: None) -> None:
        self._keep = keep
        self.watch = ClockWatch.new()
        self.offset: ClockOffset | None = None
        self.by_device = (False, False)
        if kept:
            self.offset = ClockOffset(**kept["offset"])
            self.by_device = (bool(kept["by_device"][0]), bool(kept["by_device"][1]))
            self.watch.measured_s = kept["measured_s"]

    def take(self, offset: ClockOffset, by_device: tuple[bool, bool]) -> None:
        """Take and keep an offset that has just been measured; `by_device` of scanner and robot."""
        self.offset, self.by_device = offset, by_device
        self.watch.mark()
        self._keep({"offset": asdict(offset), "by_device": by_device, "measured_s": self.watch.measured_s})

    def measure(self, robot: Sequence[Sample], seen: Sequence[SeenArc]) -> tuple[ClockOffset, str]:
        """Return how much more the scanner's clock tells than the robot's, and which clocks these are; take it.

        Raises
        ------
        MotionError, MeasurementError
            If the samples and arcs are not of a move back and forth with the sphere in view.
        """
        if len(robot) < 2 or not seen:
            need = "poses of the robot and exposures of the sphere"
            raise MeasurementError(need, "none", "Connect both, and move back and forth.")
        of_scanner, of_robot = seen[-1].by_device, all(s.device_time_s is not None for s in robot)
        times = [(s.device_time_s if of_robot else None) or s.host_time_s for s in robot]
        positions = [s.base_from_tool0.translation_mm for s in robot if s.base_from_tool0 is not None]
        seen = [one for one in seen if one.by_device == of_scanner and times[0] - 1 < one.time_s < times[-1] + 1]
        if len(seen) < 2:
            to_do = message("Set the devices' clocks to within a second.")
            raise MeasurementError("exposures within the robot's track", "none", to_do)
        found = clock_offset(times, positions, [one.time_s for one in seen], [one.arc for one in seen])
        self.take(found, (of_scanner, of_robot))
        return found, f"scanner: {_clock(of_scanner)}, robot: {_clock(of_robot)}"


def _clock(by_device: bool) -> str:
    return "device" if by_device else "arrival"
