"""Which column is which axis, in which unit: by the header's names, by what the user says, else by place."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import MM_PER_UNIT, PointKind, Reading, Settings, Unit
from calib_core.formats.shared.missing import without_missing
from calib_core.formats.shared.names import axis_of, place_of_intensity, unit_in, unit_of
from calib_core.formats.shared.text_table import TextTable
from calib_core.formats.shared.unnamed import Column, by_place
from calib_core.frames import FloatArray
from calib_core.messages import message


class TableSettings(Settings):
    """As `Settings`; `columns` names the columns in order: x, y, z, and any word for one to be left aside."""

    columns: list[str] = Field(default_factory=list)


def reading_of(
    table: TextTable, where: str, settings: TableSettings, kind: PointKind | None, plain: PointKind | None = None
) -> Reading:
    """Return the points of a table: columns by the user's word, by their names, else by their place.

    Parameters
    ----------
    table : TextTable
    where : str
    settings : TableSettings
    kind : "profile" or "cloud", optional
        What is needed.
    plain : "profile" or "cloud", optional
        What three or more columns without names are where nobody says what is needed.

    Raises
    ------
    InputError
        If the columns do not fit; it names the one that is at fault.
    """
    _require_announced(table, where)
    values, names = _without_empty_end(table)
    width = values.shape[1]
    if settings.columns:
        columns = _told(settings.columns, width, where)
    elif names:
        columns = _by_name(names, table.units, where, table.first_line)
    else:
        chosen = by_place(values, kind, plain, where, table.first_line)
        read = points_of(values, chosen.columns, kind, where, settings, unit_in(table.preamble))
        return read.adding(chosen.notes, chosen.doubts)
    bright = place_of_intensity(settings.columns or names)
    read = points_of(values, columns, kind, where, settings, unit_in(table.preamble))
    return read if bright is None else read.with_intensity(values[:, bright])


def reading_of_values(
    values: NDArray[Any], names: Sequence[str], where: str, settings: TableSettings, kind: PointKind | None
) -> Reading:
    """Return the points of an array (N, C), columns named or by their place; raises as `reading_of`."""
    table = TextTable(values.astype(np.float64), tuple(names), (), (), 0)
    return reading_of(table, where, settings, kind, "cloud")


def points_of(
    values: FloatArray,
    columns: Sequence[Column],
    kind: PointKind | None,
    where: str,
    settings: Settings,
    stated: Unit | None = None,
) -> Reading:
    """Return a reading of chosen columns as what is needed, in mm, blanks and missing values as NaN."""
    columns, found = _for_kind(columns, values, kind, where)
    units: list[Unit | None] = [settings.unit or column.unit or stated for column in columns]
    unit_from = "settings" if settings.unit else "header" if all(units) else "assumed"
    factors = [1.0 if unit is None else MM_PER_UNIT[unit] for unit in units]
    places = [column.place for column in columns]
    points = values if places == list(range(values.shape[1])) else values[:, places]
    points, notes, doubts = without_missing(points, settings.missing, found)
    if any(factor != 1.0 for factor in factors):
        points = points * factors
    different = sorted({unit or "mm" for unit in units})
    unit = ", ".join(f"{c.axis} in {u or 'mm'}" for c, u in zip(columns, units, strict=True))
    return Reading(
        found,
        points,
        {column.axis: column.name for column in columns},
        different[0] if len(different) == 1 else unit,
        unit_from,
        notes=notes,
        doubts=doubts,
    )


def _require_announced(table: TextTable, where: str) -> None:
    """Refuse a table whose first line announces another number of points than follow: it was cut off."""
    first = table.preamble[0].strip() if table.preamble else ""
    if first.isdecimal() and int(first) != len(table.values):
        need = "the {first} points that the first line announces"
        raise InputError(need, f"{len(table.values)}", "Copy or export it again.", where, first=int(first))


def _without_empty_end(table: TextTable) -> tuple[FloatArray, tuple[str, ...]]:
    """Leave out last columns without a name and without a value: rows that end in a separator have one."""
    values, names = table.values, table.names
    while values.shape[1] > 2 and not (names and names[-1]) and np.isnan(values[:, -1]).all():
        values, names = values[:, :-1], names[:-1]
    return values, names


def _told(told: list[str], width: int, where: str) -> list[Column]:
    if len(told) != width:
        need = "a name for each of {width} columns in the setting 'columns'"
        raise InputError(need, f"{len(told)}", "Name them all; '-' for one to be left aside.", where, width=width)
    return _by_name(told, (), where, None)


def _by_name(names: Sequence[str], units: Sequence[str], where: str, header_above: int | None) -> list[Column]:
    found: list[Column] = []
    for place, name in enumerate(names):
        axis, unit = axis_of(name)
        if axis is not None:
            below = unit_of(units[place]) if place < len(units) else None
            found.append(Column(axis, place, name, unit or below))
    if not any(column.axis == "z" for column in found):
        found = [Column("z", c.place, c.name, c.unit) if c.axis == "height" else c for c in found]
    found = [column for column in found if column.axis != "height"]
    axes = [column.axis for column in found]
    twice = next((column for column in found if axes.count(column.axis) > 1), None)
    if twice is not None:
        raise _refused(
            message("{axis} columns named {twice_axis}", axis=axes.count(twice.axis), twice_axis=twice.axis),
            names,
            where,
            header_above,
        )
    lacking = [axis for axis in "xz" if axis not in axes]
    if lacking:
        got = (
            "no column named x or z"
            if len(lacking) == 2
            else message("no column named {lacking}", lacking=lacking[0])
        )
        raise _refused(got, names, where, header_above)
    return sorted(found, key=lambda column: column.axis)


def _refused(got: str, names: Sequence[str], where: str, header_above: int | None) -> InputError:
    listed = ", ".join(repr(name[:30]) for name in names[:8]) + (" …" if len(names) > 8 else "")
    in_header = message(
        "{found} in the header above line {header_above}: {listed}",
        found=got,
        header_above=header_above,
        listed=listed,
    )
    in_settings = message("{found} in the setting 'columns': {listed}", found=got, listed=listed)
    need = "columns named x and z (a profile) or x, y and z (a cloud)"
    to_do = "Name the columns in the file, or in the capture's format_settings by 'columns'."
    return InputError(need, in_settings if header_above is None else in_header, to_do, where)


def _for_kind(
    columns: Sequence[Column], values: FloatArray, kind: PointKind | None, where: str
) -> tuple[Sequence[Column], PointKind]:
    """Return the columns of what is needed; a cloud whose y is one number can be a profile.  Raises InputError."""
    has: PointKind = "cloud" if len(columns) == 3 else "profile"
    if kind in (None, has):
        return columns, has
    if kind == "profile":
        y = values[:, columns[1].place]
        y = y[np.isfinite(y)]
        if len(y) and np.ptp(y) == 0:
            return [columns[0], columns[2]], "profile"
    listed = ", ".join(column.name for column in columns)
    raise InputError(
        "a profile (x and z)" if kind == "profile" else "a cloud (x, y and z)",
        "a {has} with the columns {listed}",
        "Give the capture the kind '{has}', or export the file as a {kind}.",
        where,
        has=has,
        listed=listed,
        kind=kind,
    )
