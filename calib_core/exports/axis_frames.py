"""The frames of a cell's axes as exports write them: z along each, where all axes read zero."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib_core.cell.axes import TABLE
from calib_core.cell.found import axis_of_table
from calib_core.exports.answer import Answer
from calib_core.frames import FloatArray, RigidTransform


@dataclass(frozen=True, eq=False)
class AxisFrame:
    """An axis's frame in base, its covariance (6, 6) where that is stated, and what the axis carries."""

    name: str
    frame: RigidTransform
    covariance: FloatArray | None
    carries: str


def table_axis(answer: Answer) -> str:
    """Return the name of the axis that `base_from_turntable` is of; `table` where the cell names none."""
    return axis_of_table(answer.results.get(answer.stage if answer.stage == "chain" else "turntable", {}))[0]


def other_axes(answer: Answer) -> Iterator[AxisFrame]:
    """Give the axes beside that one: by their own frames where they carry balls, else by their lines."""
    edges = {axis.name: axis for axis in answer.session.cell.axes or ()}
    given, table = set[str](), table_axis(answer)
    for found in answer.frames:
        if found.into == "base" and found.outof in edges and found.outof not in given:
            given.add(found.outof)
            frame = RigidTransform.from_rounded(found.matrix, "base", "turntable")
            covariance = None if found.covariance is None else np.array(found.covariance, dtype=float)
            yield AxisFrame(found.outof, frame, covariance, edges[found.outof].carries)
    for result in answer.results.values():
        for axis in result.get("axes") or ():
            name = axis["name"]
            line = np.array([*axis["axis_direction"], *(axis["axis_point_mm"] or (0.0, 0.0, 0.0))], dtype=float)
            if name not in given | {table, TABLE} and np.isfinite(line).all():
                given.add(name)
                carries = edges[name].carries if name in edges else "object"
                yield AxisFrame(name, _along(line[:3], line[3:]), None, carries)


def _along(direction: FloatArray, origin: FloatArray) -> RigidTransform:
    """Return a frame whose z is along a direction (3,), and x beside base's x, as that of a table."""
    z = direction / np.linalg.norm(direction)
    across = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    x = across - z * (z @ across)
    x = x / np.linalg.norm(x)
    return RigidTransform.of(np.column_stack([x, np.cross(z, x), z]), origin, "base", "turntable")
