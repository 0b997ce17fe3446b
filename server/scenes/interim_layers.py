"""Scanner, sphere and table as far as they are known while measuring; the doubt shrinks at each capture."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from calib_core.messages import message
from server.scenes import nodes
from server.scenes.colors import GHOST, LIGHT, MOUNTS, SPHERE, WAITING
from server.scenes.display_options import Look
from server.scenes.ghost import fan_mm
from server.scenes.nodes import Node
from server.scenes.turntable import TableFacts
from server.scenes.turntable_layers import ring_mm
from server.scenes.uncertainty import about_axis, axis_ends_mm, ellipsoid

if TYPE_CHECKING:
    from calib_core.guidance.interim_estimate import TableSoFar
    from server.scenes.scene_model import SceneFacts

AXIS_TIMES = 10  # always the same while measuring, so that the tube is seen to shrink


def so_far(facts: "SceneFacts", look: Look) -> Iterator[Node]:
    """Draw sphere, scanner and light at the last capture, and how well they are known; nothing after a result."""
    known = facts.so_far
    if known is None or look.alone or not facts.captures:
        return
    center = known.center_in_base_mm
    flange = facts.captures[-1].base_from_tool0
    laser = flange @ known.mount_from_laser
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


def table_so_far(facts: "SceneFacts", look: Look) -> Iterator[Node]:
    """Draw the axis and the circles about it as far as they are known, and in what tube the axis lies."""
    known = facts.table_so_far
    if known is None or look.alone:
        return
    place = known.base_from_turntable
    reach_mm = reach_so_far_mm(known)
    yield from about_axis("/table-so-far/axis", place, known.covariance, reach_mm, AXIS_TIMES, GHOST)
    if facts.table is not None:
        return
    ends = place.apply(axis_ends_mm(reach_mm))
    yield nodes.lines("/table-so-far/line", ends[None], WAITING, 2.0)
    yield nodes.label("/table-so-far/name", ends[1], message("Turntable"))
    for number, (mount, at) in enumerate(known.mounts.items()):
        circle = place.apply(ring_mm(float(np.hypot(at[0], at[1])), float(at[2])))
        yield nodes.polyline(f"/table-so-far/circle-{number}", circle, MOUNTS[number % len(MOUNTS)], 2.0)
        if mount:
            yield nodes.label(f"/table-so-far/circle-{number}-name", circle[len(circle) // 8], mount, 0.95)


def reach_so_far_mm(known: "TableSoFar") -> tuple[float, float, float]:
    """Return how far the table's things reach: lowest and highest along the axis, and away from it."""
    return TableFacts(known.base_from_turntable, known.direction, known.mounts).reach_mm
