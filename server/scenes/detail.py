"""Finer points of the merged cloud where a viewer's camera looks from near: sent to that viewer alone."""

import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from server.scenes import nodes
from server.scenes.cloud_layers import (
    ROOT,
    cloud_place,
    deviation_colors,
    height_range_mm,
    intensity_range,
    point_size_mm,
    scan_colors,
    shown_cloud,
)
from server.scenes.colors import height_colors, intensity_colors
from server.scenes.deviation import CloudDeviation
from server.scenes.display_options import Look
from server.scenes.merged import MergedScans, thinned
from server.scenes.nodes import METRES_PER_MM, Node
from server.scenes.scene_model import SceneFacts

if TYPE_CHECKING:
    from viser import CameraHandle, ClientHandle

MAX_DETAIL_POINTS = 250_000
REST_S = 0.35
"""Details are sent when the camera has not moved for this long."""

_NAME = f"{ROOT}/near"
_WORTH = 1.3  # times as many points as there are already: fewer would not be seen


@dataclass(frozen=True, eq=False)
class Gaze:
    """From where a viewer looks at what: both (3,) in the base, mm, and how wide, in radians."""

    position_mm: FloatArray
    look_at_mm: FloatArray
    field_rad: float


def detail(facts: SceneFacts, look: Look, gaze: Gaze) -> Node | None:
    """Return the finer points in view, at most `MAX_DETAIL_POINTS`; None where all there are is drawn already.

    They lie in a ball about what the camera looks at, as wide as its view is there.
    """
    cloud, place = shown_cloud(facts, look), cloud_place(facts, look)
    if cloud is None or place is None or cloud.every_mm is None or len(cloud.points_mm) == cloud.measured:
        return None
    eye, target = place.inverse().apply(np.array([gaze.position_mm, gaze.look_at_mm]))
    reach = 1.2 * float(np.linalg.norm(target - eye)) * float(np.tan(gaze.field_rad / 2))
    chosen = thinned(_around(cloud.every_mm, target, reach, look), MAX_DETAIL_POINTS)
    there = len(_around(cloud.points_mm, target, reach, look))
    points = cloud.every_mm[chosen]
    if len(points) < _WORTH * max(there, 1):
        return None
    size = point_size_mm(cloud, float(np.sqrt(max(there, 1) / len(points))))
    return nodes.points(_NAME, points, target, _colors(chosen, cloud, look), size)


def _around(
    points_mm: NDArray[np.floating], center_mm: FloatArray, radius_mm: float, look: Look
) -> NDArray[np.int64]:
    """Return which of the points lie in a ball, on the side of the section that is shown."""
    center = center_mm.astype(points_mm.dtype)
    near = np.flatnonzero(np.abs(points_mm[:, 0] - center[0]) <= radius_mm)
    offsets = points_mm[near] - center
    inside = near[np.einsum("ij,ij->i", offsets, offsets) <= radius_mm**2]
    return inside if look.cloud.section is None else inside[look.cloud.section.keeps(points_mm[inside])]


def _colors(chosen: NDArray[np.int64], cloud: MergedScans, look: Look) -> NDArray[np.uint8]:
    assert cloud.every_mm is not None
    points_mm = cloud.every_mm[chosen]
    if look.cloud.colors == "by scan" and cloud.every_scan is not None:
        return scan_colors(cloud.every_scan[chosen])
    if look.cloud.colors == "by intensity" and cloud.every_intensity is not None:
        return intensity_colors(cloud.every_intensity[chosen], *intensity_range(cloud))
    if look.cloud.colors == "by deviation":
        known = look.deviation.of(points_mm) if isinstance(look.deviation, CloudDeviation) else None
        return deviation_colors(known, len(points_mm), look)
    return height_colors(points_mm[:, 2].astype(float), *height_range_mm(cloud))


class Details:
    """The details of every viewer of one scene, brought up to date when a camera has come to rest.

    Parameters
    ----------
    drawn : callable
        Gives the facts and the look that are drawn now.
    """

    def __init__(self, drawn: Callable[[], tuple[SceneFacts, Look]]) -> None:
        self._drawn = drawn
        self._lock = threading.Lock()
        self._timers: dict[int, threading.Timer] = {}
        self._shown: dict[int, tuple[str, Any]] = {}

    def follow(self, client: "ClientHandle") -> None:
        """Follow a newcomer's camera."""
        client.camera.on_update(lambda _camera: self._later(client))

    def refresh(self, clients: "dict[int, ClientHandle]") -> None:
        """Bring the details of all who look up to date, as when the cloud has other colours; forget who left."""
        with self._lock:
            for gone in self._shown.keys() - clients.keys():
                del self._shown[gone]
        for client in clients.values():
            self._later(client)

    def stop(self) -> None:
        """Forget what was still to be done."""
        with self._lock:
            for timer in self._timers.values():
                timer.cancel()
            self._timers.clear()

    def _later(self, client: "ClientHandle") -> None:
        timer = threading.Timer(REST_S, self._send, [client])
        timer.daemon = True
        with self._lock:
            waiting = self._timers.pop(client.client_id, None)
            if waiting is not None:
                waiting.cancel()
            self._timers[client.client_id] = timer
        timer.start()

    def _send(self, client: "ClientHandle") -> None:
        facts, look = self._drawn()
        node = detail(facts, look, gaze_of(client.camera))
        with self._lock:
            self._timers.pop(client.client_id, None)
            before = self._shown.pop(client.client_id, None)
            if node is not None and before is not None and before[0] == node.fingerprint():
                self._shown[client.client_id] = before
                return
            with suppress(RuntimeError):  # the viewer has left meanwhile
                if before is not None:
                    before[1].remove()
                if node is not None:
                    self._shown[client.client_id] = (node.fingerprint(), node.add_to(client.scene))


def gaze_of(camera: "CameraHandle") -> Gaze:
    """Return what a camera sees; a wide window shows more to its sides than above."""
    wide = 2 * np.arctan(np.tan(camera.fov / 2) * max(camera.aspect, 1.0))
    return Gaze(camera.position / METRES_PER_MM, camera.look_at / METRES_PER_MM, float(wide))
