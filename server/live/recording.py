"""Exposures that go to disk as fast as they come, and the robot's poses meanwhile: a capture on the move."""

import queue
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from calib_core.clock_offset import ClockOffset
from calib_core.errors import ConflictError, MeasurementError
from calib_core.messages import message
from calib_core.robots import to_pose
from server.live.clock_watch import LEAST_DRIFT_S, MeasuredClocks
from server.live.standstill import Rules
from server.sources.device import Frame, Sample

MOST_SHIFT_MM = 0.05
"""What the clocks' offset leaves open at a speed, at two standard deviations, must stay below this."""
_STANDS_MM_S = 0.5
_ONE_ORIENTATION_RAD = 0.002
_MOST_GAP_S = 0.1
_MOST_WAITING = 512 * 1024 * 1024
_MOST_FRAMES = 20_000


@dataclass(frozen=True, eq=False)
class Recorded:
    """What was recorded: the files in their order, their times, and the robot's samples from before to after.

    `by_device` says whether the times are the devices' own.
    """

    files: tuple[Path, ...]
    frames: tuple[Frame, ...]
    track: tuple[Sample, ...]
    by_device: tuple[bool, bool]


class Recording:
    """Writes every exposure that it is given into a folder, by a thread of its own.

    Whoever gives it exposures never waits; where the disk stays behind by 512 MiB, the recording fails:
    no exposure is dropped silently.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._waiting: queue.SimpleQueue[Frame | None] = queue.SimpleQueue()
        self._bytes = 0
        self._files: list[Path] = []
        self._frames: list[Frame] = []
        self._track: list[Sample] = []
        self._lock = threading.Lock()
        self.problem = ""
        self._thread = threading.Thread(target=self._run, name="recording", daemon=True)
        self._thread.start()

    @property
    def written(self) -> int:
        """How many exposures are on disk."""
        return len(self._files)

    def expose(self, frame: Frame) -> None:
        """Take an exposure; called by its device's thread."""
        with self._lock:
            self._bytes += len(frame.content)
            if self._bytes > _MOST_WAITING:
                self.fail(message("the disk is slower than the camera"))
            if len(self._frames) >= _MOST_FRAMES:
                self.fail(message("more than {count} exposures", count=_MOST_FRAMES))
            if self.problem:
                return
            self._frames.append(Frame(frame.host_time_s, frame.name, b"", frame.device_time_s))
        self._waiting.put(frame)

    def move(self, sample: Sample) -> None:
        """Take a sample of the robot."""
        self._track.append(sample)

    def fail(self, problem: str) -> None:
        """Say why it is of no use: a device was lost meanwhile, say."""
        self.problem = self.problem or problem

    def end(self) -> Recorded:
        """Wait until all is on disk and return it.

        Raises
        ------
        ConflictError
            If something of it is missing.
        """
        self._waiting.put(None)
        self._thread.join()
        if self.problem:
            raise ConflictError("a recording without a gap", self.problem, "Record again.")
        frames = tuple(self._frames)
        track = tuple(s for s in self._track if s.base_from_tool0 is not None)
        by_device = (
            all(f.device_time_s is not None for f in frames),
            all(s.device_time_s is not None for s in track),
        )
        return Recorded(tuple(self._files), frames, track, by_device)

    def _run(self) -> None:
        while (frame := self._waiting.get()) is not None:
            path = self._folder / f"{len(self._files) + 1:06d}{Path(frame.name).suffix.lower()}"
            try:
                path.write_bytes(frame.content)
            except OSError as error:
                self.fail(message("the disk took no more: {why}", why=error.strerror or str(error)))
                continue
            with self._lock:
                self._bytes -= len(frame.content)
            self._files.append(path)


def on_one_clock(recorded: Recorded, clocks: MeasuredClocks) -> tuple[Recorded, list[float], list[float]]:
    """Return what was recorded while both told, and the times of exposures and poses by the robot's clock.

    Raises
    ------
    MeasurementError
        If exposures or poses are missing.
    ConflictError
        If the robot moved faster than the offset between the clocks is known for.
    """
    track_s = _times(recorded.track, recorded.by_device[1])
    same_clocks = clocks.by_device == recorded.by_device
    offset_s = clocks.offset.offset_s if clocks.offset is not None and same_clocks else 0.0
    frames_s = [time_s - offset_s for time_s in _times(recorded.frames, recorded.by_device[0])]
    both = [k for k, time_s in enumerate(frames_s) if track_s and track_s[0] <= time_s <= track_s[-1]]
    if len(both) < 2:
        got = message(
            "{count} exposures, {count_other} poses, {count_2} exposures between poses",
            count=len(frames_s),
            count_other=len(track_s),
            count_2=len(both),
        )
        to_do = message("Connect scanner and robot, set their clocks, and record for longer.")
        raise MeasurementError("exposures between poses", got, to_do)
    around = [
        k for k, time_s in enumerate(track_s) if frames_s[both[0]] - 0.2 <= time_s <= frames_s[both[-1]] + 0.2
    ]
    kept = Recorded(
        tuple(recorded.files[k] for k in both),
        tuple(recorded.frames[k] for k in both),
        tuple(recorded.track[k] for k in around),
        recorded.by_device,
    )
    kept_s = [track_s[k] for k in around]
    gap_s = max((later - earlier for earlier, later in pairwise(kept_s)), default=0.0)
    if gap_s > _MOST_GAP_S:
        to_do = "Let the robot send more often."
        raise MeasurementError("a recording without a gap", "{gap_s:.2f} s without one", to_do, gap_s=gap_s)
    speed_mm_s = speed_of(kept)
    if speed_mm_s > _STANDS_MM_S:
        _require_offset(speed_mm_s, clocks, same_clocks)
    return kept, [frames_s[k] for k in both], kept_s


