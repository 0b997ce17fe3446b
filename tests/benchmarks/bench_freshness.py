"""What is stored while a robot's source is not fresh: every fault, every kind of clock.

The robot of the simulated cell tells its pose through a wire with a fault, its scanner writes profiles into a
folder; captures are taken at standstill by themselves, as on a cell.  A capture counts as wrong where its pose is
not where the robot truly stood.  A healthy cell's late capture counts for nothing where the bench itself waited
for a processor; how many, is told.

A part of it mostly waits: with SCANCELL_BENCH_KEPT, SCANCELL_BENCH_AT_ONCE parts are done beside each other,
each in a process of its own.
"""

import gc
import os
import re
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from faulty_robot import FAULTS, Fault, FaultyStream, Wire, samples, source_of
from faulty_wires import ROBOTS, SCANNERS, TABLES, device
from harness import Row, all_kept, kept
from late_start import connect_late

from calib_core.optics.camera_model import CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Capture, Cell, Measured
from calib_core.robots import parse_pose
from calib_core.simulation.live_camera import HEIGHT_PX, WIDTH_PX, LiveCamera
from server.live.exposures import Optics
from server.live.link import Link
from server.live.live_captures import CaptureSettings
from server.live.live_cell import LiveCell
from server.sources.device import Clock
from server.sources.registry import SOURCES
from tests.server.live_rig import Rig

CLOCKS: tuple[Clock, ...] = get_args(Clock)
WAYS = (*CLOCKS, *ROBOTS, *SCANNERS, *TABLES)
"""Kinds of clock of a plain source, then our own sources before a device that speaks their protocol."""
PARTS = (3, 25, 25, 25, 25)
"""How many places the parts of a full bench go to."""
AT_THE_END: tuple[Clock, ...] = ("none", "on-change")
"""Clocks of streams that freeze as a move ends."""
LATE: tuple[Literal["robot", "scanner"], ...] = ("robot", "scanner")
_ALONE = "genicam"  # the loopback network has one place for a camera
_WRONG_MM, _WRONG_DEG = 0.5, 0.05
_STAY_S, _TRAVEL_S = 2.0, 0.4
_WAY_S = {"duplicated": 1.5, "reordered": 1.5}  # in which an order shows: twenty readings of a slow source
_FAULTY_STAY_S = 1.2, 2.4  # as soon as a healthy one is captured, and longer
_WANTED_S = 0.5
_PATIENCE_S = 60.0
_NAMES = re.compile("moved|fresh|repeats|turned")


@dataclass
class Trial:
    """How captures went: taken, with a wrong pose or angle, what was said, and how soon."""

    taken: int = 0
    names: set[str] = field(default_factory=set[str])
    off: set[str] = field(default_factory=set[str])  # captures that count, with a wrong pose or angle
    said: list[str] = field(default_factory=list[str])
    named_s: float | None = None
    waited_s: float = 0.0  # for a processor, until then
    late: list[tuple[str, float]] = field(
        default_factory=list[tuple[str, float]]
    )  # why, and the wait for a processor

    @property
    def wrong(self) -> int:
        """How many that count have a wrong pose or angle."""
        return len(self.off)

    def leave_out(self, capture: str, why: str) -> None:
        """Count a capture no longer."""
        self.off.discard(capture)
        self.said.append(why)

    def told(self) -> dict[str, Any]:
        """Return what is kept of it."""
        return {
            "taken": self.taken,
            "wrong": self.wrong,
            "said": named(self),
            "named_s": self.named_s,
            "waited_s": self.waited_s,
            "late": self.late,
        }


