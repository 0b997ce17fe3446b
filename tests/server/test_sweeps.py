"""Recordings that are not stored: the pose stood and the stripe moved, a device was lost, a table was turned."""

import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from calib_core.errors import ConflictError
from calib_core.frames import RigidTransform
from calib_core.records import Capture, Measured
from calib_core.simulation import simulate
from calib_core.simulation.live_cell import LiveCell as SimulatedCell
from server.live.link import Link
from server.live.live_captures import CaptureSettings, Shot
from server.live.live_cell import LiveCell
from server.sources.device import Frame, Sample, host_now_s
from server.sources.registry import SOURCES
from tests.server.live_rig import until


class Fed:
    """A live cell that is told of the simulated one, its robot's pose frozen where it is wished."""

    def __init__(self) -> None:
        simulated = simulate("tcp", 7)
        self.cell, self.taken = SimulatedCell(simulated, 0.3), list[Capture]()
        self.places = [k for k in range(len(self.cell.shots)) if 0.4 < self._offset(k) < 0.75]
        self.cell.go(self.places[0], time.monotonic())
        self.frozen: Sample | None = None
        record = simulated.session.cell
        self.live = LiveCell(lambda: (record, set(), lambda: None), self._take, CaptureSettings())
        for name, source, settings in (
            ("robot", "pose-lines", {"host": "127.0.0.1", "port": 9, "convention": "abb"}),
            ("scanner", "frame-folder", {"folder": "/nowhere"}),
        ):
            found = SOURCES.get(source)
            # Not started: what they deliver is fed.
            self.live.links[name] = Link(
                name, found, found.settings.parsed(settings), self.live.arrived, self.live.forget
            )
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._feed)
        self._thread.start()

    def _offset(self, number: int) -> float:
        return abs(self.cell.shots[number].sphere_center_in_laser_mm[1]) / self.cell.world.sphere_radius_mm

    def _take(self, capture: Capture, files: Mapping[str, bytes]) -> Measured:
        self.taken.append(capture)
        return Measured(capture=capture.id, kind=capture.kind, verdict="pass")

    def told(self, ago_s: float = 0.0) -> Sample:
        at = self.cell.at(time.monotonic() - ago_s)
        pose = RigidTransform.from_rounded(at.reported.tolist(), "base", "tool0")
        return Sample(host_now_s() - ago_s, base_from_tool0=(self.frozen.base_from_tool0 if self.frozen else pose))

    def _feed(self) -> None:
        """Send every 20 ms; where the thread waited for a processor, what was due meanwhile, as a device would."""
        rng, number, due_s = np.random.default_rng(5), 0, time.monotonic()
        while not self._stopped.wait(max(0.0, due_s - time.monotonic())):
            ago_s = time.monotonic() - due_s
            number, due_s = number + 1, due_s + 0.02
            self.live.arrived("robot", self.told(ago_s))
            if number % 3 == 0:
                content = self.cell.profile(time.monotonic() - ago_s, rng)
                self.live.arrived("scanner", Frame(host_now_s() - ago_s, f"{number}.csv", content))

    def stop(self) -> None:
        self._stopped.set()
        self._thread.join()
        self.live.stop()


@pytest.fixture
def fed() -> Iterator[Fed]:
    made = Fed()
    until(lambda: made.live.newest()[2] is not None)
    time.sleep(2.5)  # it has stood for long when something happens: a late stripe does not explain it
    yield made
    made.stop()


def test_a_recording_at_rest_is_stored_and_one_whose_pose_stood_while_the_stripe_moved_is_not(
    fed: Fed, tmp_path: Path
) -> None:
    fed.live.sweep(Shot("p01", host_now_s()), 1.0, tmp_path / "1")
    assert [capture.kind for capture in fed.taken] == ["sweep"]
    fed.frozen = fed.told()
    fed.cell.go(fed.places[1], time.monotonic())
    with pytest.raises(ConflictError, match="the stripe moved by"):
        fed.live.sweep(Shot("p02", host_now_s()), 2.0, tmp_path / "2")
    assert len(fed.taken) == 1


def test_a_recording_whose_robot_was_heard_again_before_its_end_is_not_stored(fed: Fed, tmp_path: Path) -> None:
    with ThreadPoolExecutor() as pool:
        fed.frozen = fed.told()
        sweep = pool.submit(fed.live.sweep, Shot("p01", host_now_s()), 4.0, tmp_path / "1")
        fed.cell.go(fed.places[1], time.monotonic())
        time.sleep(2.0)
        fed.frozen = None
        with pytest.raises(ConflictError, match="the stripe moved by"):
            sweep.result()
    assert fed.taken == []


@pytest.mark.parametrize("name", ["robot", "scanner"])
def test_a_recording_during_which_a_device_was_lost_is_not_stored(fed: Fed, tmp_path: Path, name: str) -> None:
    with ThreadPoolExecutor() as pool:
        sweep = pool.submit(fed.live.sweep, Shot("p01", host_now_s()), 1.0, tmp_path / "1")
        time.sleep(0.3)
        fed.live.forget(name)
        with pytest.raises(ConflictError, match=f"{name} was lost meanwhile"):
            sweep.result()
    assert fed.taken == []


def test_nothing_is_stored_while_an_armed_mover_turns_the_table(fed: Fed, tmp_path: Path) -> None:
    fed.live.turned_s = np.inf
    with pytest.raises(ConflictError, match="one that turns"):
        fed.live.sweep(Shot("p01", host_now_s()), 0.5, tmp_path / "1")
    shot = Shot("p01", host_now_s())
    fed.live.ask(shot)
    until(lambda: shot.why_not == "the table turns", lambda: shot.why_not)
    fed.live.turned_s = host_now_s()
    assert shot.answer.result(20).capture == "p01"
