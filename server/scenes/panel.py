"""The controls inside the scene: layers to switch and views to take; every viewer moves only their own camera."""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from server.scenes.cloud_view import CLOUD_COLORS, CloudColors
from server.scenes.layers import LAYERS
from server.scenes.views import VIEWS, View

if TYPE_CHECKING:
    from viser import CameraHandle, GuiEvent, GuiInputHandle, ViserServer


STEP_S = 0.9


class Player:
    """Calls `step` at even times while it plays.

    Parameters
    ----------
    step : callable
        Goes on to the next capture.
    step_s : float
    """

    def __init__(self, step: Callable[[], None], step_s: float = STEP_S) -> None:
        self._step = step
        self._step_s = step_s
        self._lock = threading.Lock()
        self._end: threading.Event | None = None
        self._thread: threading.Thread | None = None

    @property
    def playing(self) -> bool:
        """Whether it plays now."""
        return self._end is not None

    def play(self, on: bool) -> None:
        """Start or end playing; what it is already stays."""
        with self._lock:
            if on == self.playing:
                return
            if self._end is not None:
                self._end.set()
                self._end = None
                return
            self._end = threading.Event()
            self._thread = threading.Thread(target=self._run, args=(self._end,), name="scene-player", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End playing, and wait for the step that is on its way."""
        self.play(False)
        if self._thread is not None:
            self._thread.join(10)

    def _run(self, end: threading.Event) -> None:
        while not end.wait(self._step_s):
            self._step()


@dataclass(frozen=True)
class PanelActions:
    """What the panel's controls do.

    `view` gives the camera of a view by its name, at the moment it is asked; `turn_to` shows one capture by its
    place counted from 1, or all at 0; `color_scans` colours the scans.
    """

    view: Callable[[str], View]
    turn_to: Callable[[int], object]
    color_scans: Callable[[CloudColors], object]


class Panel:
    """viser's control panel of one scene.

    Parameters
    ----------
    server : ViserServer
    actions : PanelActions
    """

    def __init__(self, server: "ViserServer", actions: PanelActions) -> None:
        gui = server.gui
        gui.set_panel_label("Layers and views")
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="small")
        with gui.add_folder("Views"):
            for title, names in (("Show", VIEWS[:3]), ("Step", VIEWS[3:6]), ("From", VIEWS[6:])):
                buttons = gui.add_button_group(title, names)
                buttons.on_click(lambda event: _move(event, actions.view))
        self._add_turning(server, actions)
        self._layers: dict[str, GuiInputHandle[bool]] = {}
        with gui.add_folder("Layers"):
            for root, (title, _) in LAYERS.items():
                node = server.scene.add_frame(f"/{root}", show_axes=False)
                box = gui.add_checkbox(title, initial_value=True)

                def switch(_: object, node: object = node, box: object = box) -> None:
                    node.visible = box.value  # pyright: ignore

                box.on_update(switch)
                self._layers[root] = box
        self._colors = gui.add_dropdown("Merged cloud", CLOUD_COLORS, visible=False)

        def color_scans(_: object) -> None:
            actions.color_scans(self._colors.value)

        self._colors.on_update(color_scans)
        self._rejected_folder = gui.add_folder("Rejected captures", visible=False)
        with self._rejected_folder:
            self._rejected = gui.add_html("")
        gui.main_panel.set_width(250)
        gui.main_panel.minimize()

    def _add_turning(self, server: "ViserServer", actions: PanelActions) -> None:
        self._turning = server.gui.add_folder("Turn through the captures", visible=False)
        with self._turning:
            hint = "The cell as it stood at one capture; 0 shows all of them."
            self._place = server.gui.add_slider("Capture", 0, 1, 1, 0, hint=hint)
            play = server.gui.add_checkbox("Play", initial_value=False)
        self._player = Player(self._next_capture)

        def turn(_: object) -> None:
            actions.turn_to(int(self._place.value))

        self._place.on_update(turn)
        play.on_update(lambda _: self._player.play(play.value))

    @property
    def layers(self) -> dict[str, bool]:
        """Which layers are shown, by the name of their root."""
        return {root: bool(box.value) for root, box in self._layers.items()}

    def show_layer(self, root: str, shown: bool) -> None:
        """Show or hide a layer for everybody who looks."""
        self._layers[root].value = shown

    def turn_to(self, place: int) -> None:
        """Set the slider, which turns the cell to a capture counted from 1, or shows all at 0."""
        self._place.value = min(max(place, 0), int(self._place.max))

    def _next_capture(self) -> None:
        self._place.value = int(self._place.value) % int(self._place.max) + 1

    def show_captures(self, count: int, with_scans: bool) -> None:
        """Let the slider reach so many captures; without any, or without scans, their controls are not shown."""
        if int(self._place.max) != max(count, 1):
            self._place.max = max(count, 1)
        if self._turning.visible != (count > 0):
            self._turning.visible = count > 0
        if self._colors.visible != with_scans:
            self._colors.visible = with_scans

    def stop(self) -> None:
        """End the animation."""
        self._player.stop()

    def say_rejected(self, html: str) -> None:
        """Show the rejected captures and their reasons, or nothing where there are none."""
        if self._rejected.content != html:
            self._rejected.content = html
            self._rejected_folder.visible = bool(html)


def take(camera: "CameraHandle", view: View) -> None:
    """Move one viewer's camera to a view, as it fills their window."""
    seen = view.seen_in(camera.aspect)
    camera.up_direction = seen.up
    camera.position = seen.position_m
    camera.look_at = seen.look_at_m


def _move(event: "GuiEvent", view: Callable[[str], View]) -> None:  # pyright: ignore
    if event.client is not None:
        with event.client.atomic():
            take(event.client.camera, view(event.target.value))
