"""The layer of merged scans, coloured by scan or by height."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import RigidTransform
from server.scenes import nodes
from server.scenes.colors import SCANS, height_colors
from server.scenes.facts import SceneFacts
from server.scenes.look import Look
from server.scenes.merged import MergedScans
from server.scenes.nodes import Node

_CHUNK = 100_000  # a browser draws the first ones while the others are on their way


def merged_cloud(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the points of all scans in their common frame, which turns with the table."""
    merged = facts.merged
    if merged is None:
        return
    place = RigidTransform.identity("base", "base")
    if merged.frame == "turntable":
        if facts.table is None:
            return
        place = facts.table.turned(look.table_deg(facts))
    yield nodes.frame("/scans/merged", place)
    colors = _colors(merged, look)
    origin = merged.points_mm.mean(axis=0)
    size = point_size_mm(merged)
    for number, start in enumerate(range(0, len(merged.points_mm), _CHUNK)):
        chunk = slice(start, start + _CHUNK)
        yield nodes.points(f"/scans/merged/{number}", merged.points_mm[chunk], origin, colors[chunk], size)


def height_range_mm(merged: MergedScans) -> tuple[float, float]:
    """Return the heights that most points lie between; strays beyond have the end colours."""
    low, high = np.quantile(merged.points_mm[:, 2], [0.005, 0.995])
    return float(low), float(high)


def point_size_mm(merged: MergedScans) -> float:
    """Return a size at which the points nearly close the surface."""
    extent = float(np.linalg.norm(np.ptp(merged.points_mm, axis=0)))
    return float(np.clip(extent / np.sqrt(len(merged.points_mm)), 0.2, 2.0))


def _colors(merged: MergedScans, look: Look) -> NDArray[np.uint8]:
    if look.cloud_colors == "by height":
        return height_colors(merged.points_mm[:, 2], *height_range_mm(merged))
    return np.array(SCANS, dtype=np.uint8)[merged.scan % len(SCANS)]
