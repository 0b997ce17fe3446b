"""Drift between two clocks, told from when readings arrive, and what it forbids on the move."""

from pathlib import Path

import numpy as np
import pytest

from calib_core.clock_offset import ClockOffset
from calib_core.errors import ConflictError
from calib_core.frames import RigidTransform
from server.live.clock_watch import LEAST_DRIFT_S, ClockWatch, MeasuredClocks
from server.live.manager import KeptBySession
from server.live.recording import Recorded, on_one_clock
from server.sources.device import Frame, Sample

RATE_HZ = {"robot": 125.0, "scanner": 30.0}


def hear(watch: ClockWatch, since_s: float, seconds: float, drift_ppm: float, seed: int = 1) -> None:
    """Readings of both, each late by a few ms at random; the scanner's clock runs fast by `drift_ppm`."""
    rng = np.random.default_rng(seed)
    for device_s in since_s + np.arange(0.0, seconds, 1 / RATE_HZ["robot"]):
        watch.robot.take(Sample(float(device_s + 0.001 + rng.exponential(0.004)), float(device_s)))
    for true_s in since_s + np.arange(0.0, seconds, 1 / RATE_HZ["scanner"]):
        told_s = true_s * (1 + drift_ppm * 1e-6) + 40.0
        watch.scanner.take(Frame(float(true_s + 0.02 + rng.exponential(0.004)), "1.csv", b"", float(told_s)))


@pytest.mark.parametrize("seed", range(10))
def test_clocks_that_hold_are_not_warned_about(seed: int) -> None:
    watch = ClockWatch.new()
    hear(watch, 0.0, 6.0, 0.0, seed)
    watch.mark()
    assert watch.warning == ""
    hear(watch, 600.0, 6.0, 0.0, seed + 100)
    assert abs(watch.drift_s) < LEAST_DRIFT_S / 2
    assert watch.warning == ""


@pytest.mark.parametrize("drift_ppm", [20.0, -20.0])
def test_a_clock_that_runs_fast_is_warned_about(drift_ppm: float) -> None:
    """Twenty parts in a million, as of a cheap quartz, are 12 ms after ten minutes."""
    watch = ClockWatch.new()
    hear(watch, 0.0, 6.0, drift_ppm)
    watch.mark()
    hear(watch, 600.0, 6.0, drift_ppm, 2)
    assert watch.drift_s == pytest.approx(600 * drift_ppm * 1e-6, abs=0.001)
    assert f"drifted by {600e-3 * drift_ppm:+.0f} ms" in watch.warning


def test_nothing_is_said_before_enough_was_heard_or_measured() -> None:
    watch = ClockWatch.new()
    hear(watch, 0.0, 1.0, 0.0)
    watch.mark()
    assert (watch.drift_s, watch.warning) == (0.0, "")
    hear(watch, 0.0, 6.0, 0.0)
    assert watch.warning == ""
    watch.mark()
    watch.robot.clear()  # it was away: its clock may have been set
    assert watch.warning == ""


FOUND = ClockOffset(0.037, 0.0002, 0.02, 140)


def swept(mm_s: float) -> Recorded:
    """A second on the move, by both devices' clocks, the scanner's 37 ms ahead."""
    times = np.arange(0.0, 1.0, 0.01)
    track = tuple(
        Sample(float(t), float(t), RigidTransform.of([0, 0, 0], [mm_s * t, 0, 0], "base", "tool0")) for t in times
    )
    frames = tuple(Frame(float(t), "1.csv", b"", float(t + 0.037)) for t in times[10:90:5])
    return Recorded(tuple(Path(f"{k}.csv") for k in range(len(frames))), frames, track, (True, True))


def test_an_offset_outlasts_a_restart_and_is_watched_on(tmp_path: Path) -> None:
    def clocks() -> MeasuredClocks:  # as a server makes them when it starts
        kept = KeptBySession(tmp_path / "live-clocks.json")
        return MeasuredClocks(kept.get("s1"), lambda told: kept.put("s1", told))

    before = clocks()
    hear(before.watch, 0.0, 6.0, 20.0)
    before.take(FOUND, (True, True))
    after = clocks()
    assert (after.offset, after.by_device) == (FOUND, (True, True))
    with pytest.raises(ConflictError, match="watched for three seconds"):
        on_one_clock(swept(100.0), after)  # a device may have been switched off meanwhile
    hear(after.watch, 30.0, 6.0, 20.0, 2)
    _, frames_s, _ = on_one_clock(swept(100.0), after)
    assert frames_s[0] == pytest.approx(0.1)
    later = clocks()
    hear(later.watch, 600.0, 6.0, 20.0, 3)
    with pytest.raises(ConflictError, match="drift of \\+12 ms"):
        on_one_clock(swept(100.0), later)
    assert KeptBySession(tmp_path / "live-clocks.json").get("s2") == {}