def run(full: bool) -> Iterator[Row]:
    """Yield the figures, and print each way and fault; `full` goes to a hundred places with each."""
    parts = PARTS if full else PARTS[:1]
    if (at_once := int(os.environ.get("SCANCELL_BENCH_AT_ONCE", "1"))) > 1:
        keep_all(parts, at_once)
    healthy = [one for way in WAYS for one in tried(way, None, parts)]
    faults = list[tuple[str, Fault, dict[str, Any]]]()
    for way in WAYS:
        for fault in FAULTS:
            found = tried(way, fault, parts)
            if not found:
                continue
            faults += [(way, fault, one) for one in found]
            wrong, taken = sum(one["wrong"] for one in found), sum(one["taken"] for one in found)
            measured = f"{wrong} of {taken} captures at {_places(found)} places; {found[0]['said']}"
            print(f"    {way}, {fault}: {measured}", flush=True)
    faulty = [one for _, _, one in faults]
    every = len(WAYS) * len(FAULTS) * sum(parts)
    wrong = sum(one["wrong"] for one in (*healthy, *faulty))
    measured = f"{wrong} at {_places(faulty)} of {every} places"
    yield Row(f"{len(WAYS)} ways, each with {len(FAULTS)} faults: wrong captures", "0", measured, not wrong)
    late = [one for found in healthy for one in found["late"]]
    for why, waited_s in late:
        print(f"    late: {why}; {waited_s:.1f} s without a processor", flush=True)
    starved = sum(waited_s > _WANTED_S for _, waited_s in late)
    goals, late = _places(healthy) - starved, len(late) - starved
    measured = f"{goals - late} of {goals}; {starved} more came late for want of a processor"
    yield Row(
        f"{len(WAYS)} ways without a fault: captured within 2 s", "≥ 99.5 %", measured, late <= 0.005 * goals
    )
    for way, fault, one in faults:
        if one["named_s"] is None and shows(way, fault):
            print(f"    not named: {way}, {fault}", flush=True)
    shown = [one for way, fault, one in faults if shows(way, fault)]
    fed = [one for one in shown if one["waited_s"] < _WANTED_S]
    told = [one["named_s"] for one in fed if one["named_s"] is not None]
    measured = f"{np.median(told):.1f}, {max(told):.1f} s in {len(told)} of {len(fed)} runs"
    measured += f"; {len(shown) - len(fed)} starved"
    holds = max(told) <= 2.0 and len(told) == len(fed)
    yield Row("a fault is named after, median and worst", "≤ 2 s", measured, holds)
    hidden = [one for way, fault, one in faults if not shows(way, fault)]
    wrong, taken = sum(one["wrong"] for one in hidden), sum(one["taken"] for one in hidden)
    yield Row(
        "a slow clock whose time is not sent, or not with each reading: wrong captures",
        "0",
        f"{wrong} of {taken} at {_places(hidden)} places",
        not wrong,
    )
    for clock in AT_THE_END:
        if found := all_kept(steps_at_the_end(clock, parts)):
            wrong, taken, left = (sum(one[name] for one in found) for name in ("wrong", "taken", "left"))
            measured = f"{wrong} of {taken} captures, {left} left out again"
            yield Row(
                f"{clock}, frozen in the last 0.3 s of a move: wrong poses that count", "0", measured, not wrong
            )

    late = all_kept({f"late-{which}": partial(_told_late, which, 12 if full else 2) for which in LATE})
    measured = f"{sum(one['wrong'] for one in late)} of {sum(one['taken'] for one in late)} captures"
    yield Row(
        "a timed robot or scanner, a second late before it is connected: wrong poses that count",
        "0",
        measured,
        not any(one["wrong"] for one in late),
    )


def shows(way: str, fault: Fault) -> bool:
    """Return whether a fault changes anything that arrives: a slow clock only what each reading tells of it."""
    clock = way if way in CLOCKS else SOURCES.get(way).clock
    return fault != "slow clock" or clock == "every-reading"


def _places(found: list[dict[str, Any]]) -> int:
    return sum(one["places"] for one in found)


def keep_all(parts: tuple[int, ...], at_once: int) -> None:
    """Keep the parts of all ways and faults, the first parts of all first, some beside each other."""
    context = get_context("forkserver")
    context.set_forkserver_preload([__name__])  # what is imported is imported once
    with ExitStack() as opened:
        alone, others = (opened.enter_context(ProcessPoolExecutor(count, context)) for count in (1, at_once - 1))
        due: list[Future[object]] = []
        for number, moves in enumerate(parts):
            for fault in (None, *FAULTS):
                for way in WAYS:
                    pool = alone if way == _ALONE else others
                    due.append(pool.submit(part_of, way, fault, number, moves))
            due += [others.submit(part_at_the_end, clock, number, moves) for clock in AT_THE_END]
        for one in due:
            if (error := one.exception()) is not None:  # no processor, no first capture
                print(f"    {error}", flush=True)


