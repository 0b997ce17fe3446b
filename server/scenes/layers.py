"""The layers of a scene, each a function from facts to nodes; a new layer is a new entry in `LAYERS`."""

from collections.abc import Callable, Iterator

import numpy as np

from calib_core.frames import RigidTransform
from calib_core.messages import message
from server.scenes import nodes
from server.scenes.answers import answers
from server.scenes.arm import arm
from server.scenes.cloud_layers import merged_layer
from server.scenes.colors import (
    LIGHT,
    REJECTED,
    SPHERE,
    STATE_COLOR,
    WAITING,
    Rgb,
    diverging_colors,
    faint,
    faint_colors,
)
from server.scenes.display_options import Look
from server.scenes.field_layer import field
from server.scenes.ghost import ghost
from server.scenes.interim_layers import so_far, table_so_far
from server.scenes.light_sheet import body_of_scanner, fan_of_profile
from server.scenes.many_captures import MANY, frames_of_all, light_of_all, named, points_of_all
from server.scenes.markers import cross
from server.scenes.nodes import Node
from server.scenes.optics_layers import boards, camera, plane_in_camera
from server.scenes.pose_preview import trial
from server.scenes.robot_now import robot_now
from server.scenes.scene_model import CaptureFacts, SceneFacts
from server.scenes.turntable_layers import axis_lines, sphere_places, table_axis, table_circles, table_turned
from server.scenes.uncertainty import uncertainty

_MANY = 20
_ROUND = 20  # over a hundred corners around


def one_by_one(facts: SceneFacts, look: Look) -> tuple[CaptureFacts, ...]:
    """Return the captures with nodes of their own: all of a few, of many the one that is picked."""
    shown = look.shown(facts)
    return shown if len(shown) <= MANY else tuple(c for c in shown if c.id == look.picked)


