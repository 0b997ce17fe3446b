"""A robot's source with a fault between controller and workbench: what is told goes on, what it says is wrong."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Literal, get_args

from calib_core.frames import RigidTransform
from server.sources.device import Clock, Description, Sample, host_now_s
from server.sources.source import Source

Fault = Literal["freeze", "stale", "late", "reordered", "duplicated", "two publishers", "slow clock"]
FAULTS: tuple[Fault, ...] = get_args(Fault)
_EVERY_S, _LATE_S = 0.02, 1.0


@dataclass
class Wire:
    """What lies between: a fault that can be switched on while the robot goes on."""

    fault: Fault | None = None


class FaultyRobot:
    """Tells where a robot stands, fifty times a second, through a wire with a fault.

    Parameters
    ----------
    pose_now : callable
        base_from_tool0 as the controller would tell it.
    clock : Clock
        "every-reading" stamps each reading, "on-change" the last change, "none" nothing.
    wire : Wire
    """

    def __init__(self, pose_now: Callable[[], RigidTransform], clock: Clock, wire: Wire) -> None:
        self._pose_now, self._clock, self._wire = pose_now, clock, wire
        self._changed: tuple[str, float] | None = None
        self._told: deque[Sample] = deque(maxlen=500)
        self._began_s: float | None = None
        self._next: Iterator[Sample] = self._through()

    def describe(self) -> Description:
        return Description("a robot behind a faulty wire", "mm, degrees", "abb", "flange in base", ("pose",))

    def close(self) -> None:
        pass

    def read(self) -> Sample | None:
        time.sleep(_EVERY_S)
        return replace(next(self._next), host_time_s=host_now_s())

    def _now(self) -> Sample:
        pose, now_s = self._pose_now(), host_now_s()
        if self._clock == "on-change":
            seen = repr(pose.matrix.tolist())
            if self._changed is None or self._changed[0] != seen:
                self._changed = seen, now_s
            stamp_s = self._changed[1]
        else:
            stamp_s = now_s if self._clock == "every-reading" else None
        self._told.append(Sample(now_s, stamp_s, pose))
        return self._told[-1]

    def _through(self) -> Iterator[Sample]:
        while True:
            fresh, before = self._now(), self._wire.fault
            if before is None:
                self._began_s = None
                yield fresh
                continue
            if self._began_s is None:
                self._began_s, kept = fresh.host_time_s, fresh
            match before:
                case "freeze":
                    yield kept
                case "stale":  # a gateway that stamps what it repeats
                    yield replace(kept, device_time_s=fresh.device_time_s)
                case "late":
                    due_s = fresh.host_time_s - min(_LATE_S, fresh.host_time_s - self._began_s)
                    yield next(s for s in reversed(self._told) if s.host_time_s <= due_s)
                case "reordered":
                    later = self._now()
                    yield later
                    yield fresh
                case "duplicated":
                    yield fresh
                    yield fresh
                case "two publishers":
                    yield fresh
                    yield replace(kept, device_time_s=fresh.device_time_s)
                case "slow clock":
                    slow_s = 0.5 * (fresh.host_time_s - self._began_s)
                    moved = fresh.device_time_s
                    yield replace(fresh, device_time_s=None if moved is None else moved - slow_s)


def source_of(pose_now: Callable[[], RigidTransform], clock: Clock, wire: Wire) -> Source:
    """Return the source of such a robot, as the workbench connects one."""
    return Source(
        f"faulty-{clock}",
        "A robot behind a faulty wire",
        "Tells a pose fifty times a second.",
        connect=lambda _: FaultyRobot(pose_now, clock, wire),
        delivers=("robot",),
        clock=clock,
    )
