"""GigE Vision against Aravis's camera and client, programs of their own; USB3 against a camera in memory."""

import re
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from calib_core.errors import ConflictError, InputError
from calib_core.formats.shared.images import decode_image
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.triangulate import ProfileCalibration, stripe_in_frame
from calib_core.simulation import simulate
from calib_core.simulation.live_camera import HEIGHT_PX, WIDTH_PX, LiveCamera
from calib_core.simulation.live_cell import LiveCell
from calib_core.sphere.arc import fit_arc
from server.live.link import Link
from server.simulated_cell.gige_server import GigeServer
from server.sources.device import Frame, Reading
from server.sources.genicam import GenicamCamera, GenicamSettings
from server.sources.registry import SOURCES
from tests.server.gige_network import FAKE, aravis_camera, only_camera
from tests.server.live_rig import until

pytest.importorskip("viva_genicam")
SIZE = (WIDTH_PX, HEIGHT_PX)
CLIENT = shutil.which("arv-camera-test-0.8")
HERE = GenicamSettings(address="127.0.0.1", interface="127.0.0.1")


@pytest.fixture(autouse=True)
def _one_camera() -> Iterator[None]:
    with only_camera():
        yield


@pytest.mark.thorough
@pytest.mark.skipif(FAKE is None, reason="Debian's aravis-tools brings the fake camera")
def test_frames_come_by_gige_vision_also_after_the_camera_was_away() -> None:
    source = SOURCES.get("genicam")
    came: list[Reading] = []
    link = Link("camera", source, source.settings(), lambda _, reading: came.append(reading), lambda _: None)
    with aravis_camera():
        link.start()
        until(lambda: len(came) >= 3, link.state)
        about = link.state().description
        assert about is not None
        assert about.model == "Aravis Fake"
        assert about.more == {"Width": "512", "Height": "512", "PixelFormat": "Mono8"}
    until(lambda: link.state().status == "lost", link.state)
    before = len(came)
    with aravis_camera():
        until(lambda: len(came) > before, link.state)
        link.stop()
    frames = [reading for reading in came if isinstance(reading, Frame)]
    assert all(decode_image(frame.content, frame.name).shape == (512, 512) for frame in frames)
    assert len({frame.content for frame in frames[:3]}) == 3


def test_a_camera_that_is_not_there_is_said() -> None:
    with pytest.raises(InputError, match=r"192\.0\.2\.1"):
        GenicamCamera(GenicamSettings(address="192.0.2.1", interface="127.0.0.1"))


@pytest.mark.thorough
def test_the_simulated_camera_shows_the_sphere_where_it_is() -> None:
    rng = np.random.default_rng(3)
    cell, lens = LiveCell(simulate("tcp", 3)), LiveCamera(rng)
    server = GigeServer(lambda us: (lens.image(cell.points(0.0, rng), rng, us), 4.5), SIZE, 10.0)
    try:
        camera = GenicamCamera(HERE.model_copy(update={"exposure_us": 4000.0}))
        assert camera.describe().model == "scancell Simulated camera"
        frame = next(found for _ in range(10) if (found := camera.read()) is not None)
        camera.close()
    finally:
        server.stop()
    assert frame.device_time_s == pytest.approx(4.5)
    known = lens.known()
    model = CameraModel.from_names(known["camera"]["camera_matrix"], known["camera"]["distortion"], SIZE)
    optics = ProfileCalibration.of(model, known["laser_plane"]["normal"], known["laser_plane"]["distance_mm"])
    arc = fit_arc(stripe_in_frame(decode_image(frame.content, frame.name), optics).profile_mm, 40.0)
    true = cell.shots[0].sphere_center_in_laser_mm
    assert np.abs(arc.center_mm - true[[0, 2]]).max() < 0.01
    assert cell.world.sphere_radius_mm**2 - arc.radius_mm**2 == pytest.approx(true[1] ** 2, abs=0.5)


