"""Finer points where a viewer looks from near: which, how many, and that they reach that viewer alone."""

import time
from typing import Any

import msgspec
import numpy as np
import pytest
import zstandard
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from server.scenes.cloud_view import Against, CloudView, Section
from server.scenes.detail import MAX_DETAIL_POINTS, Gaze, detail
from server.scenes.deviation import cloud_deviation
from server.scenes.display_options import look_at
from server.scenes.live import SECRET_HEADER, LiveScene
from server.scenes.merged import MAX_SCAN_POINTS
from server.scenes.scene_model import SceneFacts, scene_facts
from tests.server.test_scene_bridge import PROTOCOL
from tests.server.test_scene_cloud import BALL_MM, RADIUS_MM, fused_scene
from tests.server.test_scene_steps import TABLE

COUNT = 3 * MAX_SCAN_POINTS
TOP_MM, UP = BALL_MM + RADIUS_MM * np.eye(3)[2], np.eye(3)[2]


@pytest.fixture(scope="module")
def dense() -> np.ndarray:
    """A sphere with three times as many points as are drawn at first."""
    rng = np.random.default_rng(6)
    normal = rng.normal(size=(COUNT, 3)).astype(np.float32)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return (BALL_MM + RADIUS_MM * normal).astype(np.float32)


@pytest.fixture(scope="module")
def facts(dense: np.ndarray) -> SceneFacts:
    return scene_facts(fused_scene(dense))


def gaze(away_mm: float) -> Gaze:
    """From above the sphere's top, in the base."""
    return Gaze(TABLE.apply(TOP_MM + away_mm * UP), TABLE.apply(TOP_MM), 0.75)


def in_table_mm(node: Any) -> np.ndarray:
    return (node.arguments["points"].astype(float) + node.arguments["position"]) * 1000


def test_from_near_all_points_in_view_are_there(facts: SceneFacts, dense: np.ndarray) -> None:
    node = detail(facts, look_at(facts), gaze(8.0))
    assert node is not None
    reach = 1.2 * 8.0 * np.tan(0.375)
    inside = np.linalg.norm(dense - TOP_MM, axis=1) < reach
    shown = in_table_mm(node)
    assert len(shown) == pytest.approx(inside.sum(), abs=3)
    assert np.linalg.norm(shown - BALL_MM, axis=1) == pytest.approx(RADIUS_MM, abs=1e-3)


def test_from_afar_there_is_nothing_finer_and_never_too_much(facts: SceneFacts) -> None:
    assert detail(facts, look_at(facts), gaze(200.0)) is None
    between = detail(facts, look_at(facts), gaze(25.0))
    assert between is not None
    assert len(between.arguments["points"]) <= MAX_DETAIL_POINTS


def test_details_keep_to_section_and_colours(facts: SceneFacts) -> None:
    assert facts.merged is not None
    view = CloudView("by deviation", Section("x", 1.0), Against("sphere", 2 * RADIUS_MM))
    deviation = cloud_deviation(facts.merged.points_mm, view.against, None)
    node = detail(facts, look_at(facts, cloud=view, deviation=deviation), gaze(8.0))
    assert node is not None
    assert in_table_mm(node)[:, 0].max() <= 1.0 + 1e-3
    assert len(node.arguments["colors"]) == len(node.arguments["points"])


def test_a_cloud_that_is_drawn_whole_has_no_details(dense: np.ndarray) -> None:
    whole = scene_facts(fused_scene(dense[: MAX_SCAN_POINTS // 2]))
    assert detail(whole, look_at(whole), gaze(8.0)) is None


def names_in(frame: bytes) -> list[str]:
    unpacked, packed = (int.from_bytes(frame[at : at + 8], "little") for at in (0, 8))
    data = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + packed], max_output_size=unpacked)
    return [str(message.get("name")) for message in msgspec.msgpack.decode(data)["messages"]]


def heard(socket: ClientConnection, wanted: str, seconds: float) -> bool:
    """Whether a node's name comes within a time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            frame = socket.recv(timeout=max(end - time.monotonic(), 0.01))
        except TimeoutError:
            return False
        if wanted in names_in(bytes(frame)):  # pyright: ignore[reportArgumentType]
            return True
    return False


def camera(away_mm: float) -> bytes:
    look = gaze(away_mm)
    return msgspec.msgpack.encode(
        {
            "type": "ViewerCameraMessage",
            "wxyz": [1.0, 0.0, 0.0, 0.0],
            "position": (look.position_mm / 1000).tolist(),
            "look_at": (look.look_at_mm / 1000).tolist(),
            "up_direction": [0.0, 0.0, 1.0],
            "fov": 0.75,
            "near": 0.01,
            "far": 100.0,
            "image_height": 700,
            "image_width": 700,
        }
    )


@pytest.mark.thorough
def test_only_the_viewer_that_looks_from_near_gets_them(dense: np.ndarray) -> None:
    live = LiveScene(fused_scene(dense))
    address, headers = f"ws://127.0.0.1:{live.port}", {SECRET_HEADER: live.secret}
    options: dict[str, Any] = {"additional_headers": headers, "proxy": None, "max_size": None}
    try:
        with (
            connect(address, subprotocols=[Subprotocol(PROTOCOL)], **options) as near,
            connect(address, subprotocols=[Subprotocol(PROTOCOL)], **options) as far,
        ):
            far.send(camera(200.0))
            # A newcomer is taken to the first view, whenever that comes; then it goes near.
            assert any(near.send(camera(8.0)) or heard(near, "/scans/merged/near", 2) for _ in range(10))
            assert not heard(far, "/scans/merged/near", 1.0)
            near.send(camera(200.0))
            assert heard(near, "/scans/merged/near", 20)  # taken away again
    finally:
        live.stop()
