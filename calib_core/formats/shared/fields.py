"""Fields of points by name out of a file with a header, as PLY and PCD have one, every length checked."""

from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.format import PointKind, Reading, Settings, Unit
from calib_core.formats.shared.binary_table import columns_from_records, require_count
from calib_core.formats.shared.columns import points_of
from calib_core.formats.shared.names import place_of_intensity
from calib_core.formats.shared.text_table import parse_numbers
from calib_core.formats.shared.unnamed import Column
from calib_core.frames import FloatArray
from calib_core.messages import message

_AXES = ("x", "y", "z")
_MAX_HEADER_BYTES = 64_000


@dataclass(frozen=True)
class Layout:
    """Where the points of a file are: names and numpy types of a point's fields, count, first byte, encoding."""

    names: list[str]
    types: list[str]
    count: int
    offset: int
    encoding: str

    @property
    def wanted(self) -> list[int]:
        """Which fields are read: x, y and z, and behind them an intensity where there is one."""
        bright = place_of_intensity(self.names)
        return [*(self.names.index(axis) for axis in _AXES), *([] if bright is None else [bright])]


def points_in(data: bytes, layout: Layout, where: str) -> FloatArray:
    """Return the wanted fields of the points (N, 3 or 4); raises InputError where the file is cut off."""
    if layout.encoding == "ascii":
        return _ascii_points(data, layout, where)
    record = np.dtype(list(zip(layout.names, layout.types, strict=True)))
    names = tuple(layout.names[place] for place in layout.wanted)
    return columns_from_records(data, layout.offset, layout.count, record, names, where)


def _ascii_points(data: bytes, layout: Layout, where: str) -> FloatArray:
    lines = data[layout.offset :].splitlines()
    require_count(layout.count, len(lines), where)
    body = b"\n".join(lines[: layout.count])
    table = parse_numbers(body, where, len(layout.names), " ".join(layout.names))
    require_count(layout.count, len(table), where)
    return table[:, layout.wanted]


def header_lines(data: bytes, last: bytes, where: str, format_name: str) -> tuple[list[list[str]], int]:
    """Return the words of the header's lines up to the one that begins with `last`, and where the body starts."""
    lines: list[list[str]] = []
    offset = 0
    while offset < min(len(data), _MAX_HEADER_BYTES):
        end = data.find(b"\n", offset)
        if end < 0:
            break
        line = data[offset:end].strip()
        offset = end + 1
        lines.append(line.decode("latin-1").split())
        if line.startswith(last):
            return lines, offset
    raise wrong(where, format_name, message("a header without a line {last}", last=last.decode()))


def require_axes(names: list[str], where: str, format_name: str) -> None:
    """Refuse fields of which not exactly one is x, y and z each; raises InputError."""
    if [names.count(axis) for axis in _AXES] != [1, 1, 1] or len(set(names)) != len(names):
        raise wrong(where, format_name, message("the fields {names}", names=" ".join(names) or message("(none)")))


def wrong(where: str, format_name: str, got: str) -> InputError:
    """Return the error of a file that is not what its ending says."""
    to_do = "Copy or export it again."
    return InputError("a {format_name} file of points x y z", got, to_do, where, format_name=format_name)


def reading_of_fields(
    points: FloatArray, where: str, settings: Settings, kind: PointKind | None, unit: Unit | None = None
) -> Reading:
    """Return the reading of fields named x, y and z, and of an intensity behind them (N, 3 or 4)."""
    columns = [Column(axis, place, axis, unit) for place, axis in enumerate(_AXES)]
    bright = points[:, 3] if points.shape[1] > 3 else None
    return points_of(points[:, :3], columns, kind, where, settings).with_intensity(bright)
