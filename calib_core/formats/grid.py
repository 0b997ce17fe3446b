"""Text grids of heights: x in the first row and y in the first column, or heights alone with pitches told."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import NO_MATCH, Format, Match, PointKind, Reading, Settings, ending_of
from calib_core.formats.shared.heights import HeightSettings, grid_of, grid_with_axes
from calib_core.formats.shared.names import axis_of, unit_in, unit_within
from calib_core.formats.shared.text_style import (
    Style,
    decode_text,
    first_lines,
    looks_like_text,
    number_of,
    style_of,
)
from calib_core.formats.shared.text_table import parse_table
from calib_core.frames import FloatArray

_EXAMPLE = "y in the first column, x in the first line"
_LEAST_COLUMNS = 5
_HEAD_BYTES = 4000
_MOST_POINT_COLUMNS = 12  # a wider table without names is a grid


class GridSettings(HeightSettings):
    """As `HeightSettings`; `x_along` says whether x runs along the lines of the file or down its columns."""

    x_along: Literal["lines", "columns"] = "lines"


@dataclass(frozen=True, eq=False)
class GridHead:
    """The line of a grid's x: its place from 0, the numbers, what stands in the corner, how fields are written."""

    place: int
    x: FloatArray
    corner: str
    style: Style


def grid_head(lines: list[str]) -> GridHead | None:
    """Return the line that holds a grid's x: numbers that rise or fall, behind a corner that is none."""
    for place, line in enumerate(lines):
        style = style_of(line)
        if style.separator is None:
            continue
        fields = [field.strip() for field in style.fields(line)]
        while fields and not fields[-1]:
            fields.pop()
        if _names_axes(fields) or (len(fields) > 1 and number_of(fields[0]) is not None):
            return None
        if len(fields) < _LEAST_COLUMNS or fields[0].lower() == "nan":
            continue
        numbers = [number_of(field) for field in fields[1:]]
        if all(number is not None for number in numbers):
            x = np.array(numbers, dtype=float)
            steps = np.diff(x)
            if (steps > 0).all() or (steps < 0).all():
                return GridHead(place, x, fields[0], style)
    return None


def _names_axes(fields: list[str]) -> bool:
    """Return whether a line is the header of a table of points."""
    return len({axis_of(field)[0] for field in fields} & {"x", "z"}) == 2


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is a grid: by its first lines."""
    if ending_of(name) not in FORMAT.endings or not looks_like_text(data):
        return NO_MATCH
    head = data[:_HEAD_BYTES] if b"\n" in data[:_HEAD_BYTES] else data[: 50 * _HEAD_BYTES]
    lines = first_lines(decode_text(head, name, _EXAMPLE), 30)
    if grid_head(lines) is not None:
        return Match(0.7, "its first line counts along x")
    widths = {len(style_of(line).fields(line)) for line in lines[:-1] if line.strip()}
    wide = len(widths) == 1 and widths.pop() > _MOST_POINT_COLUMNS
    return Match(0.25, "is too wide for points") if wide else NO_MATCH


def read(data: bytes, name: str, settings: GridSettings, kind: PointKind | None) -> Reading:
    """Return the points of a grid; raises InputError with the line at fault, or where a pitch is not known."""
    text = decode_text(data, name, _EXAMPLE)
    lines = first_lines(text)
    head = grid_head(lines)
    if head is None:
        values = parse_table(text, name, _EXAMPLE).values
        return grid_of(values if settings.x_along == "lines" else values.T, settings, name)
    rest = text[sum(len(line) + 1 for line in lines[: head.place + 1]) :]
    table = parse_table(rest, name, _EXAMPLE, head.place + 2)
    told = Settings(unit=settings.unit or unit_in(lines[: head.place]) or unit_within(head.corner))
    return axes_grid(head, table.values, table.first_line, settings, told, name)


def axes_grid(
    head: GridHead, values: FloatArray, first_line: int, settings: GridSettings, told: Settings, where: str
) -> Reading:
    """Return the points of rows that begin with their y; raises InputError where rows and x differ in number."""
    while values.shape[1] > len(head.x) + 1 and np.isnan(values[:, -1]).all():
        values = values[:, :-1]
    if values.shape[1] != len(head.x) + 1:
        raise InputError(
            "y and {count} heights in a line, as many as the x in line {place}",
            "{width} from line {first_line} on",
            "Copy or export it again.",
            where,
            count=len(head.x),
            place=head.place + 1,
            width=values.shape[1] - 1,
            first_line=first_line,
        )
    y, z = values[:, 0], values[:, 1:]
    bad = np.flatnonzero(~np.isfinite(y))
    if len(bad):
        line = first_line + int(bad[0])
        to_do = "Copy or export it again."
        raise InputError("y in the first column", "none in line {line}", to_do, where, line=line)
    told = told.model_copy(update={"missing": settings.missing})
    if settings.x_along == "columns":
        return grid_with_axes(y, head.x, z.T, where, told)
    return grid_with_axes(head.x, y, z, where, told)


FORMAT = Format(
    name="grid",
    title="Text grid of heights (y and x in the margins)",
    endings=(".csv", ".txt", ".tsv", ".asc", ".dat"),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=GridSettings,
)