def tried(way: str, fault: Fault | None, parts: tuple[int, ...]) -> list[dict[str, Any]]:
    """Return what came of a way with a fault, in parts that are kept; each begins healthy."""
    steps = {
        _name(way, fault, number): partial(_told, way, fault, number, moves) for number, moves in enumerate(parts)
    }
    return all_kept(steps)


def part_of(way: str, fault: Fault | None, number: int, moves: int) -> dict[str, Any]:
    """Return what came of a part, kept."""
    return kept(_name(way, fault, number), partial(_told, way, fault, number, moves))


def _name(way: str, fault: Fault | None, number: int) -> str:
    return f"{way} {fault} {number}".replace(" ", "-")


def _told(way: str, fault: Fault | None, number: int, moves: int) -> dict[str, Any]:
    found = {**trial(way, fault, moves, number).told(), "places": moves}
    gc.collect()  # a hundred images a part, in cycles of threads and streams
    return found


def steps_at_the_end(clock: Clock, parts: tuple[int, ...]) -> dict[str, Callable[[], dict[str, Any]]]:
    """Return the parts of a stream that freezes as moves end, by their names."""
    return {
        f"at-the-end-{clock}-{number}": partial(_told_at_the_end, clock, moves, number)
        for number, moves in enumerate(parts)
    }


def part_at_the_end(clock: Clock, number: int, moves: int) -> dict[str, Any]:
    """Return what came of a part, kept."""
    return kept(f"at-the-end-{clock}-{number}", partial(_told_at_the_end, clock, moves, number))


def _told_at_the_end(clock: Clock, moves: int, number: int) -> dict[str, Any]:
    found = frozen_at_the_end(clock, moves, 3 + number)
    return {"taken": found.taken, "wrong": found.wrong, "left": len(found.said)}


def frozen_at_the_end(clock: Clock, moves: int, seed: int = 3, held_up: bool = False) -> Trial:
    """Return how captures went where a robot's stream freezes 0.3 s or less before each second move ends.

    `held_up` stops this process (not on Windows) while the robot stands there or goes on, in turns.
    """
    wire, found, random = Wire(), Trial(), np.random.default_rng(seed)
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(Path(folder) / "scanner")
        cell, rig_optics = _cell(rig, clock)
        rig.go(rig.good[0])
        live = LiveCell(
            lambda: (cell, found.names, rig_optics),
            _taken(rig, found, wire),
            CaptureSettings(automatic=True),
            leave_out=found.leave_out,
        )
        try:
            _connect(live, rig, clock, {}, wire)
            _wait(lambda: found.taken == 1, lambda: live.waits_for)
            for number in range(moves):
                rig.go(rig.good[(2 * number + 1) % len(rig.good)])
                time.sleep(_TRAVEL_S - random.uniform(0.02, 0.3))
                wire.fault = "freeze"
                (_hold_up if held_up and number % 2 else time.sleep)(_STAY_S)
                rig.go(rig.good[(2 * number + 2) % len(rig.good)])
                (_hold_up if held_up and not number % 2 else time.sleep)(_TRAVEL_S + _STAY_S)
                # It was seen there, if nobody was held up; then it is heard again.
                wire.fault = None
                time.sleep(_STAY_S)
        finally:
            live.stop()
            rig.stop()
    return found


def _hold_up(seconds: float) -> None:
    """Let none of this process's threads run for a while, from now on."""
    script = 'kill -STOP "$1"; sleep "$2"; kill -CONT "$1"'
    with subprocess.Popen(["sh", "-c", script, "", str(os.getpid()), str(seconds)]):
        pass


def _told_late(which: Literal["robot", "scanner"], moves: int) -> dict[str, Any]:
    found = late_from_the_start(which, moves)
    return {"taken": found.taken, "wrong": found.wrong}


