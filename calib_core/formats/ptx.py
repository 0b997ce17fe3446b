"""PTX: scans one behind the other, each with its grid and pose; metres, in the scanner's own frame."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.text_style import decode_text
from calib_core.formats.shared.text_table import parse_table
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.messages import message

_EXAMPLE = "x y z intensity"
_HEAD = 10  # columns, rows, position, three axes, four rows of a matrix
_WIDTHS = [1, 1, 3, 3, 3, 3, 4, 4, 4, 4]
_MOST_POINTS = 50_000_000


class PtxSettings(Settings):
    """As `Settings`; `scan` is the scan that is meant, from 0, where the file holds several."""

    scan: Annotated[int, Field(ge=0)] | None = None


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is PTX: ten lines of so many numbers."""
    lines = data[:2000].split(b"\n")[:_HEAD]
    if [len(line.split()) for line in lines] == _WIDTHS and lines[0].strip().isdigit():
        return Match(0.9, "begins with a grid and a pose")
    return by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: PtxSettings, kind: PointKind | None) -> Reading:
    """Return the points of one scan, column by column, in its scanner's frame; raises InputError."""
    scans = list(_scans(decode_text(data, name, _EXAMPLE), name))
    chosen = settings.scan if settings.scan is not None else 0
    if chosen >= len(scans) or (len(scans) > 1 and settings.scan is None):
        got = message("{scans} scans", scans=len(scans))
        raise InputError("one scan", got, "Give the setting scan, from 0, or export one alone.", name)
    head, rows, first_line = scans[chosen]
    values = parse_table("\n".join(rows), name, _EXAMPLE, first_line).values
    values, bright = values[:, :3], values[:, 3] if values.shape[1] > 3 else None
    values[~values.any(axis=1)] = np.nan
    columns = [Column(axis, place, axis, "m") for place, axis in enumerate("xyz")]
    reading = points_of(values, columns, kind, name, settings).with_intensity(bright)
    notes = ["The scan's pose in the file is not applied: points are in its scanner's frame."]
    grid = (int(head[0][0]), int(head[1][0]))
    told = replace(reading, unit_from="settings" if settings.unit else "format").adding(notes)
    return replace(told, grid=grid) if min(grid) > 1 and reading.kind == "cloud" else told


def scan_poses(data: bytes, name: str) -> list[list[float] | None]:
    """Return each scan's pose as rows of a 4×4 in mm; raises InputError as `read`."""
    poses: list[list[float] | None] = []
    for head, _, _ in _scans(decode_text(data, name, _EXAMPLE), name):
        pose: FloatArray = np.array(head[6:10]).T  # its points are rows, multiplied from the left
        pose[:3, 3] *= 1000
        poses.append(pose.ravel().tolist())
    return poses


def _scans(text: str, where: str) -> Iterator[tuple[list[list[float]], list[str], int]]:
    """Give each scan's head, the lines of its points, and the number of the first of these."""
    lines = text.rstrip().split("\n")
    at = 0
    while at < len(lines):
        head = [_numbers(line) for line in lines[at : at + _HEAD]]
        if [len(row) for row in head] != _WIDTHS or head[0][0] * head[1][0] > _MOST_POINTS:
            got = message("something else in line {number}", number=at + 1)
            raise InputError("a head of {lines} lines with grid and pose", got, _TO_DO, where, lines=_HEAD)
        count, first = int(head[0][0]) * int(head[1][0]), at + _HEAD
        if not 0 < count <= len(lines) - first:
            got = message("{count} lines", count=len(lines) - first)
            raise InputError("{wanted} points, as its grid says", got, _TO_DO, where, wanted=count)
        yield head, lines[first : first + count], first + 1
        at = first + count


_TO_DO = message("Copy or export it again.")


def _numbers(line: str) -> list[float]:
    try:
        return [float(word) for word in line.split()]
    except ValueError:
        return []


FORMAT = Format(
    name="ptx",
    title="PTX",
    endings=(".ptx",),
    kinds=("cloud",),
    recognise=recognise,
    read=read,
    settings=PtxSettings,
    scan_poses=scan_poses,
)
