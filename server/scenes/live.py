"""One session's live scene: a viser server of its own that is kept like the session, sending only what changed."""

import contextlib
import logging
import secrets
import threading
from collections.abc import Generator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from calib_core.errors import NotFoundError
from calib_core.frames import FloatArray, RigidTransform
from server.scenes.advice import no_advice
from server.scenes.cache import PointCache
from server.scenes.cloud_view import CloudColors, CloudView
from server.scenes.detail import Details
from server.scenes.deviation import KeptDeviations
from server.scenes.display_options import Look, RobotNow, look_at
from server.scenes.layers import draw
from server.scenes.legend import legend_html, rejected_html
from server.scenes.nodes import Node
from server.scenes.panel import Panel, PanelActions, take
from server.scenes.robot_now import robot_now
from server.scenes.scene_input import SceneInput
from server.scenes.scene_model import SceneFacts, scene_facts
from server.scenes.step_views import Side, Story, story
from server.scenes.surface_pick import picked_on_cloud
from server.scenes.viewers import Viewers
from server.scenes.views import FIELD_OF_VIEW_RAD, View, first_view, view, view_of_places, views_of

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

SECRET_HEADER = "x-scancell-scene"
_QUIET = threading.Lock()
_MOST_STORIES = 200  # of pages that may come back


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
    viewers : Viewers
        The pages that look.
    """

    def __init__(self, scene: SceneInput) -> None:
        self.secret = secrets.token_urlsafe(32)
        self.legend = ""
        self._lock = threading.Lock()
        self._drawn: dict[str, tuple[str, dict[str, tuple[float, ...]]]] = {}
        self._handles: dict[str, Any] = {}
        self._points = PointCache()
        self._facts: SceneFacts | None = None
        self._scene = scene
        self._picked: str | None = None
        self._turned_to = 0
        self._stories: dict[str, tuple[str, Side]] = {}
        self._trial: tuple[RigidTransform, ...] = ()
        self._robot: RobotNow | None = None
        self._cloud = CloudView()
        self._deviations = KeptDeviations()
        self._server = start_viser(self.secret)
        self.port = self._server.get_port()
        self.viewers = Viewers(self._server)
        self._panel = Panel(self._server, PanelActions(self._view, self.turn_to, self.color_scans))
        self._details = Details(self._drawn_now)
        self._server.on_client_connect(self._welcome)
        self.update(scene)

    @property
    def node_names(self) -> frozenset[str]:
        """The names of the nodes that are drawn now."""
        return frozenset(self._drawn)

    def update(self, scene: SceneInput) -> int:
        """Draw a newer state of the session; return how many nodes were sent or taken away."""
        with self._lock:
            waited, self._scene = self._scene.advise is no_advice, self._points.on(scene)
            before, self._facts = self._facts, scene_facts(self._scene)
            sent = self._redraw()
            if before is None or waited or stage_of(before) != stage_of(self._facts):
                self._show(view(first_view(self._facts), self._facts))
            return sent

    def highlight(self, capture_id: str | None) -> int:
        """Light up one capture, or none; return how many nodes were sent."""
        with self._lock:
            self._picked = capture_id
            return self._redraw()

    def try_poses(self, poses: tuple[RigidTransform, ...]) -> int:
        """Show poses that are being read, beside everything else; return how many nodes were sent.

        Where the session has no captures yet, everybody is taken to where these poses are in sight.
        """
        with self._lock:
            places = np.array([pose.translation_mm for pose in poses])
            moved = not np.array_equal(places, np.array([pose.translation_mm for pose in self._trial]))
            self._trial = poses
            if poses and moved and not self._known.captures:
                self._take_all(view_of_places(places))
            return self._redraw()

    def follow(self, robot: RobotNow | None) -> int:
        """Show where the robot stands now, None where none is connected; return how many nodes were sent."""
        with self._lock:
            if robot is None and self._robot is None:
                return 0
            self._robot = robot
            facts = self._known
            return self._send({node.name: node for node in robot_now(facts, self._look(facts))}, "/live/")

    def turn_to(self, place: int) -> int:
        """Show the cell as it stood at a capture, counted from 1, or all at 0; return how many nodes were sent."""
        with self._lock:
            self._turned_to = place
            return self._redraw()

    def turn_to_capture(self, capture_id: str | None) -> None:
        """Show the cell as it stood at a capture, or all of them; the slider in the scene goes along."""
        with self._lock:
            ids = [capture.id for capture in self._known.captures]
        self._panel.turn_to(ids.index(capture_id) + 1 if capture_id in ids else 0)

    def tell(self, viewer: str, shows: str, side: Side) -> Story:
        """Tell one page the story of a step: move its camera, keep its legend; return what it shows.

        Until that page looks, and after it comes back, the story waits for it.
        """
        with self._lock:
            self._stories[viewer] = (shows, side)
            while len(self._stories) > _MOST_STORIES:
                self._stories.pop(next(iter(self._stories)))
        told = story(shows, side, self._known)
        with contextlib.suppress(NotFoundError):
            self.viewers.move(viewer, self._view(told.view))
        return told

    def legend_of(self, viewer: str) -> str:
        """Return the legend of what one page's story shows; the whole one where it has none."""
        with self._lock:
            told = self._stories.get(viewer)
            if told is None:
                return self.legend
            facts = self._known
            return legend_html(facts, self._look(facts), story(*told, facts).layers)

    def move(self, viewer: str, name: str) -> None:
        """Move one page's camera to a view; raises NotFoundError where that page does not look."""
        self.viewers.has_arrived(viewer)
        self.viewers.move(viewer, self._view(name))

    @property
    def views(self) -> list[str]:
        """The views that there is something to see in now."""
        with self._lock:
            return views_of(self._known)

    @property
    def drawn_layers(self) -> set[str]:
        """The layers of which something is drawn now."""
        return {name.split("/")[1] for name in self.node_names}

    @property
    def layers(self) -> dict[str, bool]:
        """Which layers are shown, by the name of their root."""
        return self._panel.layers

    def show_layer(self, root: str, shown: bool) -> None:
        """Show or hide a layer for everybody who looks."""
        self._panel.show_layer(root, shown)

    @property
    def cloud(self) -> CloudView:
        """How the merged cloud is shown."""
        return self._cloud

    def color_scans(self, how: CloudColors) -> int:
        """Colour the merged cloud by height, scan or deviation; return how many nodes were sent."""
        return self.show_cloud(replace(self._cloud, colors=how))

    def show_cloud(self, how: CloudView) -> int:
        """Show the merged cloud in other colours, cut open, or against another reference; return as above."""
        with self._lock:
            self._cloud = how
            return self._redraw()

    def stop(self) -> None:
        """Close the port, end the threads and forget the scene."""
        self._details.stop()
        self._panel.stop()
        stop_viser(self._server)

    def _redraw(self) -> int:
        facts = self._known
        look = self._look(facts)
        sent = self._send(draw(facts, look))
        self.legend = legend_html(facts, look)
        self._panel.say_rejected(rejected_html(facts))
        colored = facts.merged is not None and not facts.merged.waiting
        self._panel.show_captures(len(facts.captures), colored)
        self.viewers.take_points(colored, self._picked_on_cloud)
        self._details.refresh(self._server.get_clients())
        return sent

    def _picked_on_cloud(self, origin_m: FloatArray, direction: FloatArray) -> FloatArray | None:
        return picked_on_cloud(*self._drawn_now(), origin_m, direction)

    def _drawn_now(self) -> tuple[SceneFacts, Look]:
        with self._lock:
            return self._known, self._look(self._known)

    @property
    def _known(self) -> SceneFacts:
        if self._facts is None:
            self._facts = scene_facts(self._scene)
        return self._facts

    def _look(self, facts: SceneFacts) -> Look:
        place = min(self._turned_to, len(facts.captures))
        picked = facts.captures[place - 1].id if place else self._picked
        deviation = None
        if self._cloud.colors == "by deviation" and facts.merged is not None:
            against = self._cloud.against
            reference = self._scene.load_reference() if against.kind == "mesh" else None
            deviation = self._deviations.of(facts.merged.points_mm, against, reference)
        look = look_at(facts, picked, alone=place > 0, cloud=self._cloud, deviation=deviation)
        return replace(look, trial=self._trial, robot=self._robot)

    def _send(self, nodes: Mapping[str, Node], root: str = "/") -> int:
        """Send what differs from what is drawn below a root; a node that only moved is moved, not sent again."""
        now = {name: (node.looks(), node.place()) for name, node in nodes.items()}
        others = {name: mark for name, mark in self._drawn.items() if not name.startswith(root)}
        gone = [name for name in reversed(self._drawn) if name not in now and name not in others]
        changed = [name for name, mark in now.items() if self._drawn.get(name) != mark]
        with self._server.atomic():
            for name in gone:
                self._handles.pop(name).remove()
            for name in changed:
                looks, place = now[name]
                if self._drawn.get(name, ("",))[0] == looks:
                    for key, value in place.items():
                        setattr(self._handles[name], key, value)
                else:
                    self._handles[name] = nodes[name].add_to(self._server.scene)
                    self.viewers.make_clickable(name, self._handles[name], nodes[name].instances)
        self._drawn = {**others, **now}
        return len(changed) + len(gone)

    def _view(self, name: str) -> View:
        return view(name, self._known, self._picked)

    def _welcome(self, client: "ClientHandle") -> None:
        """Set a newcomer further away whose window is narrow; viser's first camera is the same for all."""
        self._details.follow(client)
        # Before it has its own view, which may be undone at once.
        self.viewers.keep_at_first(client, lambda: self._first_view_of(client))
        name = self.viewers.name_of(client)
        while True:
            told = self._stories.get(name)
            with client.atomic():
                take(client.camera, self._first_view_of(client))
            if self._stories.get(name) == told:  # else a story was told meanwhile, whose view this one undid
                break

    def _show(self, view: View) -> None:
        """Let newcomers start at a view and take those who are there along."""
        start_at(self._server, view)
        for client in self._server.get_clients().values():
            with client.atomic():
                take(client.camera, self._first_view_of(client, view))

    def _take_all(self, view: View) -> None:
        """Take everybody who is there to a view, whatever their page's story is."""
        for client in self._server.get_clients().values():
            with client.atomic():
                take(client.camera, view)

    def _first_view_of(self, client: "ClientHandle", otherwise: View | None = None) -> View:
        """Return where a page's own story looks from, else the scene's."""
        told = self._stories.get(self.viewers.name_of(client))
        if told is not None:
            return self._view(story(*told, self._known).view)
        return otherwise or self._view(first_view(self._known))


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
    # Shadows say nothing here, and cost half of each frame.  Preparing light that comes from a surrounding picture
    # takes longer in software than all the rest of the first frame; light from everywhere looks nearly the same.
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.configure_environment_map(None)
    server.scene.add_light_ambient("/ambient-light", intensity=1.2)
    return server


def start_at(server: "ViserServer", view: View) -> None:
    """Let newcomers start at a view."""
    first = server.initial_camera
    first.fov = FIELD_OF_VIEW_RAD
    first.up, first.position, first.look_at = view.up, view.position_m, view.look_at_m


def stop_viser(server: "ViserServer") -> None:
    """Close a viser server's port and end its thread."""
    with _without_words():
        server.stop()
    _forget_log_filters()


def _forget_log_filters() -> None:
    """Leave one of the filters that each viser server adds to one logger and never takes away; all are alike."""
    logger = logging.getLogger("websockets.server")
    added = [one for one in logger.filters if type(one).__module__ == "viser.infra._infra"]
    for one in added[:-1]:
        logger.removeFilter(one)


def _refuse_sharing(*_: object, **__: object) -> NoReturn:
    raise PermissionError("A scene is not shared outside; serve the workbench where it should be seen.")


def stage_of(facts: SceneFacts) -> tuple[bool, ...]:
    """Return what decides where to look from: which of the captures, sphere, table, camera and scans are there."""
    known = (facts.sphere_center_in_base_mm, facts.table, facts.optics, facts.merged)
    return bool(facts.captures), *[part is not None for part in known]


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
