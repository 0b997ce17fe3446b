"""A laser tracker's list of points as text: names, x, y, z, and how far to trust them where it says so."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from calib_core.errors import InputError
from calib_core.formats.format import MM_PER_UNIT, Unit
from calib_core.formats.shared.names import axis_of, unit_in, unit_of
from calib_core.formats.shared.text_head import is_comment, shown_line
from calib_core.formats.shared.text_style import NUMBER, style_of
from calib_core.messages import message
from calib_core.robots.text import decoded

_TOLD = re.compile(r"spatial ?analyzer|\b(?:laser)?tracker\b", re.IGNORECASE)
_BY_PLACE = re.compile(r"spatial ?analyzer|\w::\w", re.IGNORECASE)
HINT = re.compile(r"spatial ?analyzer|tracker|\w::\w|95", re.IGNORECASE)
"""A text without this in its beginning is no tracker's."""

_PATH = "::"  # between collection, group and target
_MOST_POINTS = 5000  # more are a surface that was scanned
_HEADER_WITHIN = 200
_BEGINNING = 65_536
_NAMES = {"name", "point", "pointname", "pointid", "target", "targetname", "id", "pointno", "punkt", "punktname"}
_TURNS = {"a", "b", "c", "w", "p", "r", "rx", "ry", "rz", "qx", "qy", "qz", "qw", "q1", "roll", "pitch", "yaw"}
_UNIT_END = "(?:mm|um|m|in)?"
_OF_95 = re.compile(rf"[xyz]?u(?:nc|ncertainty)?[xyz]?95[xyz]?{_UNIT_END}")
_OF_SIGMA = re.compile(rf"[xyz]?(?:sigma|std|stddev|stdev)[xyz]?{_UNIT_END}")
COVERAGE = 1.96
"""An expanded uncertainty of 95 % of one axis, in standard deviations."""


@dataclass(frozen=True)
class Center:
    """One point, in mm once the unit is known."""

    name: str
    line: int
    center_mm: tuple[float, float, float]


@dataclass(frozen=True)
class Centers:
    """The points of a file; no unit where neither the file nor anybody says it, no sigma where it has none."""

    points: tuple[Center, ...]
    unit: str | None
    sigma_mm: float | None


@dataclass(frozen=True)
class _Columns:
    """Places of x, y and z, of the name, and of spreads with their factor to one sigma; units by place."""

    xyz: tuple[int, int, int]
    name: int | None
    spreads: tuple[tuple[int, float], ...]
    units: tuple[Unit | None, ...]


def centers_in(text: str, where: str, told: Unit | None = None) -> Centers | None:
    """Return the points of a laser tracker, None where a text is not one's.

    What tells: a column of U95, the tracker or SpatialAnalyzer named above, targets as collection::group::target.

    Parameters
    ----------
    text : str
    where : str
        The file's name, for messages.
    told : str, optional
        The unit where the file does not state one.

    Raises
    ------
    InputError
        With the line that is at fault.
    """
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
    found = _header(lines)
    if found is None and not _BY_PLACE.search(text):
        return None
    at, columns = found or (_first_row(lines), None)
    above = [line for _, line in lines[:at]]
    rows = [(n, line) for n, line in lines[at:] if not is_comment(line)]
    of_95 = columns is not None and any(factor < 1 for _, factor in columns.spreads)
    named = any(map((_TOLD if columns else _BY_PLACE).search, above)) or all(_PATH in line for _, line in rows)
    if not (of_95 or named) or not 0 < len(rows) <= _MOST_POINTS:
        return None
    given = [(n, _fields(line)) for n, line in rows]
    columns = columns or _by_place(given, where)
    stated = unit_in(above) or told
    units: list[Unit | None] = [unit or stated for unit in columns.units]
    points: list[Center] = []
    squares: list[float] = []
    for (line, text), (_, fields) in zip(rows, given, strict=True):
        if len(fields) != len(units):
            raise InputError(
                "{width} columns in every line",
                "{count} in line {number}: {line}",
                "If the file was cut off, copy it again; otherwise correct this line.",
                where,
                width=len(units),
                count=len(fields),
                number=line,
                line=shown_line(text),
            )
        x, y, z = (_value(fields[place], units[place], line, where) for place in columns.xyz)
        name = "" if columns.name is None else fields[columns.name].rpartition(_PATH)[2]
        points.append(Center(name or f"point-{len(points) + 1}", line, (x, y, z)))
        spreads = [(k, factor) for k, factor in columns.spreads if fields[k]]
        squares += [(_value(fields[k], units[k], line, where) * factor) ** 2 for k, factor in spreads]
    of_axes = {units[place] for place in columns.xyz}
    unit = None if None in of_axes else ", ".join(sorted(filter(None, of_axes)))
    sigma = math.sqrt(sum(squares) / len(squares)) if squares else 0.0
    return Centers(tuple(points), unit, sigma or None)


