"""The layer of the merged cloud: coloured by height, scan or deviation, and cut open where it is asked."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.cloud_view import Section
from server.scenes.colors import (
    DIVERGING,
    SCANS,
    WAITING,
    Rgb,
    band_numbers,
    diverging_colors,
    height_colors,
    intensity_colors,
)
from server.scenes.deviation import CloudDeviation
from server.scenes.display_options import Look
from server.scenes.merged import MergedScans
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts

ROOT = "/scans/merged"
CUT: Rgb = (60, 110, 220)
_PICKED = 0.012  # the radius of a mark, of the cloud's diagonal: points drawn about it are up to half as large
_BORDER = 0.05  # so much of a cloud on either side may be strays, along each axis
_ENOUGH = 100_000  # points to tell its size by
_CHUNK = 100_000  # a browser draws the first ones while the others are on their way


def merged_layer(facts: SceneFacts, look: Look) -> Iterator[Node]:
    """Draw the merged cloud in its own frame, which turns with the table."""
    cloud, place = shown_cloud(facts, look), cloud_place(facts, look)
    if cloud is None or place is None:
        return
    yield nodes.frame(ROOT, place)
    keep = np.ones(len(cloud.points_mm), dtype=bool)
    if look.cloud.section is not None:
        keep = look.cloud.section.keeps(cloud.points_mm)
        yield nodes.lines(f"{ROOT}/cut", outline(look.cloud.section, cloud), CUT, 2.0)
    for number, place_mm in enumerate(look.cloud.picked_mm):
        yield nodes.ball(f"{ROOT}/picked/{number}", place_mm, _PICKED * extent_mm(cloud), CUT, 0.9, 3)
    points, colors = cloud.points_mm[keep], cloud_colors(cloud, look)[keep]
    origin = cloud.points_mm.mean(axis=0, dtype=float)
    size = point_size_mm(cloud)
    for number, start in enumerate(range(0, len(points), _CHUNK)):
        chunk = slice(start, start + _CHUNK)
        yield nodes.points(f"{ROOT}/{number}", points[chunk], origin, colors[chunk], size)


def shown_cloud(facts: SceneFacts, look: Look) -> MergedScans | None:
    """Return what is drawn: the merged cloud; the scans as they were measured where it does not know its scans."""
    if look.cloud.colors == "by scan" and facts.merged is not None and not len(facts.merged.scan):
        return facts.scans() or facts.merged
    return facts.merged


def cloud_place(facts: SceneFacts, look: Look) -> RigidTransform | None:
    """Return where the cloud's frame stands, None while the table is not known; a held part's with one capture."""
    if facts.merged is not None and facts.merged.on_flange:
        return next((one.base_from_tool0 for one in look.shown(facts)), RigidTransform.identity("base", "tool0"))
    if facts.merged is None or not facts.merged.on_table:
        return RigidTransform.identity("base", "base")
    return look.table(facts)


def height_range_mm(merged: MergedScans) -> tuple[float, float]:
    """Return the heights that most points lie between; strays beyond have the end colours."""
    low, high = np.quantile(merged.points_mm[:, 2], [0.005, 0.995])
    return float(low), float(high)


def intensity_range(merged: MergedScans) -> tuple[float, float]:
    """Return the intensities that most points lie between."""
    bright = merged.intensity
    known = bright[np.isfinite(bright)] if bright is not None else np.zeros(0)
    low, high = np.quantile(known, [0.005, 0.995]) if len(known) else (0.0, 1.0)
    return float(low), float(high)


def extent_mm(merged: MergedScans) -> float:
    """Return the diagonal of the cloud without its strays, which may lie far away."""
    some = merged.points_mm[:: len(merged.points_mm) // _ENOUGH + 1]
    low, high = np.quantile(some, [_BORDER, 1 - _BORDER], axis=0)
    return float(np.linalg.norm(high - low)) / (1 - 2 * _BORDER)


def point_size_mm(merged: MergedScans, spread: float = 1.0) -> float:
    """Return a size at which the points nearly close the surface; `spread` scales it for denser ones."""
    return float(np.clip(spread * extent_mm(merged) / np.sqrt(len(merged.points_mm)), 0.1, 2.0))


def cloud_colors(merged: MergedScans, look: Look) -> NDArray[np.uint8]:
    """Return the colours (N, 3) of the cloud's points."""
    if look.cloud.colors == "by deviation":
        values = look.deviation.values_mm if isinstance(look.deviation, CloudDeviation) else None
        return deviation_colors(values, len(merged.points_mm), look)
    if look.cloud.colors == "by intensity" and (bright := merged.intensity) is not None:
        return intensity_colors(bright, *intensity_range(merged))
    if len(merged.scan) and (merged.waiting or look.cloud.colors == "by scan"):
        return scan_colors(merged.scan)
    return height_colors(merged.points_mm[:, 2].astype(float), *height_range_mm(merged))


def scan_colors(numbers: NDArray[np.int64]) -> NDArray[np.uint8]:
    """Return the colours (N, 3) of scans by their numbers (N,); grey where there is none."""
    colors = np.array(SCANS, dtype=np.uint8)[numbers % len(SCANS)]
    colors[numbers < 0] = WAITING
    return colors


def deviation_colors(values_mm: FloatArray | None, count: int, look: Look) -> NDArray[np.uint8]:
    """Return the colours (count, 3) of deviations; points that have none are grey."""
    colors = np.tile(np.array(WAITING, dtype=np.uint8), (count, 1))
    if values_mm is not None and isinstance(look.deviation, CloudDeviation):
        known = np.isfinite(values_mm)
        tolerance_mm = look.deviation.tolerance_mm
        if tolerance_mm is None:
            colors[known] = diverging_colors(values_mm[known], look.deviation.limit_mm)
        else:
            colors[known] = np.array(DIVERGING, dtype=np.uint8)[band_numbers(values_mm[known], tolerance_mm)]
    return colors


def outline(section: Section, merged: MergedScans) -> FloatArray:
    """Return the border (4, 2, 3) of the cutting plane, a little larger than the cloud."""
    directions = section.directions
    seen = merged.points_mm @ directions.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    margin = 0.06 * float((high - low).max())
    (u0, v0), (u1, v1) = (low - margin)[:2], (high + margin)[:2]
    flat = np.array([[u0, v0], [u1, v0], [u1, v1], [u0, v1]])
    corners = flat @ directions[:2] + section.at_mm * directions[2]
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
