"""Clouds of points as PLY and PCD: strict readers of x, y and z alone, which a hostile file cannot crash."""

import math
from dataclasses import dataclass

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.binary_table import columns_from_records, require_count
from calib_core.formats.text_table import parse_table
from calib_core.frames import FloatArray

_AXES = ("x", "y", "z")
_MAX_HEADER_BYTES = 64_000

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class _Layout:
    """Where the points of a file are: names and numpy types of a point's fields, count, first byte, encoding."""

    names: list[str]
    types: list[str]
    count: int
    offset: int
    encoding: str


def parse_ply(data: bytes, where: str) -> FloatArray:
    """Return the vertices of a PLY file (ascii, or binary of either order), (N, 3), in the file's unit.

    Raises
    ------
    InputError
        If it is no PLY file of points, or cut off.
    """
    return _points(data, _ply_layout(data, where), where)


def parse_pcd(data: bytes, where: str) -> FloatArray:
    """Return the points of a PCD file (ascii, binary or binary_compressed), (N, 3), in the file's unit.

    Raises
    ------
    InputError
        If it is no PCD file of points, or cut off.
    """
    layout = _pcd_layout(data, where)
    if layout.encoding != "binary_compressed":
        return _points(data, layout, where)
    planes = _decompressed(data, layout, where)
    sizes = [np.dtype(kind).itemsize for kind in layout.types]
    starts = np.concatenate([[0], np.cumsum(sizes)]) * layout.count
    columns: list[FloatArray] = []
    for axis in _AXES:
        index = layout.names.index(axis)
        kind = np.dtype(layout.types[index])
        columns.append(np.frombuffer(planes, kind, layout.count, int(starts[index])).astype(np.float64))
    return np.stack(columns, axis=1)


def _points(data: bytes, layout: _Layout, where: str) -> FloatArray:
    if layout.encoding == "ascii":
        return _ascii_points(data, layout, where)
    record = np.dtype(list(zip(layout.names, layout.types, strict=True)))
    return columns_from_records(data, layout.offset, layout.count, record, _AXES, where)


def _ascii_points(data: bytes, layout: _Layout, where: str) -> FloatArray:
    lines = data[layout.offset :].splitlines()
    require_count(layout.count, len(lines), where)
    body = b"\n".join(lines[: layout.count])
    table = parse_table(body, where, [len(layout.names)], " ".join(layout.names))
    require_count(layout.count, len(table), where)
    return table[:, [layout.names.index(axis) for axis in _AXES]]


def _header_lines(data: bytes, last: bytes, where: str, format_name: str) -> tuple[list[list[str]], int]:
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
    raise _wrong(where, format_name, f"a header without a line {last.decode()}")


def _ply_layout(data: bytes, where: str) -> _Layout:
    if not data.startswith(b"ply"):
        raise _wrong(where, "PLY", "a file that does not begin with 'ply'")
    lines, offset = _header_lines(data, b"end_header", where, "PLY")
    encoding, element, count = "", "", 0
    names: list[str] = []
    kinds: list[str] = []
    for words in lines:
        match words:
            case ["format", name, *_]:
                encoding = name
            case ["element", "vertex", number]:
                element, count = "vertex", _integer(number, where, "PLY")
            case ["element", name, *_]:
                if element == "":
                    raise _wrong(where, "PLY", f"an element '{name}' before the vertices")
                element = name
            case ["property", kind, name] if element == "vertex" and kind in _PLY_TYPES:
                names.append(name)
                kinds.append(_PLY_TYPES[kind])
            case ["property", *rest] if element == "vertex":
                raise _wrong(where, "PLY", f"a vertex property '{' '.join(rest)}'")
            case _:
                pass
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}.get(encoding)
    if order is None:
        raise _wrong(where, "PLY", f"the format {encoding or '(none)'}")
    _require_axes(names, where, "PLY")
    return _Layout(names, [order + kind for kind in kinds], count, offset, encoding if not order else "binary")


def _pcd_layout(data: bytes, where: str) -> _Layout:
    lines, offset = _header_lines(data, b"DATA", where, "PCD")
    header = {words[0].upper(): words[1:] for words in lines if words and not words[0].startswith("#")}
    try:
        fields, sizes, kinds = header["FIELDS"], header["SIZE"], header["TYPE"]
        counts = [int(n) for n in header.get("COUNT", ["1"] * len(fields))]
        size = header["POINTS"][:1] if "POINTS" in header else [header["WIDTH"][0], header["HEIGHT"][0]]
        count = math.prod(int(n) for n in size)
        names, types = _pcd_fields(fields, sizes, kinds, counts)
        encoding = header["DATA"][0].lower()
    except (KeyError, IndexError, ValueError):
        raise _wrong(where, "PCD", "a header whose FIELDS, SIZE, TYPE, POINTS and DATA do not fit") from None
    if encoding not in ("ascii", "binary", "binary_compressed"):
        raise _wrong(where, "PCD", f"DATA {encoding}")
    _require_axes(names, where, "PCD")
    return _Layout(names, types, count, offset, encoding)


def _pcd_fields(
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


def _decompressed(data: bytes, layout: _Layout, where: str) -> bytes:
    """Return the body of a binary_compressed PCD: two sizes, then LZF."""
    packed_size = int.from_bytes(data[layout.offset : layout.offset + 4], "little")
    size = int.from_bytes(data[layout.offset + 4 : layout.offset + 8], "little")
    packed = data[layout.offset + 8 : layout.offset + 8 + packed_size]
    record = sum(np.dtype(kind).itemsize for kind in layout.types)
    require_count(layout.count, size // record, where)
    if len(packed) < packed_size:
        raise _wrong(where, "PCD", f"{len(packed)} of {packed_size} compressed bytes; the file was cut off")
    try:
        return _lzf(packed, layout.count * record)
    except (IndexError, ValueError):
        raise _wrong(where, "PCD", "compressed bytes that do not unpack") from None


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


def _require_axes(names: list[str], where: str, format_name: str) -> None:
    if [names.count(axis) for axis in _AXES] != [1, 1, 1] or len(set(names)) != len(names):
        raise _wrong(where, format_name, f"the fields {' '.join(names) or '(none)'}")


def _integer(text: str, where: str, format_name: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise _wrong(where, format_name, f"a count of {text[:20]!r}") from None


def _wrong(where: str, format_name: str, got: str) -> InputError:
    return InputError(f"a {format_name} file of points x y z", got, "Export the cloud again.", where)
