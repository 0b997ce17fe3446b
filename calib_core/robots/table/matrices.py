"""Matrices with no word about them: 4 × 4 numbers a pose, in four lines or in one, as nothing else is."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.text_style import number_of
from calib_core.robots.controller_file import Found, Taught
from calib_core.robots.table.units import scale_of

_MARKS = str.maketrans("[](),;", " " * 6)
_RIGID = 1e-3


@dataclass(frozen=True)
class _Rows:
    """Rows of as many numbers each: their lines, the names before them, the numbers."""

    lines: list[int]
    names: list[str]
    numbers: list[list[float]]


def are_matrices(text: str) -> bool:
    """Return whether a text begins with a matrix of a pose, and nothing but names stand beside its numbers."""
    rows = _rows(text, most=4)
    return rows is not None and _matrices(rows) is not None


def find(text: str, name: str, unit: str | None) -> Found:
    """Return the poses of a text of matrices; raises InputError where one is none, or its unit is open."""
    found = Found(name)
    rows = _rows(text)
    matrices = None if rows is None else _matrices(rows)
    if rows is None or matrices is None:
        to_do = "Copy or export it again."
        raise InputError(
            "matrices of poses, in lines of 4, 12 or 16 numbers", "other lines among them", to_do, name
        )
    scale = scale_of("matrix", unit or "", matrices[:, :3, 3].tolist(), name)
    matrices[:, :3, 3] *= scale.factor
    step = len(rows.lines) // len(matrices)
    for matrix, line, label in zip(matrices, rows.lines[::step], rows.names[::step], strict=True):
        numbers = tuple(matrix.ravel().tolist())
        found.poses.append(Taught(label or f"line {line}", numbers, "matrix", line, file=name, doubt=scale.doubt))
    return found


def _rows(text: str, most: int | None = None) -> _Rows | None:
    """Return the rows of numbers, the first `most`; a name may stand before them, or in a line of its own."""
    found, name = _Rows([], [], []), ""
    for line, content in enumerate(text.splitlines(), start=1):
        words = content.translate(_MARKS).split()
        if not words or content.lstrip().startswith("#"):
            continue
        if len(words) == 1 and number_of(words[0]) is None:
            name = words[0]
            continue
        if number_of(words[0]) is None:
            name = words.pop(0)
        numbers = [number_of(word) for word in words]
        if len(numbers) not in (4, 12, 16) or None in numbers:
            return None
        found.lines.append(line)
        found.names.append(name)
        found.numbers.append([value for value in numbers if value is not None])
        name = ""
        if len(found.lines) == most:
            break
    return found if found.lines and len(set(map(len, found.numbers))) == 1 else None


def _matrices(rows: _Rows) -> np.ndarray | None:
    """Return rows as matrices (N, 4, 4), None where they are not those of rigid motions."""
    values = np.array(rows.numbers)
    if values.shape[1] == 12:
        values = np.hstack([values, np.tile([0.0, 0.0, 0.0, 1.0], (len(values), 1))])
    if values.size % 16:
        return None
    matrices = values.reshape(-1, 4, 4)
    turned = matrices[:, :3, :3]
    rigid = np.abs(turned @ turned.swapaxes(1, 2) - np.eye(3)).max() < _RIGID and np.linalg.det(turned).min() > 0
    return matrices if rigid and np.abs(matrices[:, 3] - [0, 0, 0, 1]).max() < _RIGID else None
