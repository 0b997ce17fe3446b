"""Poses that are being read and not stored yet: what a convention makes of them, seen before anything is done."""

from collections.abc import Iterator

import numpy as np

from calib_core.messages import message
from server.scenes import nodes
from server.scenes.colors import GHOST
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

_AXES_MM = 60.0


def trial(_facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the flange of each pose, with its number, and the way from one to the next."""
    for number, pose in enumerate(look.trial, start=1):
        yield nodes.axes(f"/trial/{number}", pose, _AXES_MM, GHOST)
        words = message("line {number}", number=number)
        yield nodes.label(f"/trial/{number}/name", pose.translation_mm, words, 0.9)
    if len(look.trial) > 1:
        places = np.array([pose.translation_mm for pose in look.trial])
        yield nodes.polyline("/trial/way", places, GHOST, 1.5)
