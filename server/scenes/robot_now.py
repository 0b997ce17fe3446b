"""Where the robot stands at this moment, as its source tells it, and the light as the scanner sees it."""

from collections.abc import Iterator

import numpy as np

from server.scenes import nodes
from server.scenes.colors import LASER
from server.scenes.display_options import Look
from server.scenes.light_sheet import fan_of_profile
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

_FLANGE_MM, _LASER_MM = 60.0, 40.0


def robot_now(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw flange, scanner and light as they are now; without a live robot nothing."""
    now = look.robot
    if now is None:
        return
    flange = now.base_from_tool0
    yield nodes.axes("/live/flange", flange, _FLANGE_MM, LASER)
    yield nodes.label("/live/name", flange.translation_mm, "Robot now", 1.2)
    if facts.mount_from_laser is None:
        return
    laser = flange @ facts.mount_from_laser
    yield nodes.axes("/live/laser", laser, _LASER_MM, LASER)
    profile = now.profile_mm[np.isfinite(now.profile_mm).all(axis=1)]
    if len(profile) >= 2:
        points = np.stack([profile[:, 0], np.zeros(len(profile)), profile[:, 1]], axis=1)
        corners, faces = fan_of_profile(points)
        yield nodes.surface("/live/light", laser, corners, faces, LASER, 0.35)