def sweep_fields(
    recorded: Recorded, frames_s: list[float], track_s: list[float], clocks: ClockOffset | None, convention: str
) -> dict[str, Any]:
    """Return the fields of a sweep's record: when each exposure was made by the robot's clock, and its track."""
    track = [
        {"t_s": round(time_s - track_s[0], 6), "pose": [round(v, 9) for v in to_pose(convention, pose)]}
        for time_s, sample in zip(track_s, recorded.track, strict=True)
        if (pose := sample.base_from_tool0) is not None
    ]
    speed_mm_s = speed_of(recorded)
    known = "" if clocks is None else f", offset {1000 * clocks.offset_s:.2f} ± {2000 * clocks.sigma_s:.2f} ms"
    return {
        "timestamps_s": [round(time_s - track_s[0], 6) for time_s in frames_s],
        "pose_track": track,
        "source": f"{len(frames_s)} exposures at up to {speed_mm_s:.1f} mm/s{known}",
    }


def newest_way(samples: Iterable[Sample]) -> list[Sample]:
    """Return the newest samples that tell a flange, all with one orientation: how it came there is left out."""
    told = [sample for sample in samples if sample.base_from_tool0 is not None]
    if not told:
        return []
    z, x = (np.array([s.base_from_tool0.rotation[:, k] for s in told if s.base_from_tool0]) for k in (2, 0))
    turned = np.maximum(np.abs(z - z[-1]).max(axis=1), np.abs(x - x[-1]).max(axis=1)) > _ONE_ORIENTATION_RAD
    return told[int(turned.nonzero()[0][-1]) + 1 if turned.any() else 0 :]


def table_fields(table: Sequence[Sample], rules: Rules, span_s: tuple[float, float] | None) -> dict[str, Any]:
    """Return the table's angle for a sweep's record, nothing where no table told one.

    Raises
    ------
    ConflictError
        If the table turned meanwhile: a sweep has one angle; or if it was not heard all the time (`span_s`).
    """
    if span_s is not None:
        heard_s = [span_s[0], *(sample.host_time_s for sample in table if sample.table_deg is not None), span_s[1]]
        if max(later - earlier for earlier, later in pairwise(heard_s)) > rules.gap_s:
            raise ConflictError(
                "a recording without a gap", "the table left a gap between its poses", "Record again."
            )
    angles = [sample.table_deg for sample in table if sample.table_deg is not None]
    if not angles:
        return {}
    # Who tells the flange as well says of the robot that it moves: on the move it does.
    turns = any(sample.moving for sample in table if sample.base_from_tool0 is None)
    if max(angles) - min(angles) > rules.table_deg or turns:
        got = message("one that turned from {least:.2f}° to {most:.2f}°", least=min(angles), most=max(angles))
        raise ConflictError("a table at rest during a sweep", got, "Turn it between sweeps.", "table_deg")
    return {"table_deg": angles[-1]}


def speed_of(recorded: Recorded) -> float:
    """Return the flange's largest speed, mm/s, over steps of at least 50 ms."""
    times_s = np.array(_times(recorded.track, recorded.by_device[1]))
    if not len(times_s):
        return 0.0
    places = np.array([s.base_from_tool0.translation_mm for s in recorded.track if s.base_from_tool0 is not None])
    later = np.searchsorted(times_s, times_s + 0.05)
    ok = later < len(times_s)
    if not ok.any():
        return 0.0
    way = np.linalg.norm(places[later[ok]] - places[ok], axis=1)
    return float(np.max(way / (times_s[later[ok]] - times_s[ok])))


def _times(readings: tuple[Frame, ...] | tuple[Sample, ...], by_device: bool) -> list[float]:
    return [(one.device_time_s if by_device else None) or one.host_time_s for one in readings]


def _require_offset(speed_mm_s: float, clocks: MeasuredClocks, same_clocks: bool) -> None:
    offset, drift_s = clocks.offset, clocks.watch.drift_s
    if offset is None or not same_clocks:
        need = "the offset between the clocks, for a move at {speed_mm_s:.0f} mm/s"
        to_do = "Measure the clocks' offset first, or capture at standstill."
        raise ConflictError(need, "none", to_do, "clock-offset", speed_mm_s=speed_mm_s)
    if clocks.watch.is_unsure:
        need = "clocks that were watched for three seconds since a device was away"
        raise ConflictError(need, "fewer", "Record again.", "clock-offset")
    if abs(drift_s) >= LEAST_DRIFT_S and abs(drift_s) * speed_mm_s > MOST_SHIFT_MM:
        raise ConflictError(
            "clocks that stand to each other as when their offset was measured",
            "a drift of {drift_s:+.0f} ms, {drift_s_other:.2f} mm at {speed_mm_s:.0f} mm/s",
            "Measure the clocks' offset again.",
            "clock-offset",
            drift_s=1000 * drift_s,
            drift_s_other=abs(drift_s) * speed_mm_s,
            speed_mm_s=speed_mm_s,
        )
    shift_mm = 2 * offset.shift_mm(speed_mm_s)
    if shift_mm > MOST_SHIFT_MM:
        slow = MOST_SHIFT_MM / (2 * offset.sigma_s)
        raise ConflictError(
            "poses within {most_shift_mm:g} mm of their exposures",
            "{shift_mm:.2f} mm that the offset leaves open at {speed_mm_s:.0f} mm/s",
            "Move at {slow:.0f} mm/s or slower, or measure the offset again over a longer move.",
            "clock-offset",
            most_shift_mm=MOST_SHIFT_MM,
            shift_mm=shift_mm,
            speed_mm_s=speed_mm_s,
            slow=slow,
        )
