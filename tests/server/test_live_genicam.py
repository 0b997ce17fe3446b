"""GigE Vision against Aravis's fake camera, a program of its own."""

import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from calib_core.errors import InputError
from calib_core.formats.shared.images import decode_image
from server.live.link import Link
from server.sources.device import Frame, Reading
from server.sources.genicam import GenicamCamera, GenicamSettings
from server.sources.registry import SOURCES
from tests.server.live_rig import until

FAKE = shutil.which("arv-fake-gv-camera-0.8")
pytestmark = pytest.mark.skipif(FAKE is None, reason="Debian's aravis-tools brings the fake camera")
pytest.importorskip("viva_genicam")


@contextmanager
def fake_camera() -> Iterator[None]:
    process = subprocess.Popen([str(FAKE), "-i", "127.0.0.1"])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def test_frames_come_by_gige_vision_also_after_the_camera_was_away() -> None:
    source = SOURCES.get("genicam")
    came: list[Reading] = []
    link = Link("camera", source, source.settings(), lambda _, reading: came.append(reading), lambda _: None)
    with fake_camera():
        link.start()
        until(lambda: len(came) >= 3, link.state)
        about = link.state().description
        assert about is not None
        assert about.model == "Aravis Fake"
        assert about.more == {"Width": "512", "Height": "512", "PixelFormat": "Mono8"}
    until(lambda: link.state().status == "lost", link.state)
    before = len(came)
    with fake_camera():
        until(lambda: len(came) > before, link.state)
        link.stop()
    frames = [reading for reading in came if isinstance(reading, Frame)]
    assert all(decode_image(frame.content, frame.name).shape == (512, 512) for frame in frames)
    assert len({frame.content for frame in frames[:3]}) == 3


def test_a_camera_that_is_not_there_is_said() -> None:
    with pytest.raises(InputError, match=r"192\.0\.2\.1"):
        GenicamCamera(GenicamSettings(address="192.0.2.1", interface="127.0.0.1"))
