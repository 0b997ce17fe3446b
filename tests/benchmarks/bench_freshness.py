"""What is stored while a robot's source is not fresh: every fault, every kind of clock.

The robot of the simulated cell tells its pose through a wire with a fault, its scanner writes profiles into a
folder; captures are taken at standstill by themselves, as on a cell.  A capture counts as wrong where its pose is
not where the robot truly stood.
"""

import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from faulty_robot import FAULTS, Fault, Wire, source_of
from harness import Row

from calib_core.frames import RigidTransform
from calib_core.records import Capture, Measured
from calib_core.robots import parse_pose
from server.live.link import Link
from server.live.live_captures import CaptureSettings
from server.live.live_cell import LiveCell
from server.sources.device import Clock
from server.sources.registry import SOURCES
from tests.server.live_rig import Rig

CLOCKS: tuple[Clock, ...] = ("every-reading", "on-change", "none")
_WRONG_MM = 0.5
_STAY_S, _NAMED_S = 2.0, 2.0
_PATIENCE_S = 30.0


@dataclass
class Trial:
    """How captures went: taken, with a wrong pose, and what was said while the fault was on."""

    taken: int = 0
    wrong: int = 0
    said: list[str] = field(default_factory=list)


def run(full: bool) -> Iterator[Row]:
    """Yield one row a kind of clock and fault; `full` goes to a hundred places with each."""
    moves = 100 if full else 3
    for clock in CLOCKS:
        healthy = trial(clock, None, moves)
        share = 100 * healthy.taken / moves
        measured = f"{share:.1f} % ({healthy.wrong} wrong)"
        yield Row(f"{clock}, no fault: captured within 2 s", "≥ 99.5 %", measured, share >= 99.5)
        for fault in FAULTS:
            found = trial(clock, fault, moves)
            measured = f"{found.wrong} of {found.taken} captures; {named(found)}"
            yield Row(f"{clock}, {fault}: stored with a wrong pose", "0", measured, not found.wrong)


def named(found: Trial) -> str:
    """Return what was said most while a fault was on."""
    return max(set(found.said), key=found.said.count) if found.said else "nothing said"


def trial(clock: Clock, fault: Fault | None, moves: int) -> Trial:
    """Return how captures went on a cell whose robot goes from place to place, with a fault from the second on."""
    wire, found = Wire(), Trial()
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(Path(folder) / "scanner")
        live = LiveCell(
            lambda: (rig.simulated.session.cell, set(), _no_optics),
            _taken(rig, found),
            CaptureSettings(automatic=True, step="tcp"),
        )
        try:
            _connect(live, rig, clock, wire)
            _wait(lambda: found.taken == 1)
            wire.fault = fault
            for number in range(1, moves + 1):
                before = found.taken
                rig.go(rig.good[number % len(rig.good)])
                until_s = time.monotonic() + _STAY_S + 0.4
                while time.monotonic() < until_s and (fault or found.taken == before):
                    time.sleep(0.05)
                    told = [why for link in live.links.values() if (why := link.state().why)]
                    found.said += told or ([live.waits_for] if "moved" in live.waits_for else [])
        finally:
            live.stop()
            rig.stop()
    found.taken -= 1
    return found


def _connect(live: LiveCell, rig: Rig, clock: Clock, wire: Wire) -> None:
    def pose_now() -> RigidTransform:
        return RigidTransform.from_rounded(rig.cell.at(time.monotonic()).reported.tolist(), "base", "tool0")

    rig.go(rig.good[0])
    robot = source_of(pose_now, clock, wire)
    scanner = SOURCES.get("frame-folder")
    for name, source, settings in (
        ("robot", robot, robot.settings()),
        ("scanner", scanner, scanner.settings.parsed({"folder": str(rig.folder)})),
    ):
        live.add(Link(name, source, settings, live.arrived, live.forget))


def _taken(rig: Rig, found: Trial) -> Callable[[Capture, Mapping[str, bytes]], Measured]:
    """Return what takes captures, and counts those whose pose is not where the robot stands."""

    def take(capture: Capture, _: Mapping[str, bytes]) -> Measured:
        true = rig.cell.at(time.monotonic()).reported
        assert capture.pose is not None
        told = parse_pose(rig.simulated.session.cell.pose_convention, capture.pose)
        found.taken += 1
        found.wrong += bool(np.linalg.norm(told.translation_mm - true[:3, 3]) > _WRONG_MM)
        return Measured(capture=capture.id, kind=capture.kind, verdict="pass")

    return take


def _no_optics() -> None:
    raise AssertionError("the scanner sends profiles")


def _wait(until: Callable[[], bool]) -> None:
    end_s = time.monotonic() + _PATIENCE_S
    while not until():
        assert time.monotonic() < end_s, "no first capture"
        time.sleep(0.02)
