"""LMI Gocator's CSV: sections from a name to `End`, with profiles, surfaces as y/x grids, and point clouds.

After the manual's "CSV File Format" (Tools and Native Drivers): `Profile` has x in its header and a row for each
frame and axis; `RawProfile` has rows of X and of Z; `Part` or `Surface` is a grid, with empty cells where nothing
came back; `SurfacePointCloud` lists x, y, z after each other along its lines.  All values are in millimetres.
"""

from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import NO_MATCH, Format, Match, PointKind, Reading, Settings, ending_of
from calib_core.formats.grid import GridSettings, axes_grid, grid_head
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.text_style import decode_text, number_of
from calib_core.formats.shared.text_table import parse_table
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.messages import message, plural

_OFFSET = "X Offset"  # heads the table of a point cloud
_PROFILES = ("Profile", "RawProfile", "ProfilePointCloud")
_SURFACES = ("Part", "Surface", "UniformSurface", "SurfacePointCloud", "RawSurface")
_SECTIONS = (
    "Info",
    "DeviceInfo",
    "Ranges",
    "Range",
    "Measurements",
    "Measurement",
    "Sections",
    *_PROFILES,
    *_SURFACES,
)
_EXAMPLE = "a Gocator CSV file"


class GocatorSettings(Settings):
    """As `Settings`; `frame` is the recorded frame that is meant, by its number, `source` the sensor."""

    frame: Annotated[int, Field(ge=0)] | None = None
    source: Annotated[int, Field(ge=0)] | None = None


@dataclass(frozen=True)
class _Section:
    name: str
    lines: list[str]
    first_line: int


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is a Gocator's: by its first lines."""
    if ending_of(name) not in FORMAT.endings or b"\0" in data[:2]:
        return NO_MATCH
    head = data[:4000].lstrip(b"\xef\xbb\xbf")
    bare = (line.strip().strip(b",;").strip() for line in head.split(b"\n"))
    begins = next((line for line in bare if line), b"").decode("latin-1")
    if begins in _SECTIONS and (begins != "Info" or b"CSV Version" in head):
        return Match(0.95, message("begins with the section {name}", name=begins))
    return NO_MATCH


def read(data: bytes, name: str, settings: GocatorSettings, kind: PointKind | None) -> Reading:
    """Return the points of the section that is needed; raises InputError with the line at fault."""
    sections = _sections(decode_text(data, name, _EXAMPLE), name)
    held = [section for section in sections if section.name in (*_PROFILES, *_SURFACES)]
    fitting = [s for s in held if kind is None or (s.name in _PROFILES) == (kind == "profile")] or held
    if not fitting:
        found = ", ".join(section.name for section in sections) or "none"
        need = message("a section Profile, RawProfile, Part, Surface or SurfacePointCloud")
        to_do = "Export the scan data, not measurements alone."
        raise InputError(need, "the sections {found}", to_do, name, found=found)
    section = fitting[0]
    if section.name in _PROFILES:
        reading = _profile(section, name, settings, kind)
    elif _OFFSET in "".join(section.lines[:1]) and "PointCloud" in section.name:
        reading = _point_cloud(section, name, settings)
    else:
        reading = _surface(section, name, settings)
    return reading if reading.unit_from == "settings" else replace(reading, unit_from="format")


def _sections(text: str, where: str) -> list[_Section]:
    found: list[_Section] = []
    name, lines, first = "", list[str](), 0
    for number, line in enumerate(text.split("\n"), start=1):
        word = line.strip().strip(",;").strip()
        if not name and word in _SECTIONS:
            name, lines, first = word, [], number + 1
        elif name and word == "End":
            found.append(_Section(name, lines, first))
            name = ""
        elif name:
            lines.append(line)
    if name:
        to_do = "Copy or export it again."
        raise InputError("the line 'End' of the section {name}", "the end of the file", to_do, where, name=name)
    return found


def _profile(section: _Section, where: str, settings: GocatorSettings, kind: PointKind | None) -> Reading:
    place = next((k for k, line in enumerate(section.lines) if "Axis" in _fields(line)), None)
    if place is None:
        need = "a column named Axis in the section {section}"
        raise InputError(need, "none", "Copy or export it again.", where, section=section.name)
    header = _fields(section.lines[place])
    rows = _rows(section, place, header, where)
    rows = _of(rows, "Source", settings.source, where)
    frames = sorted({row["Frame"] for row in rows})
    if kind != "cloud" or settings.frame is not None:
        rows = _of(rows, "Frame", settings.frame, where)
        points = _frame_points(rows, header, section, where)
        columns = [Column("x", 0, "X", None), Column("z", 2, "Z", None)]
        if kind == "cloud":
            columns.insert(1, Column("y", 1, "Y", None))
        return points_of(points, columns, "cloud" if kind == "cloud" else "profile", where, settings)
    blocks = [_frame_points([r for r in rows if r["Frame"] == f], header, section, where) for f in frames]
    axes = [Column("x", 0, "X", None), Column("y", 1, "Y", None), Column("z", 2, "Z", None)]
    points = np.concatenate(blocks)
    reading = points_of(points, axes, kind, where, settings)
    return replace(reading, grid=(len(frames), len(blocks[0]))) if len(frames) > 1 else reading