def late_from_the_start(which: Literal["robot", "scanner"], moves: int) -> Trial:
    """Return how captures went of a robot or scanner that was a second late before it was connected."""
    wire, found = Wire(), Trial()
    with tempfile.TemporaryDirectory() as folder:
        rig = Rig(Path(folder) / "scanner")
        counted, (cell, rig_optics) = set[str](), _cell(rig, "none")
        live = LiveCell(
            lambda: (cell, found.names, rig_optics),
            _taken(rig, found, wire),
            CaptureSettings(automatic=True),
            leave_out=found.leave_out,
        )
        try:
            connect_late(live, rig, wire, which, 1.0)
            time.sleep(_STAY_S)
            for number in range(moves + 1):
                counted = set(found.names)  # what was wrong comes out when the robot goes on
                rig.go(rig.good[number % len(rig.good)])
                time.sleep(_TRAVEL_S + _STAY_S + 1.0)
            found.off &= counted
        finally:
            live.stop()
            rig.stop()
    return found


def named(found: Trial) -> str:
    """Return what was said most while a fault was on."""
    return max(set(found.said), key=found.said.count) if found.said else "nothing said"


def trial(way: str, fault: Fault | None, moves: int, seed: int = 0) -> Trial:
    """Return how captures went on a cell whose robot goes from place to place, with a fault from the second on."""
    wire, found, random = Wire(), Trial(), np.random.default_rng(seed)
    travel_s = _WAY_S.get(fault or "", _TRAVEL_S)
    with tempfile.TemporaryDirectory() as folder:
        step = "turntable" if way in TABLES else "tcp"
        rig = Rig(Path(folder) / "scanner", step, travel_s=travel_s)
        places = [k for k in rig.good if rig.simulated.session.captures[k].step == step]
        cell, rig_optics = _cell(rig, way)
        rig.go(places[0])
        live = LiveCell(
            lambda: (cell, found.names, rig_optics),
            _taken(rig, found, wire),
            CaptureSettings(automatic=True, step=step),
            leave_out=found.leave_out,
        )
        faulty = nullcontext({}) if way in CLOCKS else device(way, rig, wire)
        try:
            with faulty as settings:
                _connect(live, rig, way, settings, wire)
                _wait(lambda: found.taken == 1, lambda: live.waits_for)
                wire.fault = fault
                _wait(lambda: wire.begun or fault is None, lambda: "the fault does not begin")
                began_s = time.monotonic()
                for number in range(1, moves + 1):
                    rig.go(places[number % len(places)])
                    _stay(live, found, began_s, travel_s, random if fault else None)
                counted = set(found.names)
                rig.go(places[(moves + 1) % len(places)])  # what was wrong comes out when the robot goes on
                time.sleep(travel_s + _STAY_S)
                live.stop()
        finally:
            live.stop()
            rig.stop()
    found.off &= counted
    found.taken = len(counted) - 1
    return found


def _stay(
    live: LiveCell, found: Trial, began_s: float, travel_s: float, faulty: np.random.Generator | None
) -> None:
    """Stay at a place until it is captured, or with a fault for a while, and hear what is said meanwhile."""
    before, waited_s = found.taken, _waited_s()
    ends_s = time.monotonic() + travel_s + (faulty.uniform(*_FAULTY_STAY_S) if faulty else _STAY_S)
    while time.monotonic() < ends_s and (faulty or found.taken == before):
        time.sleep(0.05)
        told = [why for link in live.links.values() if (why := link.state().why)]
        found.said += told or ([live.waits_for] if _NAMES.search(live.waits_for) else [])
        if found.said and found.named_s is None:
            found.named_s, found.waited_s = time.monotonic() - began_s, _waited_s() - waited_s
    if not faulty and found.taken == before:
        found.late.append((live.waits_for, _waited_s() - waited_s))


_waits_ns: dict[str, int] = {}
"""Of threads that ended, too: a link that connects anew takes its wait with it, and the sum went down."""


