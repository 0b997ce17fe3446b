"""The error budget over the table: a dot at each point, in the colour of the ± (k = 2) that one scan has there."""

from collections.abc import Iterator

import numpy as np

from server.scenes import nodes
from server.scenes.colors import height_colors
from server.scenes.display_options import Look
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

_DOT = 0.03  # of the field's radius


def field(facts: SceneFacts, _look: Look) -> Iterator[Node]:
    """Draw the field's dots over the table as it stands at its angle zero."""
    if facts.field is None or facts.table is None:
        return
    place, points = facts.table.base_from_turntable, facts.field.points_mm
    colors = height_colors(facts.field.uncertainty_mm, *facts.field.range_mm)
    size = _DOT * float(np.hypot(points[:, 0], points[:, 1]).max())
    yield nodes.points("/field/points", place.apply(points), place.translation_mm, colors, size)
