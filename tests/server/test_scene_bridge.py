"""The scenes' door: who may look, what may pass, and that scenes live and die with their viewers."""

import logging
import socket as sockets
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from errno import ECONNREFUSED

import httpx
import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from server.http.same_origin import is_same_origin
from server.scenes.bridge import MAX_MESSAGE_BYTES, refusal
from server.scenes.live import SECRET_HEADER, LiveScene
from server.scenes.manager import SceneManager
from server.scenes.offline import scene_html
from server.scenes.scene_input import SceneAdvice, SceneInput
from server.scenes.viewers import VIEWER_HEADER
from tests.server.scene_cell import make_cell, serve_scenes, wait_until

PROTOCOL = f"viser-v{viser.__version__}"
CELL = make_cell(count=6, points=50)


class Sessions:
    """Stands for the store: sessions by id, and events about them."""

    def __init__(self) -> None:
        self.inputs: dict[str, SceneInput] = {"s1": CELL.scene(count=2, solved=False)}
        self.listeners: dict[str, Callable[[], None]] = {}

    def subscribe(self, session_id: str, listener: Callable[[], None]) -> Callable[[], None]:
        self.listeners[session_id] = listener
        return lambda: self.listeners.pop(session_id) and None

    def change(self, session_id: str, scene: SceneInput | None) -> None:
        if scene is None:
            del self.inputs[session_id]
        else:
            self.inputs[session_id] = scene
        if session_id in self.listeners:
            self.listeners[session_id]()


@pytest.fixture
def sessions() -> Sessions:
    return Sessions()


@pytest.fixture
def manager(sessions: Sessions) -> Iterator[SceneManager]:
    manager = SceneManager(sessions.inputs.get, sessions.subscribe, idle_s=0.3)
    yield manager
    manager.stop()


@pytest.fixture
def client(manager: SceneManager) -> Iterator[httpx.Client]:
    with serve_scenes(manager) as address, httpx.Client(base_url=address, trust_env=False) as client:
        yield client


def look_at(
    client: httpx.Client, session: str, origin: str | None = "own", protocol: str = PROTOCOL
) -> ClientConnection:
    """Open a scene's socket as a page of `origin` would."""
    if origin == "own":
        origin = str(client.base_url).rstrip("/")
    address = f"ws://{client.base_url.netloc.decode()}/scenes/{session}"
    headers = {} if origin is None else {"Origin": origin}
    return connect(
        address, subprotocols=[Subprotocol(protocol)], additional_headers=headers, proxy=None, max_size=None
    )


def read_to_the_end(socket: ClientConnection) -> None:
    while True:
        socket.recv(timeout=300)


def refused_with(status: int, client: httpx.Client, session: str, **asked: str | None) -> None:
    with pytest.raises(InvalidStatus) as refused:
        look_at(client, session, **asked)  # pyright: ignore
    assert refused.value.response.status_code == status


def message(kind: str, **fields: object) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


def test_a_viewer_of_the_own_page_gets_the_scene_and_its_sub_protocol_back(client: httpx.Client) -> None:
    with look_at(client, "s1") as socket:
        assert socket.subprotocol == PROTOCOL
        assert len(socket.recv(timeout=300)) > 100