def _waited_s() -> float:
    """Return how long this process's threads have been ready to run, and did not for others' sake (Linux)."""
    for path in Path("/proc/self/task").glob("*/schedstat"):
        with suppress(OSError):  # it ended meanwhile
            _waits_ns[path.parent.name] = int(path.read_text().split()[1])
    return sum(_waits_ns.values()) / 1e9


def _connect(live: LiveCell, rig: Rig, way: str, settings: Mapping[str, object], wire: Wire) -> None:
    clock: Clock = way if way in CLOCKS else "every-reading"
    told = FaultyStream(samples(lambda: rig.cell.at(time.monotonic()), clock), wire if way in CLOCKS else Wire())
    robot, scanner = source_of(told, clock), SOURCES.get("frame-folder")
    chosen = {"robot": (robot, robot.settings()), "scanner": (scanner, {"folder": str(rig.folder)})}
    if way not in CLOCKS:
        chosen["scanner" if way in SCANNERS else "table" if way in TABLES else "robot"] = (
            SOURCES.get(way),
            settings,
        )
    for name, (source, given) in chosen.items():
        parsed = source.settings.parsed(given) if isinstance(given, Mapping) else given
        live.add(Link(name, source, parsed, live.arrived, live.forget))


def _taken(rig: Rig, found: Trial, wire: Wire) -> Callable[[Capture, Mapping[str, bytes]], Measured]:
    """Return what takes captures, and counts those whose pose is not where the robot stood when it was exposed.

    When that was, the rig says: a writer that waits for a processor stamps its file later.
    """
    profile = rig.cell.profile

    def exposed(now_s: float, rng: np.random.Generator) -> bytes:
        content = profile(now_s, rng)
        wire.exposed_s[content] = now_s
        return content

    rig.cell.profile = exposed

    def take(capture: Capture, files: Mapping[str, bytes]) -> Measured:
        assert capture.pose is not None
        assert capture.device_time_s is not None
        of_day_s = time.time() - time.monotonic()  # a file's time is of the day, a sensor's here is the host's
        exposed_s = wire.exposed_s.get(_what_was_seen(*files.items()), capture.device_time_s)
        true = rig.cell.at(exposed_s - (of_day_s if exposed_s > of_day_s else 0.0))
        told = parse_pose(rig.simulated.session.cell.pose_convention, capture.pose)
        off_mm = np.linalg.norm(told.translation_mm - true.reported[:3, 3])
        off_deg = abs((capture.table_deg or 0.0) - true.table_deg) if capture.step == "turntable" else 0.0
        found.taken += 1
        found.names.add(capture.id)
        if off_mm > _WRONG_MM or off_deg > _WRONG_DEG:
            found.off.add(capture.id)
        return Measured(capture=capture.id, kind=capture.kind, verdict="pass")

    return take


def _what_was_seen(file: tuple[str, bytes], *_: object) -> bytes:
    """Return what a file is known by: a profile by its bytes, an image by those of its pixels."""
    import cv2

    name, content = file
    if not name.endswith(".bmp"):
        return content
    image = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    return sha256(image.tobytes()).digest()


def _cell(rig: Rig, way: str) -> tuple[Cell, Optics]:
    """Return a cell, with the tool that is solved before its table is looked at, and a raw camera's optics."""
    cell, world = rig.simulated.session.cell, rig.simulated.world
    assert world is not None
    solved = {"tool0_from_laser": world.tool0_from_laser.tolist()} if way in TABLES else {}
    cell = cell.model_copy(update={"known": cell.known.model_copy(update=solved)})
    known = LiveCamera(np.random.default_rng(5)).known()
    model = CameraModel.from_names(
        known["camera"]["camera_matrix"], known["camera"]["distortion"], (WIDTH_PX, HEIGHT_PX)
    )
    plane = known["laser_plane"]
    return cell, lambda: ProfileCalibration.of(model, plane["normal"], plane["distance_mm"])


def _wait(until: Callable[[], bool], why_not: Callable[[], str]) -> None:
    end_s = time.monotonic() + _PATIENCE_S
    while not until():
        assert time.monotonic() < end_s, f"no first capture: {why_not()}"
        time.sleep(0.02)
