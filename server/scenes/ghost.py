"""The pose to take next, as the guide proposes it: drawn before it is taken, clearly none of those that were."""

from collections.abc import Iterator

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import GHOST
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts
from server.scenes.turntable_layers import ring_mm

AXES_MM = 44.0
_RING_MM, _FAN_HALF_RAD = 14.0, 0.26
_FAR_MM = 200.0  # as far as the light is drawn where the sphere's distance is not known
_DASHES = 9


def ghost(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the flange where it should go next, the way there from the last one, and the light from there."""
    pose = facts.next_pose
    if pose is None or look.alone:
        return
    yield nodes.axes("/ghost/flange", pose, AXES_MM, GHOST)
    yield nodes.polyline("/ghost/ring", pose.apply(ring_mm(_RING_MM, 0.0)), GHOST, 3.0)
    yield nodes.label("/ghost/name", pose.translation_mm, "next pose", 1.2)
    if facts.captures:
        here = facts.captures[-1].base_from_tool0.translation_mm
        way = _dashes_mm(here, pose.translation_mm)
        if len(way):
            yield nodes.lines("/ghost/way", way, GHOST, 2.0)
    if facts.mount_from_laser is None:
        return
    laser = pose @ facts.mount_from_laser
    yield nodes.axes("/ghost/laser", laser, 0.6 * AXES_MM, GHOST)
    corners = fan_mm(_ahead_mm(facts, laser))
    yield nodes.surface("/ghost/light", laser, corners, np.array([[0, 1, 2]], dtype=np.uint32), GHOST, 0.16)


def _dashes_mm(start: FloatArray, end: FloatArray) -> FloatArray:
    """Return dashes (N, 2, 3) from one place to another, none where they are the same."""
    if np.linalg.norm(end - start) < 1.0:
        return np.zeros((0, 2, 3))
    steps = np.linspace(0, 1, 2 * _DASHES)[:, None]
    return (start + steps * (end - start)).reshape(_DASHES, 2, 3)


def _ahead_mm(facts: SceneFacts, laser: RigidTransform) -> float:
    """Return how far along L's z the light is drawn, with its sign: to the sphere where that is known."""
    center = facts.sphere_center_in_base_mm
    if center is None:
        return _FAR_MM
    ahead = float(laser.inverse().apply(center)[2])
    return ahead if abs(ahead) > 1.0 else _FAR_MM


def fan_mm(ahead_mm: float) -> FloatArray:
    """Return the corners (3, 3) of the light from the scanner's origin to so far along z, in L."""
    half = abs(ahead_mm) * np.tan(_FAN_HALF_RAD)
    return np.array([[0.0, 0.0, 0.0], [-half, 0.0, ahead_mm], [half, 0.0, ahead_mm]])
