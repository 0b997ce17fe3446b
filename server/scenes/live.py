"""One session's live scene: a viser server of its own that is kept like the session, sending only what changed."""

import contextlib
import secrets
import threading
from collections.abc import Generator
from typing import TYPE_CHECKING, NoReturn

from calib_core.frames import FloatArray
from calib_core.records import Capture
from server.scenes.facts import SceneFacts, SceneInput, scene_facts
from server.scenes.layers import draw, look_at
from server.scenes.legend import legend_html, rejected_html
from server.scenes.panel import Panel, take
from server.scenes.views import FIELD_OF_VIEW_RAD, View, view

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

SECRET_HEADER = "x-scancell-scene"
_QUIET = threading.Lock()


class LiveScene:
    """The scene of one session, listening on loopback for the bridge alone.

    Attributes
    ----------
    port : int
        Where viser listens, on 127.0.0.1.
    secret : str
        What a connection must carry in `SECRET_HEADER`: viser itself asks nobody who they are, and a page from
        anywhere may reach a port of this machine through its user's browser.
    legend : str
        The legend as HTML.
    """

    def __init__(self, scene: SceneInput) -> None:
        self.secret = secrets.token_urlsafe(32)
        self.legend = ""
        self._lock = threading.Lock()
        self._fingerprints: dict[str, str] = {}
        self._handles: dict[str, object] = {}
        self._points = PointCache()
        self._facts: SceneFacts | None = None
        self._scene = scene
        self._picked: str | None = None
        self._server = start_viser(self.secret)
        self.port = self._server.get_port()
        self._panel = Panel(self._server, self._view)
        self._server.on_client_connect(self._welcome)
        self.update(scene)

    @property
    def node_names(self) -> frozenset[str]:
        """The names of the nodes that are drawn now."""
        return frozenset(self._fingerprints)

    def update(self, scene: SceneInput) -> int:
        """Draw a newer state of the session; return how many nodes were sent or taken away."""
        with self._lock:
            self._scene = scene
            return self._redraw()

    def highlight(self, capture_id: str | None) -> int:
        """Light up one capture, or none; return how many nodes were sent."""
        with self._lock:
            self._picked = capture_id
            return self._redraw()

    def stop(self) -> None:
        """Close the port, end the thread and forget the scene."""
        stop_viser(self._server)

    def _redraw(self) -> int:
        before = self._facts
        facts = scene_facts(self._points.on(self._scene))
        look = look_at(facts, self._picked)
        nodes = draw(facts, look)
        fingerprints = {name: node.fingerprint() for name, node in nodes.items()}
        changed = [name for name, mark in fingerprints.items() if self._fingerprints.get(name) != mark]
        gone = [name for name in self._fingerprints if name not in nodes]
        with self._server.atomic():
            for name in gone:
                self._handles.pop(name).remove()  # pyright: ignore
            for name in changed:
                self._handles[name] = nodes[name].add_to(self._server.scene)
        self._fingerprints = fingerprints
        self._facts = facts
        self.legend = legend_html(facts, look)
        self._panel.say_rejected(rejected_html(facts))
        if before is None or _stage_of(before) != _stage_of(facts):
            self._show(view("Captures", facts))
        return len(changed) + len(gone)

    def _view(self, name: str) -> View:
        facts = self._facts or scene_facts(self._scene)
        return view(name, facts, self._picked)

    def _welcome(self, client: "ClientHandle") -> None:
        """Set a newcomer further away whose window is narrow; viser's first camera is the same for all."""
        if client.camera.aspect < 1:
            with client.atomic():
                take(client.camera, self._view("Captures"))

    def _show(self, view: View) -> None:
        """Let newcomers start at a view and take those who are there along."""
        first = self._server.initial_camera
        first.fov = FIELD_OF_VIEW_RAD
        first.up, first.position, first.look_at = view.up, view.position_m, view.look_at_m
        for client in self._server.get_clients().values():
            with client.atomic():
                take(client.camera, view)


class PointCache:
    """Keeps every capture's points, since reading and fitting its files again at each change would take long."""

    def __init__(self) -> None:
        self._points: dict[str, tuple[Capture, FloatArray]] = {}

    def on(self, scene: SceneInput) -> SceneInput:
        """Return the same input with its loader remembered; captures that are gone are forgotten."""
        present = {capture.id for capture in scene.session.captures}
        for capture_id in [known for known in self._points if known not in present]:
            del self._points[capture_id]

        def load(capture: Capture) -> FloatArray:
            known = self._points.get(capture.id)
            if known is None or known[0] != capture:
                known = (capture, scene.load_points(capture))
                self._points[capture.id] = known
            return known[1]

        return SceneInput(scene.session, load, scene.measured, scene.results)


def start_viser(secret: str) -> "ViserServer":
    """Return a viser server on a free loopback port that closes on whoever does not know the secret."""
    import viser

    with _without_words():
        server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    # The share tunnel would put the scene on the open net.
    server.request_share_url = _refuse_sharing
    websocket = server._websock_server  # pyright: ignore[reportPrivateUsage]

    async def check_secret(client: object) -> None:
        connection = websocket._live_connections[client.client_id]  # pyright: ignore
        offered = connection.request.headers.get(SECRET_HEADER, "") if connection.request else ""
        if not secrets.compare_digest(offered, secret):
            await connection.close(1008, "This scene is seen through its own page.")

    websocket.on_client_connect(check_secret)
    server.scene.set_up_direction("+z")
    # Shadows say nothing here, and cost half of each frame.
    server.scene.configure_default_lights(cast_shadow=False)
    return server


def stop_viser(server: "ViserServer") -> None:
    """Close a viser server's port and end its thread."""
    with _without_words():
        server.stop()


def _refuse_sharing(*_: object, **__: object) -> NoReturn:
    raise PermissionError("A scene is not shared outside; serve the workbench where it should be seen.")


def _stage_of(facts: SceneFacts) -> tuple[bool, bool]:
    """Return what decides where to look from: is anything there, and is the sphere known."""
    return bool(facts.captures), facts.sphere_center_in_base_mm is not None


@contextlib.contextmanager
def _without_words() -> Generator[None]:
    """Keep viser from printing its address on standard output, where `run --json` promises nothing else."""
    import rich

    console = rich.get_console()
    with _QUIET:
        before, console.quiet = console.quiet, True
        try:
            yield
        finally:
            console.quiet = before
