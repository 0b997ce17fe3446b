"""Layers of the axes: lines and frame, circles, the sphere at each reading, and the table as it stood."""

from collections.abc import Iterable, Iterator

import numpy as np

from calib_core.frames import FloatArray
from server.scenes import nodes
from server.scenes.colors import MOUNTS, REJECTED, WAITING, Rgb
from server.scenes.display_options import Look
from server.scenes.markers import cross
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts
from server.scenes.turntable import AxisLine, SpherePlace, TableFacts

AXIS: Rgb = (60, 110, 220)
_AROUND = np.linspace(0.0, 2.0 * np.pi, 73)


def mount_color(table: TableFacts, mount: str) -> Rgb:
    """Return the colour of one mounting of the sphere."""
    return MOUNTS[table.mount_number(mount) % len(MOUNTS)]


def table_axis(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw the axis as an arrow along T's z, past all mountings, T at zero, and other axes under the object."""
    yield from axis_lines("/table", (one for one in facts.axes if not one.under_robot))
    table = facts.table
    if table is None:
        return
    low, high, away = table.reach_mm
    size = max(away, 60.0)
    place = table.base_from_turntable
    ends = place.apply([[0.0, 0.0, low - 0.5 * size], [0.0, 0.0, high + 0.8 * size]])
    yield nodes.arrow("/table/axis", ends, AXIS, 0.004 * size, 15.0)
    yield nodes.label("/table/axis-name", ends[1], table.title)
    yield nodes.axes("/table/frame", place, 0.6 * size, AXIS, thickness=0.008)
    for axis, name in enumerate("xyz"):
        yield nodes.label(f"/table/{name}", place.apply(np.eye(3)[axis] * 0.66 * size), name, 0.9, "center-center")
    yield nodes.label(
        "/table/name", place.apply([0.0, 0.0, -0.06 * size]), f"T: {table.zero}", anchor="top-center"
    )


def axis_lines(root: str, axes: Iterable[AxisLine]) -> Iterator[Node]:
    """Draw axes as arrows with their names."""
    for axis in axes:
        yield nodes.arrow(
            f"{root}/axis-{axis.name}",
            axis.ends_mm,
            AXIS,
            0.003 * float(np.linalg.norm(np.ptp(axis.ends_mm, axis=0))),
        )
        yield nodes.label(f"{root}/axis-{axis.name}-name", axis.ends_mm[1], axis.name)


def table_circles(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw the circle of every mounting about the axis, and thin and grey those of the paper's method."""
    table = facts.table
    if table is None or table.slides:
        return
    for number, (mount, place) in enumerate((table.mounts or {}).items()):
        ring = ring_mm(float(np.hypot(place[0], place[1])), float(place[2]))
        circle = table.base_from_turntable.apply(ring)
        yield nodes.polyline(f"/circles/{number}", circle, mount_color(table, mount), 2.5)
        if mount:
            yield nodes.label(f"/circles/{number}-name", circle[len(circle) // 8], mount, 0.95)
    for number, circle in enumerate(table.circles):
        normal, center = np.array(circle.normal_in_base), np.array(circle.center_in_base_mm)
        first = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
        first /= np.linalg.norm(first)
        sides = np.array([first, np.cross(normal, first)])
        ring = center + circle.radius_mm * np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1) @ sides
        yield nodes.polyline(f"/circles/paper-{number}", ring, WAITING, 1.0)


def sphere_places(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the sphere where each capture saw it on an axis, named by what was read; rejected ones crossed."""
    table = facts.table
    if table is None:
        return
    radius = facts.sphere_radius_mm or 0.1 * table.reach_mm[2]
    for place in table.places:
        at = place.center_in_base_mm
        color = mount_color(table, place.mount) if place.used else REJECTED
        yield nodes.ball(
            f"/places/{place.capture}/sphere", at, 0.985 * radius, color, 0.12 if look.alone else 0.35
        )
        if not place.used:
            yield nodes.lines(f"/places/{place.capture}/cross", cross(at, 1.5 * radius), REJECTED, 4.0)
        above = at + table.base_from_turntable.rotate([0.0, 0.0, 1.1 * radius])
        yield nodes.label(f"/places/{place.capture}/angle", above, _angle_text(place), 0.85)


def table_turned(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the table's plate, a spoke at its x axis and the mounted sphere, as they stood at the capture shown."""
    table = facts.table
    stood = look.table(facts)
    if table is None or stood is None or table.slides or not look.alone:
        return
    shown = look.shown(facts)
    yield nodes.frame("/turned/table", stood)
    low, _, away = table.reach_mm
    rim = 1.3 * away
    height = low - (facts.sphere_radius_mm or 0.0)
    yield nodes.disc("/turned/table/plate", rim, height, WAITING, 0.3)
    yield nodes.polyline("/turned/table/rim", ring_mm(rim, height), AXIS, 2.0)
    spoke = np.array([[[0.0, 0.0, height], [rim, 0.0, height]]])
    yield nodes.lines("/turned/table/spoke", spoke, AXIS, 4.0)
    mounted = {capture.mount for capture in shown if capture.base_from_turntable is not None}
    held = {name for mount in mounted for name in table.held_by(mount)}
    for number, (mount, place) in enumerate((table.mounts or {}).items()):
        if mount in held and facts.sphere_radius_mm:
            color = mount_color(table, mount)
            yield nodes.ball(f"/turned/table/sphere-{number}", place, 0.94 * facts.sphere_radius_mm, color, 0.9)
            post = np.array([[place, [place[0], place[1], height]]])
            yield nodes.lines(f"/turned/table/post-{number}", post, WAITING, 4.0)
    read = next((one.read for one in shown if one.read), table.zero)
    yield nodes.label("/turned/angle", stood.apply([rim, 0.0, height]), read)


def ring_mm(radius_mm: float, height_mm: float) -> FloatArray:
    """Return a circle (N, 3) about z at a height, its first point again at the end."""
    return np.stack(
        [radius_mm * np.cos(_AROUND), radius_mm * np.sin(_AROUND), np.full(len(_AROUND), height_mm)], axis=1
    )


def _angle_text(place: SpherePlace) -> str:
    return place.read if place.used else f"✕ {place.capture} · {place.read} · {place.reason}"
