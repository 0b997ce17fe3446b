"""Triangle meshes from other programs: STL (binary and text) and PLY, as a reference to compare with."""

from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, TooLargeError

MAX_TRIANGLES = 5_000_000
_STL_RECORD = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEADER = 84
_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class MeshData:
    """A mesh: corners (C, 3) in mm, triangles (M, 3), counter-clockwise from outside."""

    corners_mm: NDArray[np.float32]
    triangles: NDArray[np.int32]


def parse_mesh(data: bytes, name: str) -> MeshData:
    """Return the triangles of an STL or PLY file; faces of more corners are cut into triangles.

    Raises
    ------
    InputError
        If the file is neither, is cut off, or has no triangles.
    TooLargeError
        If there are more than `MAX_TRIANGLES`.
    """
    ending = PurePosixPath(name).suffix.lower()
    if data.startswith(b"ply"):
        mesh = _parse_ply(data, name)
    elif ending == ".stl" or data.lstrip()[:5] == b"solid":
        mesh = _parse_stl(data, name)
    else:
        raise InputError("a mesh as STL or PLY", f"'{ending or 'no ending'}'", "Export it as one of these.", name)
    if not len(mesh.triangles):
        raise _wrong(name, "no triangle", "Export a mesh, not a cloud.")
    if not np.isfinite(mesh.corners_mm).all():
        raise _wrong(name, "corners that are no numbers")
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(mesh.corners_mm):
        raise _wrong(name, "triangles with corners that are not there")
    return mesh


def _parse_stl(data: bytes, name: str) -> MeshData:
    count = int.from_bytes(data[80:84], "little") if len(data) >= _STL_HEADER else -1
    if count >= 0 and len(data) == _STL_HEADER + count * _STL_RECORD.itemsize:
        _require_few(count, name)
        corners = np.frombuffer(data, _STL_RECORD, count, _STL_HEADER)["corners"]
    elif data.lstrip()[:5] == b"solid":
        corners = _text_corners(data, name)
    else:
        got = f"{len(data)} bytes where {max(count, 0)} triangles are announced"
        raise _wrong(name, got)
    flat = np.ascontiguousarray(corners.reshape(-1, 3), dtype=np.float32)
    return MeshData(flat, np.arange(len(flat), dtype=np.int32).reshape(-1, 3))


def _text_corners(data: bytes, name: str) -> NDArray[np.float32]:
    _require_few(data.count(b"vertex") // 3, name)
    words = [line.split()[1:] for line in data.splitlines() if line.lstrip().startswith(b"vertex")]
    try:
        corners = np.array(words, dtype=np.float32)
    except ValueError:
        raise _wrong(name, "a corner that is not three numbers") from None
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) % 3:
        raise _wrong(name, "a triangle without three corners")
    return corners.reshape(-1, 3, 3)


def _parse_ply(data: bytes, name: str) -> MeshData:
    header, body = _ply_header(data, name)
    kind, elements = header
    if kind == "ascii":
        return _ascii_ply(body, elements, name)
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(kind)
    if order is None:
        raise _wrong(name, f"the PLY format {kind[:30]!r}")
    corners: NDArray[np.float32] | None = None
    triangles: NDArray[np.int32] | None = None
    at = 0
    for what, count, properties in elements:
        lists = [p for p in properties if p[0] == "list"]
        if not lists:
            record = np.dtype([(p[2], order + p[1]) for p in properties])
            if len(body) < at + count * record.itemsize:
                raise _wrong(name, "fewer bytes than its header announces")
            rows = np.frombuffer(body, record, count, at)
            at += count * record.itemsize
            if what == "vertex":
                if not {"x", "y", "z"} <= set(record.names or ()):
                    raise _wrong(name, "corners without x, y and z")
                corners = np.column_stack([rows[axis] for axis in "xyz"]).astype(np.float32)
        elif what == "face" and len(properties) == 1:
            _require_few(count, name)
            triangles, at = _binary_faces(body, at, count, properties[0], order, name)
        else:
            raise _wrong(name, f"lists in its element {what[:30]!r}", "Export it with corners and faces alone.")
        if corners is not None and triangles is not None:
            break
    if corners is None or triangles is None:
        raise _wrong(name, "no triangle", "Export a mesh, not a cloud.")
    return MeshData(corners, triangles)


