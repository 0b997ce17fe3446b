"""The grid of a range scan in PLY, as Stanford's and Cyberware's scanners have it: one vertex a cell, or none."""

import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib_core.formats.shared.fields import wrong
from calib_core.messages import message

_SIDE = re.compile(r"num_(rows|cols) (\d{1,6})")
ELEMENT = "range_grid"


def grid_size(comments: Sequence[str], cells: int) -> tuple[int, int] | None:
    """Return rows and columns as a header's comments tell them; None where they are no grid of so many cells."""
    found = {match[1]: int(match[2]) for match in map(_SIDE.fullmatch, comments) if match}
    rows, columns = found.get("rows", 0), found.get("cols", 0)
    return (rows, columns) if min(rows, columns) > 1 and rows * columns == cells else None


def vertices_of_cells(
    body: bytes, cells: int, count: np.dtype[np.integer], number: np.dtype[np.integer] | None, name: str
) -> NDArray[np.int64]:
    """Return the vertex of each cell, −1 of an empty one; `number` is None in text.

    Raises
    ------
    InputError
        If a cell has more than one vertex, or the file is cut off.
    """
    found = _of_text(body, cells) if number is None else _of_records(body, cells, count, number)
    if found is None:
        raise wrong(name, "PLY", message("a range_grid that is cut off, or has cells of several vertices"))
    return found


def _of_text(body: bytes, cells: int) -> NDArray[np.int64] | None:
    rows = [line.split() for line in body.split(b"\n", cells)[:cells]]
    if len(rows) != cells or not all(row == [b"0"] or (len(row) == 2 and row[0] == b"1") for row in rows):
        return None
    numbers = [row[-1] if len(row) == 2 else b"-1" for row in rows]
    return np.array([int(one) if one.isdigit() else -1 for one in numbers], np.int64)


def _of_records(
    body: bytes, cells: int, count: np.dtype[np.integer], number: np.dtype[np.integer]
) -> NDArray[np.int64] | None:
    places, at = np.full(cells, -1), 0
    one = np.array(1, count).tobytes()
    none = bytes(count.itemsize)
    for cell in range(cells):
        told = body[at : at + count.itemsize]
        at += count.itemsize
        if told == one:
            places[cell] = at
            at += number.itemsize
        elif told != none:
            return None
    if at > len(body):
        return None
    seen = places >= 0
    wide = np.frombuffer(body, np.uint8)[places[seen, None] + np.arange(number.itemsize)]
    places[seen] = np.ascontiguousarray(wide).view(number).ravel()
    return places
