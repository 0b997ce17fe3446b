"""A device's stream with a fault between it and the workbench: what is told goes on, what it says is wrong."""

import random
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Literal, get_args

from calib_core.frames import RigidTransform
from calib_core.simulation.live_cell import Moment
from server.sources.device import Clock, Description, Sample, host_now_s
from server.sources.source import Source

Fault = Literal["freeze", "stale", "late", "reordered", "duplicated", "two publishers", "slow clock"]
FAULTS: tuple[Fault, ...] = get_args(Fault)
_EVERY_S, _LATE_S = 0.02, 1.0


@dataclass
class Wire:
    """What lies between: a fault that can be switched on while the device goes on, and whether it has begun.

    `exposed_s` is when files were exposed whose stamps say another time.
    """

    fault: Fault | None = None
    begun: bool = False
    exposed_s: dict[bytes, float] = field(default_factory=dict[bytes, float])


class FaultyStream:
    """What comes out of a wire with a fault: readings with `host_time_s` and `device_time_s`, one at each call.

    Parameters
    ----------
    now : callable
        The reading as the device tells it.
    wire : Wire
    """

    def __init__(self, now: Callable[[], Any], wire: Wire) -> None:
        self._now, self._wire = now, wire
        self._told: deque[Any] = deque()
        self._began_s: float | None = None
        self._through = self._readings()
        self._either = random.Random(1)
        self._lock = threading.Lock()

    def __call__(self) -> Any:
        with self._lock:
            return next(self._through)

    def _fresh(self) -> Any:
        self._told.append(self._now())
        while len(self._told) > 3 and self._told[0].host_time_s < self._told[-1].host_time_s - 2 * _LATE_S:
            self._told.popleft()  # images are large
        return self._told[-1]

    def _readings(self) -> Iterator[Any]:
        while True:
            fresh, before = self._fresh(), self._wire.fault
            if before is None:
                self._began_s = None
                yield fresh
                continue
            if self._began_s is None:
                self._began_s, kept = fresh.host_time_s, fresh
                self._wire.begun = True
            match before:
                case "freeze":
                    yield kept
                case "stale":  # a gateway that stamps what it repeats
                    yield replace(kept, device_time_s=fresh.device_time_s)
                case "late":
                    due_s = fresh.host_time_s - min(_LATE_S, fresh.host_time_s - self._began_s)
                    yield next((s for s in reversed(self._told) if s.host_time_s <= due_s), kept)
                case "reordered":  # the third comes before the second
                    yield fresh
                    self._fresh()
                    yield self._told[-3] if len(self._told) > 2 else kept
                case "duplicated":
                    yield fresh
                    yield fresh
                case "two publishers":
                    other = replace(kept, device_time_s=fresh.device_time_s)
                    yield self._either.choice((fresh, other))  # in turns, what is asked twice hears one alone
                case "slow clock":
                    slow_s = 0.5 * (fresh.host_time_s - self._began_s)
                    moved = fresh.device_time_s
                    yield replace(fresh, device_time_s=None if moved is None else moved - slow_s)


def samples(moment: Callable[[], Moment], clock: Clock) -> Callable[[], Sample]:
    """Return what a controller tells of its flange and table, with stamps by its kind of clock."""
    changed: list[tuple[str, float]] = []

    def now() -> Sample:
        at, now_s = moment(), host_now_s()
        pose = RigidTransform.from_rounded(at.reported.tolist(), "base", "tool0")
        if clock == "none":
            return Sample(now_s, None, pose, table_deg=at.table_deg, moving=at.moving)
        seen = repr(pose.matrix.tolist())
        if clock == "every-reading" or not changed or changed[0][0] != seen:
            changed[:] = [(seen, now_s)]
        return Sample(now_s, changed[0][1], pose, table_deg=at.table_deg, moving=at.moving)

    return now


class FaultyRobot:
    """Tells where a robot stands, fifty times a second, through a wire with a fault."""

    def __init__(self, told: Callable[[], Sample]) -> None:
        self._told = told

    def describe(self) -> Description:
        return Description("a robot behind a faulty wire", "mm, degrees", "abb", "flange in base", ("pose",))

    def close(self) -> None:
        pass

    def read(self) -> Sample | None:
        time.sleep(_EVERY_S)
        return replace(self._told(), host_time_s=host_now_s(), table_deg=None, moving=None)


def source_of(told: Callable[[], Sample], clock: Clock) -> Source:
    """Return the source of such a robot, as the workbench connects one."""
    return Source(
        f"faulty-{clock}",
        "A robot behind a faulty wire",
        "Tells a pose fifty times a second.",
        connect=lambda _: FaultyRobot(told),
        delivers=("robot",),
        clock=clock,
    )
