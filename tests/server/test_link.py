"""The link to a device: what comes after a loss, nonsense or what is not fresh is joined to nothing before it."""

import errno
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.findings.catalogues import catalogue
from calib_core.frames import RigidTransform
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Capture, Measured
from calib_core.simulation import simulate
from server.live.link import Link
from server.live.live_captures import CaptureSettings
from server.live.live_cell import LiveCell
from server.sources.device import Clock, Description, Reading, Sample, host_now_s
from server.sources.source import Source
from tests.server.live_rig import until

AT_REST = RigidTransform.of([0.0, 0.0, 0.0], [800.0, 0.0, 500.0], "base", "tool0")


@dataclass
class Told:
    """A device that tells what it is told to, fifty times a second."""

    now: Callable[[], Sample]
    heard: list[str] = field(default_factory=list[str])

    def describe(self) -> Description:
        return Description("a robot", "mm, degrees", "abb", "flange in base", ("pose",))

    def close(self) -> None:
        pass

    def read(self) -> Reading | None:
        time.sleep(0.02)
        return self.now()


def stamped() -> Sample:
    return Sample(host_now_s(), host_now_s(), AT_REST)


def source_of(device: Told, clock: Clock = "every-reading") -> Source:
    return Source("told", "Told", "Tells.", connect=lambda _: device, delivers=("robot",), clock=clock)


def frozen() -> Callable[[], Sample]:
    stamp_s = host_now_s()
    return lambda: Sample(host_now_s(), stamp_s, AT_REST)


def refused() -> Callable[[], Sample]:
    def read() -> Sample:
        raise InputError("a pose", "none", "Look at the controller.", "pose")

    return read


def far_away() -> Callable[[], Sample]:
    place = RigidTransform.of([0.0, 0.0, 0.0], [9e6, 0.0, 0.0], "base", "tool0")
    return lambda: Sample(host_now_s(), host_now_s(), place)


def gone() -> Callable[[], Sample]:
    def read() -> Sample:
        raise ConnectionResetError("reset by peer")

    return read


@pytest.mark.parametrize("trouble", [frozen, refused, far_away, gone])
def test_what_cannot_be_trusted_is_told_as_a_loss(trouble: Callable[[], Callable[[], Sample]]) -> None:
    device = Told(stamped)
    source = source_of(device)
    link = Link("robot", source, source.settings(), lambda _, __: None, device.heard.append)
    link.start()
    try:
        until(lambda: link.state().readings > 25)
        assert device.heard == []
        device.now = trouble()
        until(lambda: device.heard, lambda: link.state())
    finally:
        link.stop()
    assert set(device.heard) == {"robot"}


def _no_optics() -> ProfileCalibration:
    raise AssertionError("there is no camera")


def _never(capture: Capture, files: Mapping[str, bytes]) -> Measured:
    raise AssertionError("nothing is taken without a scanner")


@pytest.fixture
def cell() -> Iterator[tuple[LiveCell, Told]]:
    record = simulate("tcp", 7).session.cell
    live = LiveCell(lambda: (record, set[str](), _no_optics), _never, CaptureSettings())
    device = Told(stamped)
    source = source_of(device)
    live.add(Link("robot", source, source.settings(), live.arrived, live.forget))
    yield live, device
    live.stop()


@pytest.mark.parametrize("trouble", [frozen, refused, gone])
def test_a_cell_forgets_where_its_robot_was_when_the_link_loses_it(
    cell: tuple[LiveCell, Told], trouble: Callable[[], Callable[[], Sample]]
) -> None:
    live, device = cell
    until(lambda: live.newest()[0] is not None)
    version = live.version
    device.now = trouble()
    until(lambda: live.newest()[0] is None, lambda: live.links["robot"].state())
    assert live.version > version
    device.now = stamped
    again = until(lambda: live.newest()[0])
    np.testing.assert_allclose(again.base_from_tool0.translation_mm, AT_REST.translation_mm)


def test_a_clock_that_begins_anew_is_another_one() -> None:
    """Whether a device that was switched on anew is late, its new clock cannot tell."""
    device = Told(stamped)
    source = source_of(device)
    link = Link("robot", source, source.settings(), lambda _, __: None, device.heard.append)
    link.start()
    try:
        until(lambda: link.state().readings > 25)
        first = link.baseline
        device.now = gone()
        until(lambda: link.state().status == "lost")
        device.now = stamped
        until(lambda: link.state().status == "live")
        until(lambda: link.state().fresh)
        assert link.baseline is first
        device.now = gone()
        until(lambda: link.state().status == "lost")
        device.now = lambda: Sample(host_now_s(), host_now_s() - 500.0, AT_REST)
        until(lambda: link.baseline is not first)
    finally:
        link.stop()


def test_a_device_that_is_late_from_its_reconnection_on_is_not_believed() -> None:
    """What was known of its clock was forgotten with the connection: late images were taken with new poses."""
    device = Told(stamped)
    source = source_of(device)
    link = Link("robot", source, source.settings(), lambda _, __: None, device.heard.append)
    link.start()
    try:
        until(lambda: link.state().readings > 25)
        device.now = gone()
        until(lambda: link.state().status == "lost")
        device.now = lambda: Sample(host_now_s(), host_now_s() - 1.0, AT_REST)
        until(lambda: "arrive late" in link.state().why, lambda: link.state())
        device.now = gone()
        until(lambda: link.state().status == "lost")
        device.now = lambda: Sample(host_now_s(), host_now_s() - 500.0, AT_REST)
        until(lambda: link.state().fresh, lambda: link.state())
    finally:
        link.stop()


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            ConnectionRefusedError(111, "Connection refused"),
            "unter dieser Adresse und diesem Port antwortet nichts",
        ),
        (ConnectionResetError(104, "Connection reset by peer"), "die Gegenseite hat die Verbindung beendet"),
        (socket.gaierror(-2, "Name or service not known"), "dieser Name ist im Netz nicht bekannt"),
        (OSError(errno.EHOSTUNREACH, "No route to host"), "zu dieser Adresse führt kein Weg im Netz"),
    ],
)
def test_why_a_device_is_not_reached_is_said_in_every_language(error: OSError, said: str) -> None:
    def unreached(_: object) -> Told:
        raise error

    source = replace(source_of(Told(stamped)), connect=unreached)
    link = Link("robot", source, source.settings(), lambda _, __: None, lambda _: None)
    link.start()
    try:
        until(lambda: link.state().status == "lost")
        assert catalogue("de").say(link.state().problem) == f"Nicht erreichbar: {said}."
    finally:
        link.stop()
