"""A session's small picture for a list of sessions: where the captures were taken, without points or viser.

One set of colours serves a light page and a dark one: the picture is an image of its own, which no theme reaches.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib_core.frames import FloatArray
from calib_core.records import Measured
from server.scenes.advice import no_advice
from server.scenes.scene_input import SceneInput, no_points, nothing
from server.scenes.scene_model import CaptureFacts, SceneFacts, scene_facts

WIDTH, HEIGHT = 240, 120
_MARGIN = 14.0
_STEEL, _LIGHT, _BLUE, _RED = "#7d8894", "#d9583f", "#3d84c6", "#b8492f"
_ARM_MM = 60.0
_CIRCLE_SIDES = 48
_MOST_CORNERS = 600
# Seen from the front right and a little from above: base x to the right, y away, z up.
_RIGHT, _UP = np.array([0.86, 0.50, 0.0]), np.array([-0.17, 0.30, 0.94])


def session_picture(scene: SceneInput) -> str:
    """Return a session's picture as SVG of 240 × 120: its poses about the sphere, or where a board was seen."""
    # Clouds are not drawn, and reading them takes long.
    bare = replace(scene, load_points=no_points, load_scans=nothing, load_merged=nothing, advise=no_advice)
    facts = scene_facts(bare)
    parts = list(_cell(facts)) if facts.captures else list(_frames(scene.measured))
    size = f'viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{"".join(parts)}</svg>'


def _cell(facts: SceneFacts) -> Iterator[str]:
    flanges = np.array([c.base_from_tool0.translation_mm for c in facts.captures])
    targets = np.array([_target(capture) for capture in facts.captures])
    circles = [_circle(facts, mount) for mount in _turning(facts)]
    page = _Page(np.concatenate([flanges, targets, *circles]))
    for circle in circles:
        yield _path(page.at(circle), _STEEL, 1.2, closed=True)
    for capture, flange, target in zip(facts.captures, page.at(flanges), page.at(targets), strict=True):
        color = _RED if capture.state == "rejected" else _LIGHT
        yield _path(np.array([flange, target]), color, 0.8, opacity=0.45)
    for center in _distinct(page.at(targets)) if _has_sphere(facts) else []:
        radius_px = float(np.clip((facts.sphere_radius_mm or 20.0) * page.px_per_mm, 4.0, 16.0))
        yield _dot(center, radius_px, _STEEL)
    for capture, flange in zip(facts.captures, page.at(flanges), strict=True):
        yield _cross(flange) if capture.state == "rejected" else _dot(flange, 2.6, _BLUE)


def _turning(facts: SceneFacts) -> Iterable[str]:
    """Return the mountings that go round an axis."""
    return () if facts.table is None or facts.table.slides else facts.table.mounts or ()


def _has_sphere(facts: SceneFacts) -> bool:
    return any(capture.sphere_center_in_base_mm is not None for capture in facts.captures)


def _target(capture: CaptureFacts) -> FloatArray:
    """Return the sphere's centre, or while that is unknown a point ahead of the flange, in the base, mm."""
    if capture.sphere_center_in_base_mm is not None:
        return capture.sphere_center_in_base_mm
    return capture.base_from_tool0.apply(np.array([[0.0, 0.0, _ARM_MM]]))[0]


def _circle(facts: SceneFacts, mount: str) -> FloatArray:
    assert facts.table is not None
    turn_deg = np.linspace(0, 360, _CIRCLE_SIDES, endpoint=False)
    places = [facts.table.center_in_base_mm(mount, float(angle)) for angle in turn_deg]
    return np.array([place for place in places if place is not None]).reshape(-1, 3)


def _distinct(points_px: FloatArray) -> FloatArray:
    return np.unique(np.round(points_px, 1), axis=0)


def _frames(measured: Sequence[Measured]) -> Iterator[str]:
    """Draw where in the image boards and stripes were seen."""
    seen = [m for m in measured if m.image_size is not None and m.preview]
    if not seen:
        return
    width_px, height_px = seen[0].image_size or (4, 3)
    scale = min((WIDTH - 2 * _MARGIN) / width_px, (HEIGHT - 2 * _MARGIN) / height_px)
    left, top = (WIDTH - scale * width_px) / 2, (HEIGHT - scale * height_px) / 2
    box = f'x="{left:.1f}" y="{top:.1f}" width="{scale * width_px:.1f}" height="{scale * height_px:.1f}"'
    yield f'<rect {box} rx="3" fill="none" stroke="{_STEEL}"/>'
    corners = np.concatenate([np.array(m.preview, dtype=float)[:, :2] for m in seen])
    for x, y in corners[:: max(len(corners) // _MOST_CORNERS, 1)]:
        yield _dot(np.array([left + scale * x, top + scale * y]), 1.2, _BLUE)


class _Page:
    """Puts points of the base on the picture, all of them in sight.

    Attributes
    ----------
    px_per_mm : float
    """

    def __init__(self, points_mm: FloatArray) -> None:
        flat = np.column_stack([points_mm @ _RIGHT, -points_mm @ _UP])
        low, high = flat.min(axis=0), flat.max(axis=0)
        room = np.array([WIDTH, HEIGHT]) - 2 * _MARGIN
        self.px_per_mm = float(np.min(room / np.maximum(high - low, 1.0)))
        self._middle_mm = (low + high) / 2

    def at(self, points_mm: FloatArray) -> FloatArray:
        """Return the pixels (N, 2) of points (N, 3) in the base."""
        flat = np.column_stack([points_mm @ _RIGHT, -points_mm @ _UP])
        return (flat - self._middle_mm) * self.px_per_mm + np.array([WIDTH, HEIGHT]) / 2


def _path(points_px: FloatArray, color: str, width: float, opacity: float = 1.0, closed: bool = False) -> str:
    text = "L".join(f"{x:.1f} {y:.1f}" for x, y in points_px)
    end = "Z" if closed else ""
    return f'<path d="M{text}{end}" fill="none" stroke="{color}" stroke-width="{width}" opacity="{opacity}"/>'


def _dot(center_px: FloatArray, radius_px: float, color: str) -> str:
    return f'<circle cx="{center_px[0]:.1f}" cy="{center_px[1]:.1f}" r="{radius_px:.1f}" fill="{color}"/>'


def _cross(center_px: FloatArray) -> str:
    x, y = center_px
    return f'<path d="M{x - 3:.1f} {y - 3:.1f}l6 6m0 -6l-6 6" stroke="{_RED}" stroke-width="1.6" fill="none"/>'