def base_frame(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw the robot's base with named axes, the axes that carry the robot, and a floor of 100 mm squares."""
    yield from axis_lines("/base", (one for one in facts.axes if one.under_robot))
    length = 200.0
    identity = RigidTransform.identity("base", "base")
    yield nodes.axes("/base/axes", identity, length, WAITING, thickness=0.012)
    for axis, name in enumerate("xyz"):
        yield nodes.label(f"/base/{name}", np.eye(3)[axis] * length * 1.08, name, anchor="center-center")
    yield nodes.label("/base/name", [0.0, 0.0, -0.12 * length], message("base"), anchor="top-center")
    yield Node(
        "/base/floor",
        "add_grid",
        {
            "width": 4.0,
            "height": 4.0,
            "cell_size": 0.1,
            "section_size": 1.0,
            "cell_color": (128, 128, 128),
            "section_color": (128, 128, 128),
            "cell_thickness": 0.4,
            "section_thickness": 0.9,
            "fade_distance": 6.0,
            "shadow_opacity": 0.0,
        },
    )


def frames(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw flange and scanner at every capture and what joins them; rejected ones are crossed out.

    The picked one is large and bright, the rest then faint.
    """
    drawn: set[str] = set()
    for capture in sorted(one_by_one(facts, look), key=lambda one: one.id != look.picked):
        behind = look.picked not in (None, capture.id)
        color = faint(STATE_COLOR[capture.state]) if behind else STATE_COLOR[capture.state]
        grow = 1.6 if capture.id == look.picked else 0.75 if behind else 1.0
        flange = capture.base_from_tool0
        if facts.knows_base:
            yield nodes.axes(f"/frames/{capture.id}/flange", flange, 36.0 * grow, color)
        laser = capture.base_from_laser
        if laser is not None and not (capture.stands_still and capture.scanner in drawn):
            drawn.add(capture.scanner)
            yield nodes.axes(f"/frames/{capture.id}/laser", laser, 24.0 * grow, color)
            yield from _scanner(capture, laser, color, 0.2 if behind else 0.9 if grow > 1 else 0.5)
            joint = np.array([[flange.translation_mm, laser.translation_mm]])
            if not capture.stands_still:
                yield nodes.lines(f"/frames/{capture.id}/tool", joint, color, 3.0 if grow > 1 else 1.2)
        if capture.state == "rejected" and facts.knows_base:
            picked = capture.id == look.picked
            sign = cross(flange.translation_mm, 26.0 if picked else 14.0)
            yield nodes.lines(f"/frames/{capture.id}/cross", sign, REJECTED, 4.0 if picked else 2.0)
    if len(look.shown(facts)) > MANY and facts.knows_base:
        yield from frames_of_all(look.shown(facts))


def _scanner(capture: CaptureFacts, laser: RigidTransform, color: Rgb, opacity: float) -> Iterator[Node]:
    """Draw a small scanner where the light comes from, as far as the capture tells."""
    points = capture.points_in_laser_mm
    body = body_of_scanner(points) if capture.kind == "profile" and len(points) >= 2 else None
    if body is not None:
        yield nodes.surface(f"/frames/{capture.id}/scanner", laser, *body, color, opacity)


def light(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the plane of light of every profile, up to the sphere, which stops it."""
    if len(look.shown(facts)) > MANY:
        yield from light_of_all(look.shown(facts))
    for capture in one_by_one(facts, look):
        laser = capture.base_from_laser
        if laser is None or capture.kind != "profile" or len(capture.points_in_laser_mm) < 2:
            continue
        opacity = 0.45 if capture.id == look.picked else 0.06 if look.picked else 0.13
        color = REJECTED if capture.state == "rejected" else LIGHT
        corners, faces = fan_of_profile(capture.points_in_laser_mm)
        yield nodes.surface(f"/light/{capture.id}", laser, corners, faces, color, opacity)


def residual_points(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the points that lie on the sphere: used ones by residual, rejected and unplaced ones in one colour."""
    size = 1.0 if facts.sphere_radius_mm is None else min(max(facts.sphere_radius_mm / 50, 0.3), 1.5)
    many = len(facts.captures) > MANY
    if many:
        yield from points_of_all(facts, look, facts.captures, size)
    for capture in [c for c in facts.captures if not many or c.id == look.picked]:
        cloud = facts.points_in_base_mm(capture)
        if not len(cloud):
            continue
        residuals = facts.residuals_mm(capture)
        if residuals is None or capture.state == "rejected":
            one = REJECTED if capture.state == "rejected" else WAITING
            colors = np.tile(np.array(one, dtype=np.uint8), (len(cloud), 1))
        else:
            colors = diverging_colors(residuals, look.limit_mm)
        if look.picked not in (None, capture.id):
            colors = faint_colors(colors)
        center = capture.sphere_center_in_base_mm
        origin = cloud.mean(axis=0) if center is None else center
        grow = 1.8 if capture.id == look.picked else 1.0
        yield nodes.points(f"/points/{capture.id}", cloud, origin, colors, size * grow)


def sphere(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw solved spheres, slightly inside their surface so that the points on them stay visible.

    Those on the flange are drawn where the picked capture has them, else the last one.
    """
    shown = look.shown(facts)
    here = next((c for c in shown if c.id == look.picked), shown[-1] if shown else None)
    for number, ball in enumerate(facts.balls):
        radius_mm = ball.radius_mm or facts.sphere_radius_mm
        if radius_mm is None or here is None:
            return
        name = f"/sphere/{number}" if number else "/sphere/solved"
        at = ball.in_base_mm(here.base_from_tool0)
        yield nodes.ball(name, at, 0.985 * radius_mm, SPHERE, 0.45, _ROUND)


def labels(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Name every capture, and say why a rejected one is; the page shortens the reason."""
    crowded = 0.75 if len(facts.captures) > _MANY else 0.95
    for capture in named(look.shown(facts), look.picked):
        text = capture.id
        if capture.state == "rejected":
            text = f"✕ {capture.id}" + (f" · {capture.reason}" if capture.id == look.picked else "")
        size = 1.3 if capture.id == look.picked else crowded if look.picked is None else 0.75
        yield nodes.label(f"/labels/{capture.id}", capture.base_from_tool0.translation_mm, text, size)


Layer = Callable[[SceneFacts, Look], Iterator[Node]]

LAYERS: dict[str, tuple[str, Layer]] = {
    "scans": ("Merged cloud", merged_layer),
    "base": ("Base and floor", base_frame),
    "arm": ("Arm, generic", arm),
    "frames": ("Flange and laser frames", frames),
    "light": ("Plane of light", light),
    "points": ("Points by residual", residual_points),
    "sphere": ("Sphere", sphere),
    "uncertainty": ("Uncertainty, magnified", uncertainty),
    "so-far": ("As far as known", so_far),
    "table-so-far": ("Axis as far as known", table_so_far),
    "ghost": ("Pose to take next", ghost),
    "trial": ("Poses being read", trial),
    "live": ("Robot now", robot_now),
    "table": ("Axes under the object", table_axis),
    "circles": ("Circles about the axis", table_circles),
    "places": ("Sphere at each reading", sphere_places),
    "turned": ("Axis as it stood", table_turned),
    "field": ("Uncertainty at the object", field),
    "camera": ("Camera: field of view", camera),
    "boards": ("Camera: boards", boards),
    "plane": ("Camera: laser plane", plane_in_camera),
    "answers": ("Both answers", answers),
    "labels": ("Labels", labels),
}
"""Root node of each layer, its name for people, and what draws it; the first ones are sent and seen first."""


_OF_BASE = {"base", "arm", "labels", "ghost", "trial", "live"}
"""The layers that say where something is in the robot's base."""


def draw(facts: SceneFacts, look: Look) -> dict[str, Node]:
    """Return all nodes of a scene by name."""
    layers = [layer for name, (_, layer) in LAYERS.items() if facts.knows_base or name not in _OF_BASE]
    return {node.name: node for layer in layers for node in layer(facts, look)}