def _rows(section: _Section, place: int, header: list[str], where: str) -> list[dict[str, Any]]:
    """Return frame, source, y, axis and values of each row, with its line."""
    axis_at = header.index("Axis")
    rows: list[dict[str, Any]] = []
    for number, line in enumerate(section.lines[place + 1 :], start=section.first_line + place + 1):
        if not line.strip():
            continue
        fields = _fields(line)
        if len(fields) > len(header) and not any(fields[len(header) :]):
            fields = fields[: len(header)]
        if len(fields) != len(header):
            raise InputError(
                plural(
                    "{count} field in line {number}",
                    "{count} fields in line {number}",
                    by="count",
                    count=len(header),
                    number=number,
                ),
                f"{len(fields)}",
                "Copy or export it again.",
                where,
            )
        row: dict[str, Any] = {"line": number, "Axis": fields[axis_at], "values": fields[axis_at + 1 :]}
        for named in ("Frame", "Source", "Y"):
            text = fields[header.index(named)] if named in header[:axis_at] else "0"
            value = number_of(text)
            if value is None:
                got = message("{word} in line {number}", word=repr(text), number=number)
                raise InputError("a number under {named}", got, "Correct it.", where, named=named)
            row[named] = value
        rows.append(row)
    return rows


def _of(rows: list[dict[str, Any]], named: str, wanted: int | None, where: str) -> list[dict[str, Any]]:
    """Return the rows of one frame or sensor; raises InputError where several are there and none is named."""
    there = sorted({int(row[named]) for row in rows})
    if wanted is None and len(there) > 1:
        listed = f"{len(there)}: {there[0]}–{there[-1]}"
        to_do = message("Give the setting {named}, or export one alone.", named=named.lower())
        raise InputError("one {named} in a capture's file", listed, to_do, where, named=named.lower())
    if wanted is not None and wanted not in there:
        listed = ", ".join(map(str, there[:20])) or message("none")
        raise InputError(f"{named.lower()} {wanted}", "only {known}", "Name one of these.", where, known=listed)
    return [row for row in rows if wanted is None or int(row[named]) == wanted]


def _frame_points(rows: list[dict[str, Any]], header: list[str], section: _Section, where: str) -> FloatArray:
    """Return x, y and z (N, 3) of one frame."""
    by_axis = {row["Axis"]: row for row in rows}
    if "Z" not in by_axis:
        to_do = "Export the ranges, not intensities alone."
        raise InputError("a row with Axis Z for the frame", "none", to_do, where)
    z = _numbers(by_axis["Z"]["values"], by_axis["Z"]["line"], where)
    if "X" in by_axis:
        x = _numbers(by_axis["X"]["values"], by_axis["X"]["line"], where)
    else:
        x = _numbers(header[header.index("Axis") + 1 :], section.first_line, where)
        if np.isnan(x).any() or (np.diff(x) == 0).any():
            to_do = "Copy or export it again."
            raise InputError("x positions behind Axis in the header", "something else", to_do, where)
    return np.column_stack([x, np.full(len(z), by_axis["Z"]["Y"]), z])


def _numbers(fields: list[str], line: int, where: str) -> FloatArray:
    found = [np.nan if not field or field.lower() == "nan" else number_of(field) for field in fields]
    bad = next((field for field, number in zip(fields, found, strict=True) if number is None), None)
    if bad is not None:
        got = message("{word} in line {number}", word=repr(bad[:40]), number=line)
        raise InputError("numbers", got, "Correct this line.", where)
    return np.array(found, dtype=float)


def _surface(section: _Section, where: str, settings: GocatorSettings) -> Reading:
    lines = section.lines[2:]  # behind the attributes
    head = grid_head(lines)
    if head is None:
        to_do = "Copy or export it again."
        raise InputError("a line of x values in the section {section}", "none", to_do, where, section=section.name)
    first = section.first_line + 2 + head.place + 1
    table = parse_table("\n".join(lines[head.place + 1 :]), where, _EXAMPLE, first)
    told = Settings(unit=settings.unit)
    grid = GridSettings(missing=settings.missing)
    return axes_grid(head, table.values, table.first_line, grid, told, where)


def _point_cloud(section: _Section, where: str, settings: GocatorSettings) -> Reading:
    """Return the points behind two lines of attributes and a header that says nothing."""
    table = parse_table("\n".join(section.lines[3:]), where, _EXAMPLE, section.first_line + 3)
    rows, width = table.values.shape
    if width % 3:
        to_do = "Copy or export it again."
        raise InputError("x, y, z after each other in a line", "{width} values", to_do, where, width=width)
    axes = [Column(axis, place, axis.upper(), None) for place, axis in enumerate("xyz")]
    reading = points_of(table.values.reshape(-1, 3), axes, "cloud", where, settings)
    return replace(reading, grid=(rows, width // 3)) if min(rows, width // 3) > 1 else reading


def _fields(line: str) -> list[str]:
    separator = ";" if line.count(";") > line.count(",") else ","
    return [field.strip() for field in line.split(separator)]


FORMAT = Format(
    name="gocator",
    title="LMI Gocator CSV",
    endings=(".csv", ".txt"),
    kinds=("profile", "cloud"),
    recognise=recognise,
    read=read,
    settings=GocatorSettings,
)
