"""Where several scanners are, and the axes that were found: what a cell of more than one of each is told by."""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from calib_core.cell.axes import TABLE
from calib_core.cell.found import axis_of_table
from calib_core.cell.titles import axis_title, scanner_title
from calib_core.evidence.numbers import number_text, plus_minus
from calib_core.frames import RigidTransform
from calib_core.messages import Message, message, templates
from calib_core.records import Session
from calib_core.records.evidence import AnyBlock, Column, Row, Table
from calib_core.stages.frame_blocks import direction_text, frame_block, open_frame

_KINDS: Final = templates({"rotary": "rotary", "linear": "linear"})
_TABLES: Final = templates(
    {"rotary": "Rotary axis {axis} in the robot's base", "linear": "Linear axis {axis} in the robot's base"}
)


def scanner_frames(session: Session, result: Any) -> list[AnyBlock]:
    """Return each scanner's frame where there are several, to be typed into the controller, and how they stand."""
    if len({frame.scanner for frame in result.frames if frame.scanner is not None}) < 2:
        return []
    found: list[AnyBlock] = []
    for frame in result.frames:
        matrix = np.array(frame.matrix, dtype=float)
        if not np.isfinite(matrix).all() or not frame.outof.startswith("laser"):
            continue  # a table has a block of its own
        title = scanner_title(frame.into, frame.outof, frame.scanner)
        placed = RigidTransform(matrix, frame.into if frame.scanner else "laser", "laser")
        believed = None if result.verdict == "fail" else frame.covariance
        if result.up_to_shift is not None and frame.scanner is not None:
            found.append(open_frame(session, placed, title, result.up_to_shift, believed))
            continue
        told = {"title": title, "detail": frame.scanner is None, "id": None if found else "tool"}
        block = frame_block(session.cell.pose_convention, placed, believed, **told)
        ends = {"into": frame.into, "outof": frame.outof, "name": f"{frame.into}_from_{frame.outof}"}
        found.append(block.model_copy(update=ends))
    return found


def carrier_name(result: Any) -> str:
    """Return what the axis is called that carries the object."""
    return axis_title(*axis_of_table(result.model_dump(by_alias=True, include={"frames", "spheres", "axes"})))


def table_title(result: Mapping[str, Any]) -> Message:
    """Return what the frame is called of the axis that carries the object, of a result as JSON data."""
    name, kind = axis_of_table(result)
    if (name, kind) == (TABLE, "rotary"):
        return message("Turntable in the robot's base")
    return message(_TABLES[kind], axis=name)


def axes_table(result: Any, shown_already: int = 0) -> list[AnyBlock]:
    """Return all axes where there are more than have blocks of their own: how they lie, and how they count."""
    if len(result.axes) <= shown_already:
        return []
    rows: list[Row] = []
    for axis in result.axes:
        covariance = np.array(axis.covariance, dtype=float)
        believed = result.verdict != "fail" and bool(np.isfinite(covariance[:2, :2]).all())
        sigma_rad = float(np.sqrt(max(np.linalg.eigvalsh(covariance[:2, :2])[-1], 0.0))) if believed else 0.0
        point = axis.axis_point_mm
        rows.append(
            Row(
                cells=[
                    axis.name,
                    _KINDS[axis.kind],
                    direction_text(axis.axis_direction, sigma_rad),
                    plus_minus(float(np.rad2deg(sigma_rad)), "°") if believed else None,
                    None if point is None else f"({', '.join(number_text(value, 2) for value in point)})",
                    number_text(axis.direction * axis.scale, 6),
                ]
            )
        )
    columns = [
        Column(label="Axis", align="left", own=True),
        Column(label="Kind", align="left"),
        Column(label="Direction in base"),
        Column(label="Direction, ±"),
        Column(label="A point on it, in base", unit="mm"),
        Column(label="Moves by its reading times"),
    ]
    caption = message("Each as it stands in base where all axes read zero.")
    return [Table(id="axes", title="Axes", caption=caption, columns=columns, rows=rows)]
