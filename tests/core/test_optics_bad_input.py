"""Bad frames of boards: a clear sentence each, and what no frame can tell is said."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.captures.pitch import suspected_pitch
from calib_core.errors import InputError, MeasurementError, TooLargeError
from calib_core.records import Capture, Session
from calib_core.records.camera_result import CameraResult
from calib_core.simulation import SimulatedSession
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult


@pytest.fixture(scope="module")
def simulated(rendered: Callable[[str, int], SimulatedSession]) -> SimulatedSession:
    return rendered("frames-tcp", 5)


@dataclass(frozen=True, eq=False)
class Spoiled:
    """A session's first board frame as an image, to be replaced by another."""

    simulated: SimulatedSession

    @property
    def capture(self) -> Capture:
        return self.simulated.session.captures[0]

    @property
    def image(self) -> np.ndarray:
        data = np.frombuffer(self.simulated.files[self.capture.files[0]], np.uint8)
        found = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
        assert found is not None
        return np.asarray(found)

    def said(self, image: np.ndarray) -> str:
        """The verdict and what is said about another frame in the first one's place."""
        files = {**self.simulated.files, self.capture.files[0]: encoded(image)}
        measured = measure_capture(self.simulated.session, self.capture, files.__getitem__)
        return f"{measured.verdict}: {measured.reason} {measured.to_do}"