class LossyLine(GigeServer):
    """A camera of whose packets every hundredth gets lost on the way the first time."""

    lost = 0
    count = 0

    def _packet(self, packet: bytes) -> None:
        self.count += 1
        if self.count % 100 == 0:
            self.lost += 1
        else:
            super()._packet(packet)


def picture(_: float) -> tuple[np.ndarray, float]:
    return np.full(SIZE[::-1], 7, dtype=np.uint8), time.monotonic()


@pytest.mark.thorough
def test_packets_that_got_lost_are_asked_for_again() -> None:
    server = LossyLine(picture, SIZE, 30.0)
    try:
        with pytest.raises(ConflictError, match="3956"):
            GigeServer(picture, SIZE)
        camera = GenicamCamera(HERE)
        blocks: list[int] = []
        while len(blocks) < 20:
            if (frame := camera.read()) is not None:
                blocks.append(int(Path(frame.name).stem))
        camera.close()
    finally:
        server.stop()
    assert blocks == list(range(blocks[0], blocks[0] + 20))
    assert server.lost >= 20
    assert server.sent_again >= server.lost // 2


@pytest.mark.thorough
@pytest.mark.skipif(CLIENT is None, reason="Debian's aravis-tools brings the client")
def test_aravis_reads_the_simulated_camera() -> None:
    server = GigeServer(picture, SIZE, 10.0)
    try:
        told = subprocess.run(
            [str(CLIENT), "--no-packet-socket", "--duration", "1", "-n", "127.0.0.1"],
            capture_output=True, text=True, timeout=30, check=True,
        ).stdout  # fmt: skip
    finally:
        server.stop()
    assert re.search(r"vendor name\s*= scancell", told), told
    completed = re.search(r"n_completed_buffers\s*= (\d+)", told)
    assert completed is not None
    assert int(completed[1]) >= 3, told


def test_the_camera_keeps_to_the_protocol_with_bad_commands() -> None:
    """A second client may read and must not write; what is no command is passed over or refused."""
    server = GigeServer(picture, SIZE, 10.0)
    try:
        camera = GenicamCamera(HERE)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.settimeout(5)

            def say(command: bytes) -> int:
                other.sendto(command, ("127.0.0.1", 3956))
                return int.from_bytes(other.recv(600)[:2], "big")

            assert say(bytes.fromhex("420100800004000100000a00")) == 0  # who holds control
            assert say(bytes.fromhex("42010082000800021000001000000000")) == 0x8006  # stop: denied
            assert say(bytes.fromhex("4201008000040003deadbeec")) == 0x8003  # no such register
            assert say(bytes.fromhex("420100990000000400")) == 0x8001  # no such command
            other.sendto(b"\x42\x01", ("127.0.0.1", 3956))
            other.sendto(b"nonsense", ("127.0.0.1", 3956))
            other.sendto(bytes.fromhex("4200004000040005") + b"\xff" * 4, ("127.0.0.1", 3956))
            assert say(bytes.fromhex("420100800004000600000a00")) == 0
        assert next(found for _ in range(10) if (found := camera.read()) is not None)
        camera.close()
    finally:
        server.stop()


def test_usb3_vision_is_read_from_a_camera_in_memory() -> None:
    """The library's own camera by USB3 Vision's registers and stream, without USB: no other could be had."""
    from viva_genicam.testing import FakeU3vCamera

    fake = FakeU3vCamera(640, 480)
    settings = GenicamSettings(transport="usb3")
    with pytest.raises(InputError, match="exposure_us"):
        GenicamCamera(settings.model_copy(update={"exposure_us": 4000.0}), fake.connect())
    camera = GenicamCamera(settings, fake.connect())
    assert fake.acquiring()
    frames = [found for _ in range(3) if (found := camera.read()) is not None]
    assert camera.describe().more == {"Width": "640", "Height": "480", "PixelFormat": "Mono8"}
    camera.close()
    assert not fake.acquiring()
    assert frames
    assert all(decode_image(frame.content, frame.name).shape == (480, 640) for frame in frames)
    with pytest.raises((InputError, ConnectionError), match="camera"):
        GenicamCamera(settings)
