"""How well tool point, sphere and axis are known, drawn as ellipsoids that shrink as captures come in."""

from collections.abc import Iterator

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import UNCERTAIN, Rgb
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

_K = 2.0
_MAGNIFIED = (100, 10, 1)
_RINGS, _CORNERS = 9, 24
_LARGEST_MM = 25.0  # what is hardly known must not hide everything else


def magnified(facts: SceneFacts) -> int:
    """Return how many times as large as they are the ellipsoids are drawn: the most that keeps them small."""
    return next((times for times in _MAGNIFIED if times * _worst_mm(facts) <= _LARGEST_MM), 1)


def is_cut(facts: SceneFacts) -> bool:
    """Return whether an ellipsoid is larger than it is drawn."""
    return _worst_mm(facts) > _LARGEST_MM


def _worst_mm(facts: SceneFacts) -> float:
    known = facts.uncertainty
    parts = [] if known is None else [known.tool, known.sphere]
    blocks = [part[-3:, -3:] for part in parts if part is not None]
    if known is not None and known.table is not None and facts.table is not None:
        place, reach_mm = facts.table.base_from_turntable, facts.table.reach_mm
        blocks += [_across(place, point, known.table) for point in axis_ends_mm(reach_mm)]
    return max((_K * float(np.sqrt(max(np.linalg.eigvalsh(b)[-1], 0.0))) for b in blocks), default=0.0)


def uncertainty(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw k = 2 ellipsoids, magnified: of the tool point, the sphere's centre, and the axis."""
    known = facts.uncertainty
    if known is None:
        return
    times = magnified(facts)
    if known.tool is not None and facts.mount_from_laser is not None:
        shown = [c for c in look.shown(facts) if c.state == "used"]
        here = next((c for c in shown if c.id == look.picked), shown[-1] if shown else None)
        if here is not None:
            laser = here.base_from_tool0 @ facts.mount_from_laser
            turned = here.base_from_tool0.rotation
            covariance = turned @ known.tool[3:, 3:] @ turned.T
            yield ellipsoid("/uncertainty/tool", laser.translation_mm, covariance, times)
    if known.sphere is not None and facts.sphere_center_in_base_mm is not None:
        yield ellipsoid("/uncertainty/sphere", facts.sphere_center_in_base_mm, known.sphere, times)
    if known.table is not None and facts.table is not None:
        place = facts.table.base_from_turntable
        yield from about_axis("/uncertainty/axis", place, known.table, facts.table.reach_mm, times)


def axis_ends_mm(reach_mm: tuple[float, float, float]) -> FloatArray:
    """Return the ends (2, 3) of the axis as it is drawn, in T: past all that stands on the table."""
    low, high, away = reach_mm
    return np.array([[0.0, 0.0, low - 0.5 * away], [0.0, 0.0, high + 0.8 * away]])


def about_axis(
    name: str,
    place: RigidTransform,
    covariance: FloatArray,
    reach_mm: tuple[float, float, float],
    times: int,
    color: Rgb = UNCERTAIN,
) -> Iterator[Node]:
    """Draw how well an axis is known: the tube (k = 2, magnified) in which it lies, and ellipsoids at its ends.

    `covariance` (6, 6) is that of `place`; the tube is narrow where the sphere was seen and opens beyond it.
    """
    low, high = axis_ends_mm(reach_mm)
    for end, point in (("low", low), ("high", high)):
        yield ellipsoid(f"{name}-{end}", place.apply(point), _across(place, point, covariance), times, color)
    rings = [_ring_mm(place, point, covariance, times) for point in np.linspace(low, high, _RINGS)]
    around = np.arange(_CORNERS)
    first = np.stack([around, (around + 1) % _CORNERS, around + _CORNERS], axis=1)
    second = np.stack([(around + 1) % _CORNERS, (around + 1) % _CORNERS + _CORNERS, around + _CORNERS], axis=1)
    one = np.concatenate([first, second])
    faces = np.concatenate([one + _CORNERS * k for k in range(_RINGS - 1)]).astype(np.uint32)
    yield nodes.surface(f"{name}-tube", place, np.concatenate(rings), faces, color, 0.25)


def _ring_mm(place: RigidTransform, point_mm: FloatArray, covariance: FloatArray, times: int) -> FloatArray:
    """Return the ellipse (N, 3) in which the axis passes at a point of it, k = 2, magnified, in T."""
    turned = place.rotation.T @ _across(place, point_mm, covariance) @ place.rotation
    values, axes = np.linalg.eigh((turned[:2, :2] + turned[:2, :2].T) / 2)
    half_mm = np.clip(_K * times * np.sqrt(np.maximum(values, 0.0)), 0.1, _LARGEST_MM)
    angle = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
    rim = np.stack([half_mm[0] * np.cos(angle), half_mm[1] * np.sin(angle)]).T @ axes.T
    return point_mm + np.column_stack([rim, np.zeros(_CORNERS)])


def _across(place: RigidTransform, point_mm: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) of a point of the axis in the base, across the axis."""
    x, y, z = point_mm
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    jacobian = np.hstack([-place.rotation @ skew, np.eye(3)])
    axis = place.rotation[:, 2]
    flat = np.eye(3) - 0.98 * np.outer(axis, axis)
    return flat @ jacobian @ covariance @ jacobian.T @ flat


def ellipsoid(
    name: str,
    center_mm: FloatArray,
    covariance: FloatArray,
    times: int,
    color: Rgb = UNCERTAIN,
    largest_mm: float = _LARGEST_MM,
) -> Node:
    """Return a k = 2 ellipsoid, magnified; what is hardly known is drawn smaller than it is."""
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    half_mm = np.clip(_K * times * np.sqrt(np.maximum(values, 0.0)), 0.1, largest_mm)
    if np.linalg.det(axes) < 0:
        axes = axes * [1.0, 1.0, -1.0]
    pose = RigidTransform.of(axes, center_mm, "base", "base")
    return nodes.ellipsoid(name, pose, half_mm, color, 0.4)
