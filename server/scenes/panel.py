"""The controls inside the scene: layers to switch and views to take; every viewer moves only their own camera."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from server.scenes.layers import LAYERS
from server.scenes.views import VIEWS, View

if TYPE_CHECKING:
    from viser import CameraHandle, GuiEvent, ViserServer


class Panel:
    """viser's control panel of one scene.

    Parameters
    ----------
    server : ViserServer
    view : callable
        Gives the camera of a view by its name, at the moment it is asked.
    """

    def __init__(self, server: "ViserServer", view: Callable[[str], View]) -> None:
        gui = server.gui
        gui.set_panel_label("Layers and views")
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="small")
        with gui.add_folder("Views"):
            for title, names in (("Show", VIEWS[:3]), ("From", VIEWS[3:])):
                buttons = gui.add_button_group(title, names)
                buttons.on_click(lambda event: _move(event, view))
        with gui.add_folder("Layers"):
            for root, (title, _) in LAYERS.items():
                node = server.scene.add_frame(f"/{root}", show_axes=False)
                box = gui.add_checkbox(title, initial_value=True)

                def switch(_: object, node: object = node, box: object = box) -> None:
                    node.visible = box.value  # pyright: ignore

                box.on_update(switch)
        self._rejected_folder = gui.add_folder("Rejected captures", visible=False)
        with self._rejected_folder:
            self._rejected = gui.add_html("")
        gui.main_panel.set_width(250)
        gui.main_panel.minimize()

    def say_rejected(self, html: str) -> None:
        """Show the rejected captures and their reasons, or nothing where there are none."""
        if self._rejected.content != html:
            self._rejected.content = html
            self._rejected_folder.visible = bool(html)


def take(camera: "CameraHandle", view: View) -> None:
    """Move one viewer's camera to a view, further away where the window is narrow."""
    narrow = min(max(camera.aspect, 0.3), 1.0)
    camera.up_direction = view.up
    camera.position = view.look_at_m + (view.position_m - view.look_at_m) / narrow
    camera.look_at = view.look_at_m


def _move(event: "GuiEvent", view: Callable[[str], View]) -> None:  # pyright: ignore
    if event.client is not None:
        with event.client.atomic():
            take(event.client.camera, view(event.target.value))