def encoded(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def test_each_bad_frame_has_its_own_sentence(rendered: Callable[[str, int], SimulatedSession]) -> None:
    simulated = rendered("camera", 5)  # whose boards fill the middle of the frame
    frame = Spoiled(simulated)
    image, noise = frame.image, np.random.default_rng(0).normal(120, 20, (480, 640))
    second = cv2.imdecode(np.frombuffer(simulated.files[simulated.session.captures[1].files[0]], np.uint8), 0)
    assert second is not None
    sentences = {
        "no board": noise.clip(0, 255).astype(np.uint8),
        "two boards in one frame": np.hstack([image, second]),
        "a blurred frame": cv2.GaussianBlur(image, (0, 0), 14),
        "Focus the camera": cv2.GaussianBlur(image, (0, 0), 4),
        "is saturated": np.clip(image.astype(int) * 6, 0, 255).astype(np.uint8),
        "white all over": np.full_like(image, 255),
        "a blank frame": np.full_like(image, 90),
        "a black frame": np.zeros_like(image),
        "in colour and was turned into grey": np.dstack([image] * 3),
    }
    for sentence, spoiled in sentences.items():
        assert sentence in frame.said(spoiled), sentence
    assert frame.said(image).startswith("pass")


def test_a_saturated_board_in_a_part_of_the_frame_is_named(
    rendered: Callable[[str, int], SimulatedSession],
) -> None:
    frame = Spoiled(rendered("camera", 5))
    small = cv2.resize(frame.image, (370, 278))  # a third of the frame
    for factor, sentence in ((15, "saturated over"), (1, "pass")):
        around = np.full_like(frame.image, 25)
        around[100:378, 130:500] = np.clip(small.astype(int) * factor, 0, 255)
        assert sentence in frame.said(around), sentence


def test_files_that_are_no_frames_are_refused_before_they_are_unpacked(simulated: SimulatedSession) -> None:
    capture = simulated.session.captures[0]
    whole = simulated.files[capture.files[0]]
    bomb = whole[:16] + (12_000).to_bytes(4, "big") + (10_000).to_bytes(4, "big") + whole[24:]
    for data, error, words in (
        (whole[:20_000], InputError, "breaks off"),
        (bomb, TooLargeError, "120 megapixels"),
        (b"", InputError, "an empty file"),
    ):
        with pytest.raises(error, match=words):
            measure_capture(simulated.session, capture, {**simulated.files, capture.files[0]: data}.__getitem__)


def test_mixed_sizes_are_named(simulated: SimulatedSession) -> None:
    capture = simulated.session.captures[2]
    data = np.frombuffer(simulated.files[capture.files[0]], np.uint8)
    image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    assert image is not None
    files = {**simulated.files, capture.files[0]: encoded(cv2.resize(image, (800, 600)))}
    with pytest.raises(InputError, match="mixed image sizes, 800×600 here"):
        solve_stage(simulated.session, "camera", files.__getitem__)


def with_first_frame(
    simulated: SimulatedSession, step: str, change: Callable[[np.ndarray], np.ndarray]
) -> tuple[dict[str, bytes], str]:
    """The session's files with the first frame of a step changed, and that frame's name."""
    name = next(c for c in simulated.session.captures if c.step == step).files[0]
    image = cv2.imdecode(np.frombuffer(simulated.files[name], np.uint8), cv2.IMREAD_UNCHANGED)
    assert image is not None
    return {**simulated.files, name: encoded(change(np.asarray(image)))}, name


def test_colour_is_told_with_the_camera(simulated: SimulatedSession) -> None:
    files, _ = with_first_frame(simulated, "camera", lambda image: np.dstack([image] * 3))
    camera = solve_stage(simulated.session, "camera", files.__getitem__)
    assert any("in colour" in words and "c01" in words for words in camera.notes)


@pytest.mark.thorough
def test_frames_of_the_sphere_of_another_size_or_white_all_over_are_named(simulated: SimulatedSession) -> None:
    ball = next(c for c in simulated.session.captures if c.step == "tcp")
    files, name = with_first_frame(simulated, "tcp", lambda image: cv2.resize(image, (800, 600)))
    with pytest.raises(InputError, match=f"{name}.*640×480.*800×600"):
        measure_capture(simulated.session, ball, files.__getitem__)
    files, _ = with_first_frame(simulated, "tcp", lambda image: np.full_like(image, 255))
    measured = measure_capture(simulated.session, ball, files.__getitem__)
    assert measured.verdict == "fail"
    assert "white all over" in (measured.reason or "")
    assert "Shorten the exposure" in (measured.to_do or "")


@pytest.mark.thorough
def test_what_a_chessboard_cannot_tell_is_said_and_the_sphere_tells_of_a_wrong_pitch(
    simulated: SimulatedSession,
) -> None:
    record = simulated.session.model_dump(mode="json")
    record["cell"]["board"]["pitch_mm"] = 10.0  # it is 9
    session = Session.model_validate(record)
    camera = solve_stage(session, "camera", simulated.files.__getitem__)
    assert isinstance(camera, CameraResult)
    assert any("pitch, 10 mm, is not checked" in words for words in camera.notes)
    assert any("mirrored" in words for words in camera.notes)
    tcp = solve_stage(session, "tcp", simulated.files.__getitem__)
    assert isinstance(tcp, TcpResult)
    assert tcp.verdict == "fail"
    assert any("the pitch looks like 9.0 mm, you said 10 mm" in words for words in tcp.warnings)


@pytest.mark.thorough
def test_a_pitch_far_off_is_told_where_no_sphere_is_found(simulated: SimulatedSession) -> None:
    record = simulated.session.model_dump(mode="json")
    record["cell"]["board"]["pitch_mm"] = 18.0  # it is 9: every arc is larger than the sphere
    session = Session.model_validate(record)
    with pytest.raises(MeasurementError, match=r"looks like 9\.0 mm, you said 18 mm"):
        solve_stage(session, "tcp", simulated.files.__getitem__)


def test_where_the_captures_do_not_tell_the_pitch_that_is_said(simulated: SimulatedSession) -> None:
    record = simulated.session.model_dump(mode="json")
    record["cell"]["board"]["pitch_mm"] = 10.0
    balls = [c for c in record["captures"] if c["step"] == "tcp"]
    record["captures"] = [c for c in record["captures"] if c["step"] != "tcp"] + balls[:4]  # one orientation
    session = Session.model_validate(record)
    captures = [c for c in session.captures if c.step == "tcp"]
    words = suspected_pitch(session, captures, simulated.files.__getitem__)
    assert words is not None
    assert "cannot be told from these captures" in words.text
