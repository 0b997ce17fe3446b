"""Scanner and sphere as far as they are known while measuring, with ellipsoids that shrink at each capture."""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from calib_core.frames import FloatArray
from calib_core.records import Result
from calib_core.stages.registry import tool_stages
from server.scenes import nodes
from server.scenes.colors import GHOST, LIGHT, SPHERE, WAITING
from server.scenes.ghost import fan_mm
from server.scenes.look import Look
from server.scenes.nodes import Node
from server.scenes.uncertainty import ellipsoid

if TYPE_CHECKING:
    from calib_core.guidance.so_far import KnownSoFar
    from server.scenes.facts import SceneFacts, SceneInput

_KNOWN_MM = 150.0  # where the sphere's place is less certain than that (k = 2), nothing is drawn of it


def read_so_far(scene: "SceneInput") -> "KnownSoFar | None":
    """Return what the captures tell by now where no result does, None before they tell where the sphere is."""
    if any(stage in scene.results and stage not in scene.stale for stage in tool_stages()):
        return None
    from calib_core.guidance.so_far import known_so_far

    solved = {name: _told(result) for name, result in scene.results.items()}
    found = known_so_far(scene.session, scene.measured, solved)
    if found is None or 2.0 * _worst(found.center) > _KNOWN_MM:
        return None
    return found


def so_far(facts: "SceneFacts", look: Look) -> Iterator[Node]:
    """Draw sphere, scanner and light at the last capture, and how well they are known; nothing after a result."""
    known = facts.so_far
    if known is None or look.alone or not facts.captures:
        return
    center = known.center_in_base_mm
    flange = facts.captures[-1].base_from_tool0
    laser = flange @ known.tool0_from_laser
    if facts.sphere_center_in_base_mm is None:
        yield nodes.ball("/so-far/sphere", center, facts.sphere_radius_mm or 20.0, SPHERE, 0.3)
        yield nodes.axes("/so-far/laser", laser, 30.0, WAITING)
        held = np.array([[flange.translation_mm, laser.translation_mm]])
        yield nodes.lines("/so-far/tool", held, WAITING, 2.0)
        ahead = float(laser.inverse().apply(center)[2])
        faces = np.array([[0, 1, 2]], dtype=np.uint32)
        yield nodes.surface("/so-far/light", laser, fan_mm(ahead), faces, LIGHT, 0.14)
    turned = flange.rotation @ known.tool[3:, 3:] @ flange.rotation.T
    yield ellipsoid("/so-far/tool-known", laser.translation_mm, turned, 1, GHOST)
    yield ellipsoid("/so-far/sphere-known", center, known.center, 1, GHOST)


def _told(result: Result) -> Mapping[str, object]:
    return {**result.to_json(), "stale": True}


def _worst(covariance: FloatArray) -> float:
    return float(np.sqrt(max(np.linalg.eigvalsh((covariance + covariance.T) / 2)[-1], 0.0)))
