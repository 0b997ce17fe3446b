"""Two answers in one scene: where either puts the scanner and one point of the workpiece, with its uncertainty."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from calib_core.cell.found import ON_FLANGE
from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import FIRST, SECOND, WAITING
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.optics import BASE_FROM_CAMERA
from server.scenes.scene_model import SceneFacts
from server.scenes.uncertainty import ellipsoid

if TYPE_CHECKING:
    from calib_core.review.placed_points import PlacedPoint

_K = 2.0
_MAGNIFIED = (1000, 300, 100, 30, 10, 3, 1)
_LARGEST_MM = 60.0
_NAMES = {ON_FLANGE: "tool", "base_from_turntable": "table", "camera_from_laser": "plane of light"}


def magnified(facts: SceneFacts) -> int:
    """Return how many times their size differences and ellipsoids are drawn: the most that stays small."""
    worst_mm = max((_reach_mm(pair) for pair in facts.compared), default=0.0)
    return next((times for times in _MAGNIFIED if times * worst_mm <= _LARGEST_MM), 1)


def answers(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw both answers of each frame that is compared; nothing where nothing is."""
    times = magnified(facts)
    for pair in facts.compared:
        outer, root = _outer(facts, pair.frame), f"/answers/{pair.frame}"
        places = [outer.matrix @ pose.matrix for pose in pair.poses]
        first, second = (place[:3, :3] @ pair.point_mm + place[:3, 3] for place in places)
        # Both stand where the first one is: what they differ by is as large as their ellipsoids are.
        second = first + times * (second - first)
        named = f"{_NAMES[pair.frame]} · " if len(facts.compared) > 1 else ""
        for name, place, point, covariance, color in (
            ("first", places[0], first, pair.covariances[0], FIRST),
            ("second", places[1], second, pair.covariances[1], SECOND),
        ):
            axes = RigidTransform.of(place[:3, :3], place[:3, 3], "base", "base")
            yield nodes.axes(f"{root}/{name}/frame", axes, 40.0, color)
            turned = outer.rotation @ covariance @ outer.rotation.T
            yield ellipsoid(f"{root}/{name}/point", point, turned, times, color, 4 * _LARGEST_MM)
            above = point + np.array([0.0, 0.0, 6.0 if name == "first" else -6.0])
            anchor = "bottom-center" if name == "first" else "top-center"
            yield nodes.label(f"{root}/{name}/name", above, f"{named}{name}", 1.1, anchor)
        if np.linalg.norm(second - first) > 0.5:
            yield nodes.lines(f"{root}/apart", np.array([[first, second]]), WAITING, 2.5)
        origin = np.array([[outer.translation_mm, places[0][:3, 3]], [places[0][:3, 3], first]])
        yield nodes.lines(f"{root}/held", origin, WAITING, 1.2)


def places_mm(facts: SceneFacts) -> FloatArray:
    """Return the places (N, 3) that a view of both answers must hold."""
    found = [np.zeros((0, 3))]
    times = magnified(facts)
    for pair in facts.compared:
        outer = _outer(facts, pair.frame)
        first, second = (outer.apply(pose.apply(pair.point_mm)) for pose in pair.poses)
        reach = _reach_mm(pair) * times * np.concatenate([np.eye(3), -np.eye(3)])
        found += [(first + reach), (first + times * (second - first))[None] + 0.5 * reach]
        found.append(outer.apply(pair.poses[0].translation_mm)[None])
    return np.concatenate(found)


def _outer(facts: SceneFacts, frame: str) -> RigidTransform:
    """Return the outer frame of a compared one in the base: the last flange that counts, or the bench."""
    if frame == "camera_from_laser":
        return BASE_FROM_CAMERA if facts.optics is None else facts.optics.base_from_camera
    used = [capture.base_from_tool0 for capture in facts.captures if capture.state == "used"]
    at_flange = frame == ON_FLANGE and used
    return used[-1] if at_flange else RigidTransform.identity("base", "base")


def _reach_mm(pair: "PlacedPoint") -> float:
    """Return how far difference and ellipsoids reach about the first answer's point."""
    first, second = (pose.apply(pair.point_mm) for pose in pair.poses)
    widest = max(float(np.linalg.eigvalsh((one + one.T) / 2)[-1]) for one in pair.covariances)
    return float(np.linalg.norm(second - first)) + _K * float(np.sqrt(max(widest, 0.0)))
