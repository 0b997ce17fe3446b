"""A robot or scanner that was late before it was connected: its clock was never heard telling less."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from faulty_robot import Wire, samples, source_of

from server.live.link import Link
from server.live.live_cell import LiveCell
from server.sources.device import Description, Frame, Sample, host_now_s
from server.sources.source import Source
from tests.server.live_rig import Rig

_EXPOSED_EVERY_S = 0.05


@dataclass
class _Scanner:
    """Tells what the cell looked like some time ago, with the time at which it did."""

    rig: Rig
    wire: Wire
    late_s: float
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))

    def describe(self) -> Description:
        return Description("a late scanner", "mm", None, "", ("profile",))

    def close(self) -> None:
        pass

    def read(self) -> Frame:
        time.sleep(_EXPOSED_EVERY_S)
        exposed_s = time.monotonic() - self.late_s
        content = self.rig.cell.profile(exposed_s, self.random)
        self.wire.exposed_s[content] = exposed_s
        return Frame(host_now_s(), "late.csv", content, exposed_s)


def connect_late(live: LiveCell, rig: Rig, wire: Wire, late: Literal["robot", "scanner"], late_s: float) -> None:
    """Connect a robot and a scanner whose readings have times, one of them late."""
    robot_s, scanner_s = late_s * (late == "robot"), late_s * (late == "scanner")
    now: Callable[[], Sample] = samples(lambda: rig.cell.at(time.monotonic() - robot_s), "every-reading")

    def told() -> Sample:
        sample = now()
        return replace(sample, device_time_s=sample.host_time_s - robot_s)

    scanner = Source(
        "late-scanner",
        "A late scanner",
        "Tells what was.",
        connect=lambda _: _Scanner(rig, wire, scanner_s),
        delivers=("scanner",),
        clock="every-reading",
    )
    for name, source in (("robot", source_of(told, "every-reading")), ("scanner", scanner)):
        live.add(Link(name, source, source.settings(), live.arrived, live.forget))
