"""PCD, the Point Cloud Library's format: ascii, binary and binary_compressed; written binary."""

import math
import re
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from calib_core.errors import InputError
from calib_core.formats.format import Format, Match, Pieces, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared.binary_table import require_count
from calib_core.formats.shared.fields import (
    Layout,
    header_lines,
    points_in,
    reading_of_fields,
    require_axes,
    wrong,
)
from calib_core.formats.shared.writing import in_one_type
from calib_core.frames import FloatArray
from calib_core.messages import message, plural

_HEADER = re.compile(rb"^(# ?\.PCD|VERSION|FIELDS)\b", re.MULTILINE)


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is PCD."""
    if _HEADER.search(data[:300]) and b"\nDATA " in data[:64_000]:
        return Match(1.0, "has a PCD header")
    return by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: Settings, kind: PointKind | None) -> Reading:
    """Return the points of a PCD file, in its order where it is organised; raises InputError."""
    layout, size = _layout(data, name)
    points = (
        _unpacked(data, layout, name) if layout.encoding == "binary_compressed" else points_in(data, layout, name)
    )
    reading = reading_of_fields(points, name, settings, kind)
    if size is None or min(size) < 2 or reading.kind == "profile":
        return reading
    if size[0] * size[1] != len(points):
        got = plural("{count} point", "{count} points", by="count", count=len(points))
        to_do = "Copy or export it again."
        raise InputError("{width} rows of {height} points", got, to_do, name, width=size[0], height=size[1])
    return replace(reading, grid=size)


def _unpacked(data: bytes, layout: Layout, where: str) -> FloatArray:
    planes = _decompressed(data, layout, where)
    sizes = [np.dtype(kind).itemsize for kind in layout.types]
    starts = np.concatenate([[0], np.cumsum(sizes)]) * layout.count
    columns: list[FloatArray] = []
    for index in layout.wanted:
        kind = np.dtype(layout.types[index])
        columns.append(np.frombuffer(planes, kind, layout.count, int(starts[index])).astype(np.float64))
    return np.stack(columns, axis=1)


def _layout(data: bytes, where: str) -> tuple[Layout, tuple[int, int] | None]:
    """Return where the points are, and how many rows and columns they have where the header says so."""
    lines, offset = header_lines(data, b"DATA", where, "PCD")
    header = {words[0].upper(): words[1:] for words in lines if words and not words[0].startswith("#")}
    try:
        fields = [name.lower() for name in header["FIELDS"]]
        sizes, kinds = header["SIZE"], header["TYPE"]
        counts = [int(n) for n in header.get("COUNT", ["1"] * len(fields))]
        size = header["POINTS"][:1] if "POINTS" in header else [header["WIDTH"][0], header["HEIGHT"][0]]
        count = math.prod(int(n) for n in size)
        names, types = _fields(fields, sizes, kinds, counts)
        encoding = header["DATA"][0].lower()
        shape = (int(header["HEIGHT"][0]), int(header["WIDTH"][0])) if {"HEIGHT", "WIDTH"} <= set(header) else None
    except (KeyError, IndexError, ValueError):
        raise wrong(
            where, "PCD", message("a header whose FIELDS, SIZE, TYPE, POINTS and DATA do not fit")
        ) from None
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise wrong(where, "PCD", message("DATA {encoding}", encoding=encoding))
    require_axes(names, where, "PCD")
    return Layout(names, types, count, offset, encoding), shape


def _fields(
    fields: list[str], sizes: list[str], kinds: list[str], counts: list[int]
) -> tuple[list[str], list[str]]:
    """Return one name and numpy type a column; padding (`_`) and repeated ones get names of their own."""
    names: list[str] = []
    types: list[str] = []
    for index, (field, size, kind, repeat) in enumerate(zip(fields, sizes, kinds, counts, strict=True)):
        if not 1 <= repeat <= 1000 or (kind, size) not in {(k, s) for k in "IUF" for s in "1248"} - {("F", "1")}:
            raise ValueError
        for number in range(repeat):
            names.append(field if repeat == 1 and field != "_" else f"{field}.{index}.{number}")
            types.append(f"<{kind.lower()}{size}")
    return names, types


def _decompressed(data: bytes, layout: Layout, where: str) -> bytes:
    """Return the body of a binary_compressed PCD: two sizes, then LZF."""
    packed_size = int.from_bytes(data[layout.offset : layout.offset + 4], "little")
    size = int.from_bytes(data[layout.offset + 4 : layout.offset + 8], "little")
    packed = data[layout.offset + 8 : layout.offset + 8 + packed_size]
    record = sum(np.dtype(kind).itemsize for kind in layout.types)
    require_count(layout.count, size // record, where)
    if len(packed) < packed_size:
        raise wrong(
            where,
            "PCD",
            message(
                "{count} of {packed_size} compressed bytes; the file was cut off",
                count=len(packed),
                packed_size=packed_size,
            ),
        )
    try:
        return _lzf(packed, layout.count * record)
    except (IndexError, ValueError):
        raise wrong(where, "PCD", message("compressed bytes that do not unpack")) from None


def _lzf(packed: bytes, size: int) -> bytes:
    """Undo LZF: a byte below 32 precedes a literal run, one above it a copy from what was unpacked already."""
    out = bytearray()
    at = 0
    while at < len(packed) and len(out) < size:
        control = packed[at]
        at += 1
        if control < 32:
            out += packed[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7:
            length += packed[at]
            at += 1
        start = len(out) - ((control & 31) << 8) - packed[at] - 1
        at += 1
        if start < 0:
            raise ValueError
        length += 2
        while length > 0:  # a copy may reach into itself: then it repeats
            piece = out[start : start + length]
            out += piece
            start += len(piece)
            length -= len(piece)
    if len(out) < size:
        raise ValueError
    return bytes(out)


def pcd_pieces(tables: Iterable[ArrayLike], count: int, names: tuple[str, ...]) -> Pieces:
    """Give a binary PCD file; parameters as in `ply_pieces_of`. Normals get the names that PCD has for them."""
    renamed = {"nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}
    fields = [renamed.get(name, name) for name in names]
    ones = " ".join(["1"] * len(fields))
    kind, rows = in_one_type(tables, names)
    header = [
        "# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7", f"FIELDS {' '.join(fields)}",
        f"SIZE {' '.join([kind[-1]] * len(fields))}", f"TYPE {' '.join(['F'] * len(fields))}", f"COUNT {ones}",
        f"WIDTH {count}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {count}", "DATA binary",
    ]  # fmt: skip
    yield ("\n".join(header) + "\n").encode("ascii")
    for table in rows:
        yield table.data.cast("B")


FORMAT = Format(
    name="pcd",
    title="PCD (Point Cloud Library)",
    endings=(".pcd",),
    kinds=("cloud", "profile"),
    recognise=recognise,
    read=read,
    write_cloud=pcd_pieces,
    proof="real files",
)