def test_a_viewer_is_let_in_while_its_scene_is_being_opened(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Viser's client ends what is not accepted within 5 s: a scene that takes longer to open was never seen."""
    asked_to_open, may_open = threading.Event(), threading.Event()

    def slowly(scene: SceneInput) -> LiveScene:
        asked_to_open.set()
        may_open.wait(60)
        return LiveScene(scene)

    monkeypatch.setattr("server.scenes.manager.LiveScene", slowly)
    try:
        with look_at(client, "s1") as socket:
            assert asked_to_open.wait(60)
            with pytest.raises(TimeoutError):
                socket.recv(timeout=0.2)
            may_open.set()
            assert len(socket.recv(timeout=300)) > 100
    finally:
        may_open.set()


def test_what_was_captured_is_drawn_before_the_advice_is_worked_out(
    client: httpx.Client, sessions: Sessions, manager: SceneManager
) -> None:
    asked, may_advise = threading.Event(), threading.Event()
    pose = sessions.inputs["s1"].session.captures[0].pose or []

    def slowly(_: SceneInput) -> SceneAdvice:
        asked.set()
        may_advise.wait(60)
        return SceneAdvice(next_pose=[pose[4 * row : 4 * row + 4] for row in range(4)])

    sessions.inputs["s1"] = replace(sessions.inputs["s1"], advise=slowly)
    try:
        with look_at(client, "s1") as socket:
            assert len(socket.recv(timeout=300)) > 100
            live = manager.live("s1")
            assert live is not None
            assert asked.wait(60)
            assert "frames" in live.drawn_layers
            assert "ghost" not in live.drawn_layers
            may_advise.set()
            wait_until(lambda: "ghost" in live.drawn_layers)
    finally:
        may_advise.set()


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1.evil.example", "null", "", None])
def test_a_page_from_elsewhere_or_from_nowhere_is_refused_and_opens_nothing(
    client: httpx.Client, manager: SceneManager, origin: str | None
) -> None:
    refused_with(403, client, "s1", origin=origin)
    assert "s1" not in manager


def test_an_unknown_session_is_not_found_on_page_and_socket(client: httpx.Client, manager: SceneManager) -> None:
    answer = client.get("/scenes/nobody/")
    assert answer.status_code == 404
    assert "those that are listed" in answer.json()["detail"]
    refused_with(404, client, "nobody")
    assert "nobody" not in manager


def test_a_socket_of_another_kind_is_refused(client: httpx.Client) -> None:
    refused_with(400, client, "s1", protocol="chat")


def test_a_page_of_another_version_is_told_so(client: httpx.Client) -> None:
    with look_at(client, "s1", protocol="viser-v0.0.1") as socket, pytest.raises(ConnectionClosed) as closed:
        read_to_the_end(socket)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1002
    assert "Version mismatch" in closed.value.rcvd.reason


@pytest.mark.parametrize(
    ("sent", "code"),
    [
        (message("ShareUrlRequest"), 1008),
        (message("ShareUrlDisconnect"), 1008),
        (message("FileTransferStartUpload", size_bytes=1), 1008),
        (message("RunJavascriptMessage", source="alert(1)"), 1008),
        (message("GuiUpdateMessage", uuid="x", updates={"content": "<b>"}), 1008),
        (b"\xc1 not msgpack", 1008),
        (b"\x90", 1008),
        (b"\x00" * (MAX_MESSAGE_BYTES + 1), 1009),
    ],
)
def test_what_no_viewer_may_say_ends_the_connection(client: httpx.Client, sent: bytes, code: int) -> None:
    with look_at(client, "s1") as socket:
        socket.send(sent)
        with pytest.raises(ConnectionClosed) as closed:
            read_to_the_end(socket)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == code


def test_cameras_clicks_and_controls_pass() -> None:
    assert refusal(message("ViewerCameraMessage", fov=1.0)) is None
    assert refusal(message("GuiUpdateMessage", uuid="x", updates={"value": True})) is None


def test_even_inside_the_process_nobody_can_share_a_scene() -> None:
    live = LiveScene(CELL.scene(count=1, solved=False))
    try:
        with pytest.raises(PermissionError, match="not shared"):
            live._server.request_share_url()
    finally:
        live.stop()


@pytest.mark.parametrize("secret", [None, "guess"])
def test_around_the_bridge_viser_answers_nobody(secret: str | None) -> None:
    live = LiveScene(CELL.scene(count=1, solved=False))
    headers = {} if secret is None else {"x-scancell-scene": secret}
    address = f"ws://127.0.0.1:{live.port}"
    try:
        with (
            connect(
                address, subprotocols=[Subprotocol(PROTOCOL)], additional_headers=headers, proxy=None
            ) as socket,
            pytest.raises(ConnectionClosed) as closed,
        ):
            read_to_the_end(socket)
        assert closed.value.rcvd is not None
        assert closed.value.rcvd.code == 1008
    finally:
        live.stop()


def test_a_newcomer_whose_browser_applies_the_first_camera_late_is_taken_back_to_its_view(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "server.scenes.viewers._ARRIVES_S", 600.0
    )  # on a busy machine the test itself takes longer
    live = LiveScene(CELL.scene(count=6, solved=True))
    live.tell("page", "sphere", "result")
    headers = {SECRET_HEADER: live.secret, VIEWER_HEADER: "page"}
    address, protocols = f"ws://127.0.0.1:{live.port}", [Subprotocol(PROTOCOL)]

    def position(height_px: int) -> np.ndarray | None:
        """Where the page's camera is for the server, once the page has told of a picture so high."""
        (camera,) = [client.camera for client in live._server.get_clients().values()] or [None]
        return camera.position if camera is not None and camera.image_height == height_px else None

    def is_at(place: object, height_px: int) -> bool:
        found = position(height_px)
        return found is not None and np.allclose(found, place)

    try:
        with connect(address, subprotocols=protocols, additional_headers=headers, proxy=None) as socket:
            first = live._server.initial_camera
            socket.send(camera([3, 3, 3], [0, 0, 0], 500))  # viser's own: the scene's has not been applied yet
            wait_until(lambda: position(500) is not None and not is_at([3, 3, 3], 500))
            wanted = position(500)
            assert not np.allclose(wanted, first.position)
            socket.send(camera(first.position, first.look_at, 501))
            wait_until(lambda: position(501) is not None and not is_at(first.position, 501))
            # Its user who looks from elsewhere is left there, and so is who has chosen a view.
            socket.send(camera([1, 2, 3], [0, 0, 0], 502))
            wait_until(lambda: is_at([1, 2, 3], 502))
            live.move("page", "Captures")
            wait_until(lambda: not is_at([1, 2, 3], 502))  # what is told before counts for the view that was left
            socket.send(camera(first.position, first.look_at, 503))
            socket.send(camera([1, 2, 3], [0, 0, 0], 504))
            wait_until(lambda: is_at([1, 2, 3], 504))
    finally:
        live.stop()


def camera(position: Sequence[float], look_at: Sequence[float], height_px: int) -> bytes:
    """Return what a page's browser tells of its camera."""
    where = {"position": [float(x) for x in position], "look_at": [float(x) for x in look_at]}
    lens = {"fov": 1.0, "near": 0.01, "far": 1000.0, "image_height": height_px, "image_width": 450}
    turned = {"wxyz": [1.0, 0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0]}
    return message("ViewerCameraMessage", **where, **lens, **turned)


def test_scenes_that_ended_leave_nothing_in_the_log_settings() -> None:
    logger = logging.getLogger("websockets.server")
    before = len(logger.filters)
    for _ in range(3):
        live = LiveScene(CELL.scene(count=1, solved=False))
        httpx.get(f"http://127.0.0.1:{live.port}/", trust_env=False)
        assert len(logger.filters) >= 1  # viser's own, which it adds with a server's first request
        live.stop()
    assert len(logger.filters) <= max(before, 1)


def test_viser_says_nothing_on_standard_output(capfd: pytest.CaptureFixture[str]) -> None:
    LiveScene(CELL.scene(count=1, solved=False)).stop()
    scene_html(CELL.scene(count=1, solved=False))
    assert capfd.readouterr().out == ""


def test_the_offline_page_carries_scene_legend_and_title_and_asks_nobody() -> None:
    page = scene_html(CELL.scene(name="cell <4>"))
    assert "<title>cell &lt;4&gt;</title>" in page
    assert "Distance to the sphere" in page
    assert "__VISER_EMBED_DATA__" in page
    assert 'fetch("legend"' not in page


def test_the_scene_follows_captures_results_and_removals(
    client: httpx.Client, manager: SceneManager, sessions: Sessions
) -> None:
    with manager.viewing("s1") as live:
        assert "/frames/p02/flange" in live.node_names
        assert "/frames/p03/flange" not in live.node_names
        sessions.change("s1", CELL.scene(count=6, solved=False))
        wait_until(lambda: "/frames/p06/flange" in live.node_names)
        sessions.change("s1", CELL.scene(count=6))
        wait_until(lambda: {"/sphere/solved", "/points/p06", "/light/p06"} <= live.node_names)
        assert "Distance to the sphere" in client.get("/scenes/s1/legend").text
        sessions.change("s1", CELL.scene(count=4))
        wait_until(lambda: "/frames/p06/flange" not in live.node_names)


def test_only_what_changed_is_sent_and_points_are_read_once() -> None:
    reads: list[str] = []
    scene = CELL.scene(count=5)

    def counting(capture: object) -> object:
        reads.append(capture.id)  # pyright: ignore
        return scene.load_points(capture)  # pyright: ignore

    counted = SceneInput(scene.session, counting, scene.measured, scene.results)  # pyright: ignore
    live = LiveScene(counted)
    try:
        assert live.update(counted) == 0
        assert sorted(reads) == ["p01", "p02", "p03", "p04", "p05"]
        assert 0 < live.highlight("p02") < len(live.node_names)
        assert live.highlight("p02") == 0
    finally:
        live.stop()


def test_a_scene_stays_for_a_while_after_its_last_viewer_and_then_ends(manager: SceneManager) -> None:
    with manager.viewing("s1") as first:
        with manager.viewing("s1") as second:
            assert first is second
        assert "s1" in manager
    with manager.viewing("s1") as again:
        assert again is first
    wait_until(lambda: "s1" not in manager)
    wait_until(lambda: is_closed(first.port))  # it says that it is shutting down meanwhile


def is_closed(port: int) -> bool:
    with sockets.socket() as connection:
        return connection.connect_ex(("127.0.0.1", port)) == ECONNREFUSED


def test_a_removed_session_closes_its_scene_for_its_viewers(
    client: httpx.Client, manager: SceneManager, sessions: Sessions
) -> None:
    with look_at(client, "s1") as socket:
        socket.recv(timeout=300)
        sessions.change("s1", None)
        with pytest.raises(ConnectionClosed) as closed:
            read_to_the_end(socket)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1001
    wait_until(lambda: "s1" not in manager)


def test_a_picked_capture_lights_up(client: httpx.Client, manager: SceneManager) -> None:
    with manager.viewing("s1") as live:
        assert client.post("/scenes/s1/highlight", json={"capture": "p02"}).status_code == 204
        wait_until(lambda: live._picked == "p02")


def test_the_page_may_only_talk_to_its_own_server(client: httpx.Client) -> None:
    page = client.get("/scenes/s1/?theme=dark")
    policy = page.headers["content-security-policy"]
    assert "connect-src 'self' blob: data:" in policy
    assert "http" not in policy
    assert "'unsafe-inline'" not in policy.split("script-src")[1].split(";")[0]
    assert "<title>Scene</title>" in page.text
    redirect = client.get("/scenes/s1?theme=dark", follow_redirects=False)
    assert redirect.headers["location"] == "/scenes/s1/?theme=dark"


def test_the_page_is_sent_once_to_a_browser_that_keeps_it(client: httpx.Client) -> None:
    first = client.get("/scenes/s1/")
    again = client.get("/scenes/s1/", headers={"if-none-match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    assert again.headers["content-security-policy"] == first.headers["content-security-policy"]
    assert client.get("/scenes/s1/", headers={"if-none-match": '"another"'}).content == first.content


def test_the_legend_is_sent_again_only_when_it_changed(client: httpx.Client, manager: SceneManager) -> None:
    with manager.viewing("s1"):
        first = client.get("/scenes/s1/legend")
        again = client.get("/scenes/s1/legend", headers={"if-none-match": first.headers["etag"]})
    assert "first result" in first.text
    assert again.status_code == 304


@pytest.mark.parametrize(
    ("origin", "host", "same"),
    [
        ("http://cell:8000", "cell:8000", True),
        ("https://cell", "cell:443", True),
        ("http://cell:8001", "cell:8000", False),
        ("file://cell", "cell", False),
        (None, "cell", False),
        ("http://cell", None, False),
    ],
)
def test_same_origin(origin: str | None, host: str | None, same: bool) -> None:
    assert is_same_origin(origin, host) is same