def file_of_tracker(files: Mapping[str, bytes]) -> str | None:
    """Return the first file that holds a laser tracker's points, None where none does."""
    for name, data in files.items():
        try:
            text = decoded(data)
            if HINT.search(text[:_BEGINNING]) and centers_in(text, name) is not None:
                return name
        except InputError:
            continue
    return None


def _header(lines: Sequence[tuple[int, str]]) -> tuple[int, _Columns] | None:
    """Return where the rows begin below the line that names x, y and z, and its columns; None where none does."""
    for at, (_, line) in enumerate(lines[:_HEADER_WITHIN]):
        names = _fields(re.sub(r"\s+(?=[\[(])", "", line.lstrip("/#% ")))
        axes = [axis_of(name) for name in names]
        plain = [re.sub(r"[\[(].*|[^a-z0-9]", "", name.lower()) for name in names]
        if any([axis for axis, _ in axes].count(wanted) != 1 for wanted in "xyz") or _TURNS & set(plain):
            continue
        below = _fields(lines[at + 1][1].lstrip("/#% ")) if at + 1 < len(lines) else []
        under: list[Unit | None] = [unit_of(field) for field in below]
        if len(under) != len(names):
            under = [None] * len(names)
        x, y, z = ([axis for axis, _ in axes].index(wanted) for wanted in "xyz")
        before = min(x, y, z) - 1
        name = next((k for k, word in enumerate(plain) if word in _NAMES), before if before >= 0 else None)
        spreads = [(k, 1 / COVERAGE) for k, word in enumerate(plain) if _OF_95.fullmatch(word)]
        if len(spreads) > 3:  # of each axis, and of the point beside them
            spreads = [one for one in spreads if re.search("[xyz]", plain[one[0]])]
        spreads = spreads or [(k, 1.0) for k, word in enumerate(plain) if _OF_SIGMA.fullmatch(word)]
        of_axes = axes[x][1] or under[x]
        own: list[Unit | None] = [unit or below for (_, unit), below in zip(axes, under, strict=True)]
        units: list[Unit | None] = [
            unit or (of_axes if k not in (x, y, z) else None) for k, unit in enumerate(own)
        ]
        return at + (2 if under[x] else 1), _Columns((x, y, z), name, tuple(spreads), tuple(units))
    return None


def _first_row(lines: Sequence[tuple[int, str]]) -> int:
    rows = (at for at, (_, line) in enumerate(lines) if not is_comment(line) and _ends_in_numbers(_fields(line)))
    return next(rows, len(lines))


def _by_place(rows: Sequence[tuple[int, Sequence[str]]], where: str) -> _Columns:
    """Return columns that nobody named: up to three names, then x, y, z and nothing else; raises InputError."""
    for line, fields in rows:
        names = fields[:-3]
        fine = 0 < len(names) <= 3 and not any("." in name and NUMBER.match(name) for name in names)
        if not fine or NUMBER.match(names[0]) or not _ends_in_numbers(fields):
            to_do = message("Name the columns in a header line, as in Point, X [mm], Y [mm], Z [mm], U95 [mm].")
            raise InputError("a target's name, then x, y, z alone", "line {number}", to_do, where, number=line)
    width = len(rows[0][1])
    return _Columns((width - 3, width - 2, width - 1), width - 4, (), (None,) * width)


def _ends_in_numbers(fields: Sequence[str]) -> bool:
    return len(fields) > 3 and all(map(NUMBER.match, fields[-3:]))


def _fields(line: str) -> list[str]:
    fields = [field.strip() for field in style_of(line).fields(line)]
    while fields and not fields[-1]:  # rows that end in a separator
        fields.pop()
    return fields


def _value(field: str, unit: Unit | None, line: int, where: str) -> float:
    if not NUMBER.match(field):
        need = "numbers ({example})"
        to_do = "Correct this line."
        raise InputError(
            need, "{word} in line {number}", to_do, where, example="x,y,z", word=shown_line(field), number=line
        )
    return float(field) * (1.0 if unit is None else MM_PER_UNIT[unit])
