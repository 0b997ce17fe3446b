"""Where the camera stands: a few named views of what the scene holds."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.frames import FloatArray
from calib_core.messages import templates
from server.scenes.cloud_layers import cloud_place
from server.scenes.display_options import Look
from server.scenes.ghost import AXES_MM
from server.scenes.nodes import METRES_PER_MM
from server.scenes.optics import OpticsFacts, plane_patch_mm
from server.scenes.scene_model import SceneFacts
from server.scenes.turntable import TableFacts

VIEWS = templates((
    "Captures", "Cell", "Sphere", "Axes", "Object", "Camera", "Top", "Side", "Along laser", "Answers",
))  # fmt: skip
FIELD_OF_VIEW_RAD = 0.75

_ISOMETRIC = np.array([1.0, -1.2, 0.75])
_SIDE = np.array([0.0, -1.0, 0.08])
_TOP = np.array([0.0, -1e-3, 1.0])
_NEAREST_M = 0.05
_FILLED = 0.85  # of the window, so that labels at the edge have room
_ROUNDS = 8
_BENCH = np.array([1.0, 0.45, 0.5])  # the camera looks along −y: from its side


@dataclass(frozen=True, eq=False)
class View:
    """A camera: where it stands and what it looks at, in metres in the base, and which way is up.

    `places_m` (N, 3) is what it is about; where these are given, a window of any shape is filled by them.
    """

    position_m: FloatArray
    look_at_m: FloatArray
    up: FloatArray
    places_m: FloatArray | None = None

    def seen_in(self, aspect: float) -> "View":
        """Return the same view for a window of another shape, its width over its height."""
        if self.places_m is not None:
            return _fitted(self.places_m, self.position_m - self.look_at_m, self.up, aspect)
        narrow = min(max(aspect, 0.3), 1.0)
        return replace(self, position_m=self.look_at_m + (self.position_m - self.look_at_m) / narrow)


def first_view(facts: SceneFacts) -> str:
    """Return the name of the view in which a scene opens: what was done last of the calibration."""
    if facts.merged is not None:
        return "Axes"
    return "Camera" if facts.optics is not None and not facts.captures else "Captures"


_EMPTY_ROOM_MM = np.array([[-300.0, -300.0, -100.0], [300.0, 300.0, 400.0]])


def view(name: str, facts: SceneFacts, picked: str | None = None) -> View:
    """Return a view by its name.

    "Captures" shows sphere, scanner and flanges, "Cell" the robot's base as well, "Sphere" the sphere from near,
    "Axes" those under the object with what they carry, "Object" the merged cloud from near, "Camera" the camera,
    its boards and plane of light, and "Along laser" looks as the scanner does at the picked or the first capture.
    """
    if name == "Along laser":
        along = _along_laser(facts, picked)
        if along is not None:
            return along
    if name == "Sphere" and facts.sphere_center_in_base_mm is not None:
        return _around(facts.sphere_center_in_base_mm[None], _ISOMETRIC, 1.2 * (facts.sphere_radius_mm or 20.0))
    if name == "Axes" and (table := _table_places_mm(facts)) is not None:
        return _around(table, _ISOMETRIC)
    if name == "Object" and (scanned := _object_places_mm(facts)) is not None:
        return _around(scanned, _ISOMETRIC)
    if name == "Camera" and facts.optics is not None:
        return _around(_bench_places_mm(facts.optics), _BENCH)
    if name == "Answers" and facts.compared:
        from server.scenes.answers import places_mm

        return _around(places_mm(facts), _ISOMETRIC)
    everything = _places_mm(facts)
    if name == "Cell" or not len(everything):
        # Before anything is known the base stands in the middle of the room that a robot works in.
        base = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 250.0]]) if len(everything) else _EMPTY_ROOM_MM
        return _around(np.concatenate([everything, base]), _ISOMETRIC)
    direction = {"Top": _TOP, "Side": _SIDE}.get(name, _ISOMETRIC)
    return _around(everything, direction)


def views_of(facts: SceneFacts) -> list[str]:
    """Return the names of the views that there is something to see in."""
    there = {
        "Sphere": facts.sphere_center_in_base_mm is not None,
        "Axes": facts.table is not None or facts.table_so_far is not None,
        "Object": _object_places_mm(facts) is not None,
        "Camera": facts.optics is not None,
        "Along laser": _along_laser(facts, None) is not None,
        "Answers": bool(facts.compared),
    }
    return [name for name in VIEWS if there.get(name, True)]


def view_of_places(places_mm: FloatArray) -> View:
    """Return a view that holds the axes of flanges at places (N, 3) in the base, mm, and the base itself."""
    return _around(np.concatenate([places_mm, np.zeros((1, 3))]), _ISOMETRIC, AXES_MM)


def _places_mm(facts: SceneFacts) -> FloatArray:
    """Return the places (N, 3) that a view must hold: flanges, also the next one, scanners, sphere."""
    places = [capture.base_from_tool0.translation_mm for capture in facts.captures if facts.knows_base]
    if facts.next_pose is not None:
        # With what is drawn about it: after the first captures it takes up a good part of the window.
        places += list(facts.next_pose.apply(AXES_MM * np.concatenate([np.eye(3), -np.eye(3)])))
    for capture in facts.captures:
        laser = capture.base_from_laser
        if laser is not None:
            places.append(laser.translation_mm)
    if facts.sphere_center_in_base_mm is not None:
        places.append(facts.sphere_center_in_base_mm)
    elif facts.so_far is not None:
        places.append(facts.so_far.center_in_base_mm)
    if facts.table is not None:
        places += [place.center_in_base_mm for place in facts.table.places]
    return np.array(places).reshape(-1, 3)


def _table_places_mm(facts: SceneFacts) -> FloatArray | None:
    """Return the places (N, 3) about the table, or those of the scans where there is none."""
    merged, table, so_far = facts.merged, facts.table, facts.table_so_far
    if table is None and so_far is not None:
        table = TableFacts(so_far.base_from_turntable, so_far.direction, so_far.mounts)
    if table is None:
        if merged is None:
            return None
        corners = np.quantile(merged.points_mm.astype(float), [0.01, 0.99], axis=0)
        return corners if (place := cloud_place(facts, Look(0.0))) is None else place.apply(corners)
    low, high, away = table.reach_mm
    rim = away + (facts.sphere_radius_mm or 0.1 * away)
    around = np.arange(8) * np.pi / 4
    ring = np.column_stack([rim * np.cos(around), rim * np.sin(around), np.zeros(8)])
    rings = [ring + np.array([0.0, 0.0, height]) for height in (low, high)]
    corners = np.concatenate([*rings, [[0.0, 0.0, low - 0.5 * away], [0.0, 0.0, high + 0.8 * away]]])
    if merged is not None and merged.on_table:
        corners = np.concatenate([corners, np.quantile(merged.points_mm, [0.01, 0.99], axis=0)])
    return table.base_from_turntable.apply(corners)


def _object_places_mm(facts: SceneFacts) -> FloatArray | None:
    """Return the corners of the merged cloud's box, strays left aside, None without a cloud or its place."""
    if facts.merged is None:
        return None
    # Scans as they were measured have more strays than a cloud that was cleaned.
    stray = 0.005 if facts.merged.fused else 0.03
    low, high = np.quantile(facts.merged.points_mm.astype(float), [stray, 1.0 - stray], axis=0)
    corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3)
    place = cloud_place(facts, Look(0.0))
    return None if place is None else place.apply(corners)


