"""Captures of the sphere as they are where the cell's axes moved the robot, or what carries the ball."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from calib_core.captures.placement import Placement, placement_of
from calib_core.cell.axes import axes_needed, carrier_told, moved_axes, reading_sigmas
from calib_core.chain.observations import Observations, SphereObservation
from calib_core.frames import FloatArray, RigidTransform, vector_from_rotation
from calib_core.records import Capture, Cell
from calib_core.stages.tcp.record import ToolResult

_STEP = 1e-3  # of one sigma: what errors move is told by its slope


def axes_of_answer(cell: Cell, answer: ToolResult) -> Placement | None:
    """Return where the axes of a cell are by an answer, those that lead to the scanner or to a told ball."""
    solved = answer.model_dump(by_alias=True)
    solved["axes"] = [axis for axis in solved.get("axes", []) if axis["name"] in axes_needed(cell)]
    found = placement_of(cell, [], [solved]) if solved["axes"] else None
    return None if found is None else found.in_base


def on_axes(
    observations: Observations, captures: Sequence[Capture], axes: Placement | None
) -> list[SphereObservation]:
    """Return observations with the flange where the axes brought it, as seen from what carries the ball."""
    if axes is None:
        return list(observations)
    feet = {capture.id: _foot(axes, capture) for capture in captures}
    return [replace(o, base_from_tool0=feet[o.capture] @ o.base_from_tool0) for o in observations]


def axis_moves(captures: Sequence[Capture], axes: Placement | None) -> dict[str, FloatArray]:
    """Return by captures how one sigma of each error of the axes moves the robot, as `Tool` takes it."""
    if axes is None:
        return {}
    return {
        capture.id: np.array([
            _twist(moved @ _foot(axes, capture).inverse()) / _STEP for moved in _feet_off(axes, capture)
        ]).T
        for capture in captures
    }  # fmt: skip


def _feet_off(axes: Placement, capture: Capture) -> Iterator[RigidTransform]:
    """Give the robot's foot with each error of the axes: of their frames, then of their readings."""
    for a, axis in enumerate(axes.axes):
        values, vectors = np.linalg.eigh(axis.covariance)
        for step in (vectors * np.sqrt(np.maximum(values, 0.0))).T:
            yield _foot(axes.with_axis_moved(a, _STEP * step), capture)
    assert axes.cell is not None, "it names axes"
    for edge, sigma in zip(moved_axes(axes.cell), reading_sigmas(axes.cell), strict=True):
        yield _foot(axes, capture, {edge.name: _STEP * (sigma or 0.0)})


def _foot(axes: Placement, capture: Capture, off: dict[str, float] | None = None) -> RigidTransform:
    assert axes.cell is not None, "it names axes"
    return axes.foot(capture, carrier_told(axes.cell, capture), off)


def _twist(moved: RigidTransform) -> FloatArray:
    return np.array([*vector_from_rotation(moved.rotation), *moved.translation_mm])
