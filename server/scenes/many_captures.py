"""Captures by the hundreds: each sort of thing is one node for all of them, drawn as instances."""

from collections.abc import Iterator, Sequence

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from server.scenes import nodes
from server.scenes.colors import LIGHT, REJECTED, STATE_COLOR, WAITING, diverging_colors
from server.scenes.display_options import Look
from server.scenes.light_sheet import fan_of_profile
from server.scenes.markers import cross
from server.scenes.nodes import Node
from server.scenes.scene_model import CaptureFacts, SceneFacts

MANY = 60
"""From so many captures on; up to here each has nodes of its own, whose looks tell its state."""

_FLANGE_MM, _LASER_MM, _CROSS_MM = 28.0, 18.0, 14.0
_MOST_AXES, _MOST_LASERS, _MOST_FANS, _MOST_LABELS, _MOST_POINTS = 120, 200, 24, 30, 15_000


def frames_of_all(captures: Sequence[CaptureFacts]) -> Iterator[Node]:
    """Draw flanges, lasers, what joins them, and crosses, as one node each; of very many where flanges point."""
    ids = tuple(capture.id for capture in captures)
    flanges = [capture.base_from_tool0 for capture in captures]
    lasers = [laser for capture in captures if (laser := capture.base_from_laser) is not None]
    colors = [STATE_COLOR[capture.state] for capture in captures]

    def of_all(name: str, poses: Sequence[RigidTransform], length_mm: float) -> Node:
        if len(poses) <= _MOST_AXES:
            return nodes.many_axes(name, poses, length_mm, ids)
        return nodes.many_arrowheads(name, poses, length_mm, colors, ids)

    yield of_all("/frames/flanges", flanges, _FLANGE_MM)
    if len(lasers) == len(flanges) <= _MOST_LASERS:
        yield of_all("/frames/lasers", lasers, _LASER_MM)
        pairs = zip(captures, flanges, lasers, strict=True)
        ends = [(a.translation_mm, b.translation_mm) for one, a, b in pairs if not one.stands_still]
        if ends:
            yield nodes.lines("/frames/tools", np.array(ends), WAITING, 1.0)
    crosses = [cross(c.base_from_tool0.translation_mm, _CROSS_MM) for c in captures if c.state == "rejected"]
    if crosses:
        yield nodes.lines("/frames/crosses", np.concatenate(crosses), REJECTED, 2.0)


def light_of_all(captures: Sequence[CaptureFacts]) -> Iterator[Node]:
    """Draw the light of captures spread over all of them as one faint surface."""
    corners: list[FloatArray] = []
    faces: list[FloatArray] = []
    count = 0
    for capture in captures[:: -(-len(captures) // _MOST_FANS)]:
        laser = capture.base_from_laser
        if laser is None or capture.kind != "profile" or len(capture.points_in_laser_mm) < 2:
            continue
        fan, triangles = fan_of_profile(capture.points_in_laser_mm)
        corners.append(laser.apply(fan))
        faces.append(triangles.astype(float) + count)
        count += len(fan)
    if corners:
        base = RigidTransform.identity("base", "base")
        every = np.concatenate(faces).astype(np.uint32)
        yield nodes.surface("/light/all", base, np.concatenate(corners), every, LIGHT, 0.03)


def points_of_all(
    facts: SceneFacts, look: Look, captures: Sequence[CaptureFacts], size_mm: float
) -> Iterator[Node]:
    """Draw the points of all captures as one cloud."""
    clouds: list[FloatArray] = []
    colors = []
    every_th = -(-sum(len(capture.points_in_laser_mm) for capture in captures) // _MOST_POINTS) or 1
    for capture in captures:
        cloud = facts.points_in_base_mm(capture)[::every_th]
        if not len(cloud):
            continue
        told = facts.residuals_mm(capture)
        residuals = None if told is None else told[::every_th]
        clouds.append(cloud)
        if residuals is None or capture.state == "rejected":
            one = REJECTED if capture.state == "rejected" else WAITING
            colors.append(np.tile(np.array(one, dtype=np.uint8), (len(cloud), 1)))
        else:
            colors.append(diverging_colors(residuals, look.limit_mm))
    if clouds:
        every = np.concatenate(clouds)
        yield nodes.points("/points/all", every, every.mean(axis=0), np.concatenate(colors), size_mm)


def named(captures: Sequence[CaptureFacts], picked: str | None) -> list[CaptureFacts]:
    """Return the captures that have a label: of many those picked and rejected, and some spread over the rest."""
    if len(captures) <= MANY:
        return list(captures)
    every = -(-len(captures) // _MOST_LABELS)
    return [c for k, c in enumerate(captures) if c.id == picked or k % every == 0]
