"""Who looks at a scene: each page's own camera, its picture, and what was clicked in it."""

import secrets
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import NotFoundError
from calib_core.frames import FloatArray
from server.scenes.panel import take
from server.scenes.views import View

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle, SceneClickEvent, ViserServer

VIEWER_HEADER: Final = "x-scancell-viewer"
"""In this header the bridge names the page that a connection belongs to."""

PICKED_KEY: Final = "scancell-picked"
"""Here the scene's client stores what was clicked, `viewer capture nonce`; the page around it hears it."""

SURFACE_KEY: Final = "scancell-surface"
"""Here it stores a point of the merged surface that was clicked, `viewer x y z nonce`, mm in the cloud's frame."""

_CLICKABLE: Final = ("frames", "light", "places")  # layers whose nodes are named by captures
_PICTURE_S: Final = 30.0
_ARRIVES_S: Final = 15.0


class Viewers:
    """The pages that look at one scene.

    Parameters
    ----------
    server : ViserServer
    """

    def __init__(self, server: "ViserServer") -> None:
        self._server = server
        self._takes_points = False
        self._arriving: dict[int, float] = {}  # until when, by monotonic clock

    def keep_at_first(self, client: "ClientHandle", wanted: Callable[[], View]) -> None:
        """Take a newcomer back to its view where viser's first camera, the same for all, undoes it.

        A browser may apply that camera after the one that it was told later, position and direction apart, within
        the seconds in which it draws its first picture.
        """
        now_s = time.monotonic()
        until_s = now_s + _ARRIVES_S
        self._arriving = {one: end_s for one, end_s in self._arriving.items() if end_s > now_s}
        self._arriving[client.client_id] = until_s

        def look(camera: "CameraHandle") -> None:
            if self._arriving.get(client.client_id) != until_s or time.monotonic() > until_s:
                return
            first, seen = self._server.initial_camera, wanted().seen_in(camera.aspect)
            places = (
                (camera.position, first.position, seen.position_m),
                (camera.look_at, first.look_at, seen.look_at_m),
            )
            if any(np.allclose(now, of_all) and not np.allclose(now, own) for now, of_all, own in places):
                with client.atomic():
                    take(camera, wanted())

        client.camera.on_update(look)

    def has_arrived(self, viewer: str) -> None:
        """Leave a page's camera to its user from now on; raises NotFoundError where it does not look."""
        self._arriving.pop(self._client(viewer).client_id, None)

    def move(self, viewer: str, view: View) -> None:
        """Move one page's camera; raises NotFoundError where it does not look."""
        client = self._client(viewer)
        with client.atomic():
            take(client.camera, view)

    def picture(self, viewer: str, width_px: int, height_px: int) -> NDArray[np.uint8]:
        """Return what one page sees, drawn anew in a size of its own: (height, width, 4), RGBA.

        Raises
        ------
        NotFoundError
            If that page does not look, or is gone before it has drawn.
        """
        client = self._client(viewer)
        try:
            return client.get_render(height_px, width_px, transport_format="png", timeout=_PICTURE_S)
        except (RuntimeError, TimeoutError):
            need = "a scene that somebody looks at"
            to_do = "Bring the page with the scene to the front, then ask again."
            raise NotFoundError(need, "one that drew nothing in time", to_do, "viewer") from None

    def make_clickable(self, name: str, handle: Any, instances: tuple[str, ...] = ()) -> None:
        """Let a node that belongs to a capture be picked by a click."""
        layer, capture = [*name.strip("/").split("/"), ""][:2]
        if layer in _CLICKABLE and capture and hasattr(handle, "on_click"):
            handle.on_click(partial(self._clicked, capture, instances))

    def _clicked(self, capture: str, instances: tuple[str, ...], event: Any) -> None:
        if instances:
            if event.instance_index is None or event.instance_index >= len(instances):
                return
            capture = instances[event.instance_index]
        self._tell(event.client, PICKED_KEY, capture)

    def take_points(self, wanted: bool, picked: Callable[[FloatArray, FloatArray], FloatArray | None]) -> None:
        """Let clicks pick points, or no longer: `picked` gives the point that a ray (origin, direction) meets."""
        if wanted == self._takes_points:
            return
        self._takes_points = wanted
        if not wanted:
            self._server.scene.remove_click_callback()
            return

        def clicked(event: "SceneClickEvent") -> None:
            point = picked(np.array(event.ray_origin), np.array(event.ray_direction))
            if point is not None:
                self._tell(event.client, SURFACE_KEY, " ".join(f"{value:.4f}" for value in point.tolist()))

        self._server.scene.on_click()(clicked)

    def _tell(self, client: "ClientHandle", key: str, what: str) -> None:
        """Tell the page around the scene, which hears changes of the storage that both share."""
        viewer = self.name_of(client)
        if viewer:
            client.local_storage.set_item(key, f"{viewer} {what} {secrets.token_hex(4)}")

    def _client(self, viewer: str) -> "ClientHandle":
        for client in self._server.get_clients().values():
            if self.name_of(client) == viewer:
                return client
        need = "a page that looks at this scene"
        raise NotFoundError(need, "'{viewer}', which does not", "Open the scene first.", "viewer", viewer=viewer)

    def name_of(self, client: "ClientHandle") -> str:
        """Return the name that a page gave itself, empty where it has none."""
        connection = self._server._websock_server._live_connections.get(client.client_id)  # pyright: ignore
        request = connection.request if connection is not None else None
        return request.headers.get(VIEWER_HEADER, "") if request is not None else ""
