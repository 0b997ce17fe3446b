"""A Gocator's data channel: profiles as they are, lost ones told, and what is no profile named."""

import itertools
import socket
from collections.abc import Iterator

import numpy as np
import pytest

from calib_core.errors import InputError
from calib_core.formats.points import read_file
from server.simulated_cell.tcp_server import TcpServer
from server.sources.device import Device, Frame
from server.sources.gocator import GocatorSettings
from server.sources.registry import SOURCES
from tests.core.scanner_files import known, profile
from tests.server.gocator_server import GocatorServer

POINTS = profile()


@pytest.fixture
def sensor(request: pytest.FixtureRequest) -> Iterator[GocatorServer]:
    moments = itertools.count(5)
    server = GocatorServer(lambda: (POINTS, 0.25 * next(moments)), 100.0, uniform=getattr(request, "param", False))
    yield server
    server.stop()


def connected(port: int):
    connect = SOURCES.get("gocator").connect
    assert connect is not None
    return connect(GocatorSettings(host="127.0.0.1", port=port))


def next_frame(device: Device) -> Frame:
    while (found := device.read()) is None:
        pass
    assert isinstance(found, Frame)
    return found


@pytest.mark.parametrize("sensor", [False, True], indirect=True, ids=["points", "uniform"])
def test_profiles_come_as_the_sensor_saw_them(sensor: GocatorServer) -> None:
    device = connected(sensor.port)
    first, second = next_frame(device), next_frame(device)
    device.close()
    reading = read_file(first.content, first.name, "profile")
    assert (reading.unit_from, reading.doubts, len(reading.points)) == ("header", (), len(POINTS))
    np.testing.assert_allclose(reading.points[reading.known], known(POINTS), atol=2e-3)
    np.testing.assert_array_equal(reading.known, np.isfinite(POINTS).all(axis=1))
    assert first.device_time_s is not None
    assert second.device_time_s == pytest.approx(first.device_time_s + 0.25)


def test_lost_profiles_are_told_and_the_next_ones_come(sensor: GocatorServer) -> None:
    device = connected(sensor.port)
    next_frame(device)
    sensor.lose = 7
    with pytest.raises(InputError, match=r"7 lost.*MTU"):
        list(itertools.islice((next_frame(device) for _ in itertools.count()), 200))
    next_frame(device)
    device.close()


class Sends(TcpServer):
    """Sends the same bytes to whoever connects."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        super().__init__()

    def serve(self, peer: socket.socket) -> None:
        peer.sendall(self._content)
        self.stopped.wait(5)


def test_what_is_no_gocator_and_what_is_cut_off_is_refused() -> None:
    for sent, error, said in (
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", ConnectionError, "no Gocator data"),
        (b"\x0a\0\0\0\x08\x80\0\0\0\0", InputError, "profile mode"),
        (b"\x08\0\0\0\x05\x80\0\0", InputError, "cut off"),
        (b"\x40\0\0\0\x01\0\0\0", ConnectionError, "in the middle"),
        (b"\x40\0\0\0\x05\x80" + b"\x28\0" + b"\x01\0\0\0" + b"\xe8\x03\0\0" + bytes(48), InputError, "cut off"),
    ):
        server = Sends(sent)
        device = connected(server.port)
        try:
            with pytest.raises(error, match=said):
                next_frame(device)
        finally:
            device.close()
            server.stop()