def _ply_header(
    data: bytes, name: str
) -> tuple[tuple[str, list[tuple[str, int, list[tuple[str, str, str]]]]], bytes]:
    """Return the format, the elements with their properties (kind, type, name), and what follows the header."""
    end = data.find(b"end_header", 0, 20_000)
    start = data.find(b"\n", max(end, 0)) + 1
    if end < 0 or not start:
        raise _wrong(name, "a PLY header without an end")
    kind = ""
    elements: list[tuple[str, int, list[tuple[str, str, str]]]] = []
    for line in data[:end].decode("ascii", "replace").splitlines():
        match line.split():
            case ["format", word, *_]:
                kind = word
            case ["element", what, count] if count.isdecimal() and len(count) < 12:
                elements.append((what, int(count), []))
            case ["property", "list", size, of, what] if elements and size in _PLY_TYPES and of in _PLY_TYPES:
                elements[-1][2].append(("list", f"{_PLY_TYPES[size]} {_PLY_TYPES[of]}", what))
            case ["property", of, what] if elements and of in _PLY_TYPES:
                elements[-1][2].append(("one", _PLY_TYPES[of], what))
            case ["property" | "element" | "format", *_]:
                raise _wrong(name, f"the line {line[:60]!r} in its header")
            case _:
                continue
    for what, _, properties in elements:
        if len({p[2] for p in properties}) < len(properties) or not properties:
            raise _wrong(name, f"properties of its element {what[:30]!r} that are alike, or none")
    return (kind, elements), data[start:]


def _binary_faces(
    body: bytes, at: int, count: int, listed: tuple[str, str, str], order: str, name: str
) -> tuple[NDArray[np.int32], int]:
    size, of = (np.dtype(order + code) for code in listed[1].split())
    record = np.dtype([("count", size), ("corners", of, (3,))])
    if len(body) >= at + count * record.itemsize:
        rows = np.frombuffer(body, record, count, at)
        if (rows["count"] == 3).all():
            return rows["corners"].astype(np.int32), at + count * record.itemsize
    fans: list[NDArray[np.int32]] = []
    for _ in range(count):  # faces of different numbers of corners: one after the other
        corners = int(np.frombuffer(body, size, 1, at)[0]) if len(body) >= at + size.itemsize else -1
        at += size.itemsize
        if not 3 <= corners <= 255 or len(body) < at + corners * of.itemsize:
            raise _wrong(name, "fewer bytes than its header announces, or a face without three corners")
        ring = np.frombuffer(body, of, corners, at).astype(np.int32)
        at += corners * of.itemsize
        fans.append(_fan(ring))
    return np.concatenate(fans) if fans else np.zeros((0, 3), np.int32), at


def _ascii_ply(body: bytes, elements: list[tuple[str, int, list[tuple[str, str, str]]]], name: str) -> MeshData:
    lines = body.split(b"\n")
    corners = triangles = None
    at = 0
    try:
        for what, count, properties in elements:
            rows = [line.split() for line in lines[at : at + count]]
            at += count
            if len(rows) != count:
                raise _wrong(name, "fewer lines than its header announces")
            if what == "vertex":
                columns = [[p[2] for p in properties].index(axis) for axis in "xyz"]
                corners = np.array([[row[c] for c in columns] for row in rows], dtype=np.float32)
            elif what == "face":
                _require_few(count, name)
                rings = [np.array(row[1 : 1 + int(row[0])], dtype=np.int32) for row in rows]
                triangles = np.concatenate([_fan(ring) for ring in rings]) if rings else np.zeros((0, 3), np.int32)
    except (ValueError, IndexError, OverflowError):
        raise _wrong(name, "a line that is not as its header says") from None
    if corners is None or triangles is None or not len(corners):
        raise _wrong(name, "no triangle", "Export a mesh, not a cloud.")
    return MeshData(corners, triangles)


def _fan(ring: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the triangles (K − 2, 3) of a face with K corners."""
    return np.stack([np.full(len(ring) - 2, ring[0], np.int32), ring[1:-1], ring[2:]], axis=1)


def _require_few(count: int, name: str) -> None:
    if count > MAX_TRIANGLES:
        to_do = "Export it with a coarser tolerance."
        raise TooLargeError(f"at most {MAX_TRIANGLES:,} triangles", f"{count:,}", to_do, name)


def _wrong(name: str, got: str, to_do: str = "Export the mesh again, as STL or PLY.") -> InputError:
    return InputError("a whole mesh file", got, to_do, name)