def _bench_places_mm(optics: OpticsFacts) -> FloatArray:
    places = [np.zeros((1, 3)), np.array([[0.0, 0.0, optics.depth_mm]])]
    places += [optics.corners_in_camera_mm(board) for board in optics.boards]
    if optics.camera_from_laser is not None:
        places.append(optics.camera_from_laser.apply(plane_patch_mm(optics, optics.camera_from_laser.inverse())))
    return optics.base_from_camera.apply(np.concatenate(places))


def _around(places_mm: FloatArray, direction: FloatArray, radius_mm: float = 0.0) -> View:
    """Return the view from a direction that is filled by all places with a ball about each."""
    balls = radius_mm * np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    places_m = (places_mm[:, None, :] + balls).reshape(-1, 3) * METRES_PER_MM
    return _fitted(places_m, direction, np.array([0.0, 0.0, 1.0]), 1.0)


def _fitted(places_m: FloatArray, direction: FloatArray, up: FloatArray, aspect: float) -> View:
    """Return the nearest camera on a direction that has all places (N, 3) in its window, in the middle of it.

    From each place follows how far away the camera must be for it to be seen; the middle is where the outermost
    ones are equally far from both edges.
    """
    onwards = -direction / np.linalg.norm(direction)
    right = np.cross(onwards, up)
    right /= np.linalg.norm(right)
    across = np.stack([right, np.cross(right, onwards)])
    half = np.tan(FIELD_OF_VIEW_RAD / 2) * _FILLED * np.array([max(aspect, 0.2), 1.0])
    look_at = (places_m.min(axis=0) + places_m.max(axis=0)) / 2
    distance = _NEAREST_M
    for _ in range(_ROUNDS):
        offsets = places_m - look_at
        aside, ahead = offsets @ across.T, offsets @ onwards
        distance = max(float((np.abs(aside) / half - ahead[:, None]).max()), _NEAREST_M)
        seen = aside / (distance + ahead)[:, None]
        look_at = look_at + distance * (seen.min(axis=0) + seen.max(axis=0)) / 2 @ across
    return View(look_at - distance * onwards, look_at, up, places_m)


def _along_laser(facts: SceneFacts, picked: str | None) -> View | None:
    """Return the view from a little behind the scanner's origin towards what it saw."""
    order = sorted(facts.captures, key=lambda c: (c.id != picked, c.state != "used"))
    for capture in order:
        laser = capture.base_from_laser
        if laser is None or not len(capture.points_in_laser_mm):
            continue
        target = laser.apply(capture.points_in_laser_mm.mean(axis=0)) * METRES_PER_MM
        back = laser.translation_mm * METRES_PER_MM - target
        # A little out of the plane of light (y): from within it, it would be a line.
        aside = laser.rotate([0.0, 1.0, 0.0]) * 0.35 * float(np.linalg.norm(back))
        return View(target + 1.6 * back + aside, target, laser.rotate([1.0, 0.0, 0.0]))
    return None
