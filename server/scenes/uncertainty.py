"""How well tool point, sphere and axis are known, drawn as ellipsoids that shrink as captures come in."""

from collections.abc import Iterator

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import UNCERTAIN, Rgb
from server.scenes.facts import SceneFacts
from server.scenes.look import Look
from server.scenes.nodes import Node

_K = 2.0
_MAGNIFIED = (100, 10, 1)
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
    return max((_K * float(np.sqrt(max(np.linalg.eigvalsh(b)[-1], 0.0))) for b in blocks), default=0.0)


def uncertainty(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw k = 2 ellipsoids, magnified: of the tool point, the sphere's centre, and the axis."""
    known = facts.uncertainty
    if known is None:
        return
    times = magnified(facts)
    if known.tool is not None and facts.tool0_from_laser is not None:
        shown = [c for c in look.shown(facts) if c.state == "used"]
        here = next((c for c in shown if c.id == look.picked), shown[-1] if shown else None)
        if here is not None:
            laser = here.base_from_tool0 @ facts.tool0_from_laser
            turned = here.base_from_tool0.rotation
            covariance = turned @ known.tool[3:, 3:] @ turned.T
            yield ellipsoid("/uncertainty/tool", laser.translation_mm, covariance, times)
    if known.sphere is not None and facts.sphere_center_in_base_mm is not None:
        yield ellipsoid("/uncertainty/sphere", facts.sphere_center_in_base_mm, known.sphere, times)
    if known.table is not None and facts.table is not None:
        place = facts.table.base_from_turntable
        low, high, away = facts.table.reach_mm
        ends = np.array([[0.0, 0.0, low - 0.5 * away], [0.0, 0.0, high + 0.8 * away]])
        for name, point in zip(("low", "high"), ends, strict=True):
            yield ellipsoid(
                f"/uncertainty/axis-{name}", place.apply(point), _across(place, point, known.table), times
            )


def _across(place: RigidTransform, point_mm: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the covariance (3, 3) of a point of the axis in the base, across the axis."""
    x, y, z = point_mm
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    jacobian = np.hstack([-place.rotation @ skew, np.eye(3)])
    axis = place.rotation[:, 2]
    flat = np.eye(3) - 0.98 * np.outer(axis, axis)
    return flat @ jacobian @ covariance @ jacobian.T @ flat


def ellipsoid(
    name: str, center_mm: FloatArray, covariance: FloatArray, times: int, color: Rgb = UNCERTAIN
) -> Node:
    """Return a k = 2 ellipsoid, magnified; what is hardly known is drawn smaller than it is."""
    values, axes = np.linalg.eigh((covariance + covariance.T) / 2)
    half_mm = np.clip(_K * times * np.sqrt(np.maximum(values, 0.0)), 0.1, _LARGEST_MM)
    if np.linalg.det(axes) < 0:
        axes = axes * [1.0, 1.0, -1.0]
    pose = RigidTransform.of(axes, center_mm, "base", "base")
    return nodes.ellipsoid(name, pose, half_mm, color, 0.4)
