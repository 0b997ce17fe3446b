"""Columns that nobody named: which they are by their place, and what is to be asked about them."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import PointKind, Unit
from calib_core.frames import FloatArray
from calib_core.messages import message

_COUNTED = 10  # rows that count up are no chance
_RISES = 4  # rows of whole numbers that rise where others are none
_BRIGHTEST = 65_535
_ROUNDED = 1e-3


@dataclass(frozen=True)
class Column:
    """One column that is used: its axis, its place from 0, its name for messages, its unit where it is stated."""

    axis: str
    place: int
    name: str
    unit: Unit | None


@dataclass(frozen=True)
class Unnamed:
    """The columns that are taken, what a reader should know of the choice, and what makes it doubtful."""

    columns: list[Column]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()


def by_place(
    values: FloatArray, kind: PointKind | None, plain: PointKind | None, where: str, first_line: int
) -> Unnamed:
    """Return x and z, or x, y and z, of columns that nobody named; one of a single number is no z.

    A first column that counts up is an index.  Columns that are left over and are no brightness, color or normal
    leave a doubt: the points may stand in them.  So does one that is taken and may be an index.

    Parameters
    ----------
    values : (N, C)
    kind : "profile" or "cloud", optional
        What is needed.
    plain : "profile" or "cloud", optional
        What three or more columns are where nobody says what is needed.
    where : str
    first_line : int
        The number of the first row's line.

    Raises
    ------
    InputError
        If there are fewer columns than are needed, or far more.
    """
    width = values.shape[1]
    kind = kind or ("profile" if width == 2 else plain or "cloud")
    if kind == "profile" and width == 3 and _stands(values[:, 1]) and not _stands(values[:, 2]):
        # Any other number than 0 may be a brightness, and x and z its neighbours in either order.
        in_plane = np.nanmax(np.abs(values[:, 1])) == 0
        columns = _columns("xyz", 0)
        return Unnamed(columns, doubts=() if in_plane else (_taken(width, [columns[0], columns[2]]),))
    axes = "xz" if kind == "profile" else "xyz"
    counts = width > 1 and _counts_up(values[:, 0])
    is_index = counts and width > len(axes) and not _is_whole(values[:, len(axes)])
    first = 1 if is_index else 0
    _require_width(width - first, kind, width, where, first_line)
    columns = _columns(axes, first)
    taken, left = values[:, first : first + len(axes)], values[:, first + len(axes) :]
    notes: list[str] = []
    doubts: list[str] = []
    if is_index:
        notes.append(message("Column 1 counts up: it is an index and no coordinate."))
    elif counts:
        doubts.append(message("Column 1 counts up by one and may be an index; it was taken for x."))
    doubts += [
        message(
            "{name} holds whole numbers that rise and may be an index; it was taken for {axis}.",
            name=one.name,
            axis=one.axis,
        )
        for one in columns
        if not (counts and one.place == 0) and _may_be_index(values, one.place, columns)
    ]
    if len(axes) == 2 and _rises(taken[:, 1]) and not _rises(taken[:, 0]):
        doubts.append(
            message(
                "{z} rises or falls from row to row as x does, and {x} does not: they may be z and x.",
                z=columns[1].name,
                x=columns[0].name,
            )
        )
    if left.shape[1] and not _says_no_place(left, taken):
        doubts.append(_taken(width, columns))
    return Unnamed(columns, tuple(notes), tuple(doubts))


def _taken(width: int, columns: list[Column]) -> str:
    return message(
        "{width} columns have no names; taken are {taken}. If others are meant, name them by the setting "
        "'columns'.",
        width=width,
        taken=[message("{axis} = {name}", axis=one.axis, name=one.name) for one in columns],
    )


def _columns(axes: str, first: int) -> list[Column]:
    return [
        Column(axis, place, message("column {place}", place=place + 1), None)
        for place, axis in enumerate(axes, start=first)
    ]


def _require_width(width: int, kind: PointKind, in_line: int, where: str, first_line: int) -> None:
    least, most = (2, 3) if kind == "profile" else (3, 12)
    if not least <= width <= most:
        raise InputError(
            "2 or 3 columns a line (x_mm,z_mm)" if kind == "profile" else "3 to 12 columns a line (x,y,z)",
            "{word} in line {number}",
            "Write one point a line, or name the columns in a header line.",
            where,
            word=in_line,
            number=first_line,
        )


def _stands(column: FloatArray) -> bool:
    """Return whether a column holds one number alone, again and again."""
    finite = column[np.isfinite(column)]
    return len(finite) > 2 and np.ptp(finite) == 0


def _rises(column: FloatArray) -> bool:
    """Return whether a column's numbers rise, or fall, from row to row."""
    steps = np.diff(column[np.isfinite(column)])
    return len(steps) >= _COUNTED and bool((steps > 0).all() or (steps < 0).all())


def _counts_up(column: FloatArray) -> bool:
    """Return whether a column is 0, 1, 2 … or 1, 2, 3 … from its first row to its last."""
    return len(column) >= _COUNTED and column[0] in (0, 1) and bool((np.diff(column) == 1).all())


def _may_be_index(values: FloatArray, place: int, columns: list[Column]) -> bool:
    """Return whether a column is whole numbers from 0 on that rise with every row, and the others taken are not.

    Of a profile's two columns x rises too: whole numbers there are an index where some are left out.
    """
    is_x = len(columns) == 2 and place == columns[0].place
    column, others = values[:, place], [values[:, one.place] for one in columns if one.place != place]
    steps = np.diff(column)
    if len(column) < _RISES or not _is_whole(column) or not (column >= 0).all() or not (steps > 0).all():
        return False
    return not any(map(_is_whole, others)) and (not is_x or bool(np.ptp(steps) > 0))


def _is_whole(values: FloatArray) -> bool:
    finite = values[np.isfinite(values)]
    return bool((finite == np.round(finite)).all())


def _says_no_place(left: FloatArray, taken: FloatArray) -> bool:
    """Return whether columns that are left over hold brightness, colors or normals, and the taken ones do not."""
    if _is_whole(taken):
        return False
    if left.shape[1] >= 3 and taken.shape[1] == 3:
        lengths = np.linalg.norm(left[:, :3], axis=1)
        if np.nanmax(np.abs(lengths - 1), initial=0) < _ROUNDED:
            return left.shape[1] == 3 or _is_brightness(left[:, 3:])
    shares = taken.shape[1] == 3 and bool((np.nan_to_num(left) >= 0).all() and (np.nan_to_num(left) <= 1).all())
    return _is_brightness(left) or shares


def _is_brightness(left: FloatArray) -> bool:
    return _is_whole(left) and bool((np.abs(np.nan_to_num(left)) <= _BRIGHTEST).all())
