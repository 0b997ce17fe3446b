"""PLY: clouds and meshes, ascii and binary of either order; written binary."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.formats.format import Format, Match, Pieces, PointKind, Reading, Settings, by_ending
from calib_core.formats.shared import range_grid
from calib_core.formats.shared.fields import (
    Layout,
    header_lines,
    points_in,
    reading_of_fields,
    require_axes,
    wrong,
)
from calib_core.formats.shared.mesh import MeshData, require_few
from calib_core.formats.shared.mesh import wrong as wrong_mesh
from calib_core.formats.shared.names import unit_in
from calib_core.formats.shared.writing import XYZ, faces_of, in_one_type
from calib_core.frames import FloatArray
from calib_core.messages import message

_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "i2", "int16": "i2", "ushort": "u2",
    "uint16": "u2", "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4", "float": "f4", "float32": "f4",
    "double": "f8", "float64": "f8",
}  # fmt: skip


@dataclass(frozen=True)
class _Property:
    """A property of an element: its name, its numpy type, and the type of its count where it is a list."""

    name: str
    type: str
    count: str | None = None


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property]

    def record(self, order: str) -> np.dtype[Any]:
        """Return the type of one element that has no list."""
        return np.dtype([(p.name, order + p.type) for p in self.properties])


@dataclass(frozen=True)
class _Header:
    order: str
    elements: list[_Element]
    comments: list[str]
    end: int


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is PLY."""
    return Match(1.0, "begins with 'ply'") if data[:3] == b"ply" else by_ending(name, FORMAT.endings)


def read(data: bytes, name: str, settings: Settings, kind: PointKind | None) -> Reading:
    """Return the vertices of a PLY file; raises InputError if it is no PLY file of points, or cut off."""
    header = _header(data, name)
    if not header.elements or header.elements[0].name != "vertex":
        first = header.elements[0].name[:30] if header.elements else message("(none)")
        raise wrong(name, "PLY", message("an element '{first}' before the vertices", first=first))
    vertex = header.elements[0]
    lists = [p.name for p in vertex.properties if p.count]
    if lists:
        raise wrong(name, "PLY", message("a vertex property 'list {lists}'", lists=lists[0]))
    names = [p.name.lower() for p in vertex.properties]
    require_axes(names, name, "PLY")
    types = [header.order + p.type for p in vertex.properties]
    layout = Layout(names, types, vertex.count, header.end, "binary" if header.order else "ascii")
    points = points_in(data, layout, name)
    grid = _grid(header)
    if grid is not None:
        points = np.vstack([points, np.full(points.shape[1], np.nan)])[_vertices_of_cells(data, header, name)]
    reading = reading_of_fields(points, name, settings, kind, unit_in(header.comments))
    return replace(reading, grid=grid) if reading.kind == "cloud" else reading


def _grid(header: _Header) -> tuple[int, int] | None:
    """Return rows and columns where the element after the vertices tells which of them each cell has."""
    after = header.elements[1] if len(header.elements) > 1 else None
    if after is None or after.name != range_grid.ELEMENT or [bool(p.count) for p in after.properties] != [True]:
        return None
    return range_grid.grid_size(header.comments, after.count)


def _vertices_of_cells(data: bytes, header: _Header, name: str) -> NDArray[np.int64]:
    """Return the vertex of each cell, −1 where nothing came back; raises InputError."""
    vertex, grid = header.elements[:2]
    listed = grid.properties[0]
    if header.order:
        body = data[header.end + vertex.count * vertex.record(header.order).itemsize :]
        number = np.dtype(header.order + listed.type)
    else:
        body, number = data[header.end :].split(b"\n", vertex.count)[-1], None
    found = range_grid.vertices_of_cells(
        body, grid.count, np.dtype(header.order + str(listed.count)), number, name
    )
    if found.max(initial=-1) >= vertex.count or found.min(initial=-1) < -1:
        raise wrong(name, "PLY", message("a range_grid of vertices that are not there"))
    return found


def _header(data: bytes, where: str) -> _Header:
    if not data.startswith(b"ply"):
        raise wrong(where, "PLY", message("a file that does not begin with 'ply'"))
    lines, end = header_lines(data, b"end_header", where, "PLY")
    encoding = ""
    elements: list[_Element] = []
    comments: list[str] = []
    for words in lines:
        match words:
            case ["format", encoding, *_]:
                pass
            case ["comment" | "obj_info", *rest]:
                comments.append(" ".join(rest))
            case ["element", element, count]:
                if not count.isdecimal() or len(count) > 18:
                    raise wrong(where, "PLY", message("a count of {count!r}", count=count[:20]))
                elements.append(_Element(element, int(count), []))
            case ["property", "list", size, of, named] if elements and size in _TYPES and of in _TYPES:
                elements[-1].properties.append(_Property(named, _TYPES[of], _TYPES[size]))
            case ["property", of, named] if elements and of in _TYPES:
                elements[-1].properties.append(_Property(named, _TYPES[of]))
            case ["property" | "element" | "format", *_]:
                raise wrong(where, "PLY", message("the line {words!r} in its header", words=" ".join(words)[:60]))
            case _:
                pass
    if encoding not in _ORDERS:
        raise wrong(where, "PLY", message("the format {encoding}", encoding=encoding[:40] or message("(none)")))
    return _Header(_ORDERS[encoding], elements, comments, end)


def parse_ply_mesh(data: bytes, name: str) -> MeshData:
    """Return the triangles of a PLY file; faces of more corners are cut into triangles.  Raises InputError."""
    header = _header(data, name)
    for element in header.elements:
        if len({p.name for p in element.properties}) < len(element.properties) or not element.properties:
            got = message(
                "properties of its element {element!r} that are alike, or none", element=element.name[:30]
            )
            raise wrong_mesh(name, got)
    body = data[header.end :]
    found = _text_mesh(body, header, name) if not header.order else _binary_mesh(body, header, name)
    if found is None:
        raise wrong_mesh(name, "no triangle", "Export a mesh, not a cloud.")
    return found


def _binary_mesh(body: bytes, header: _Header, name: str) -> MeshData | None:
    corners: FloatArray | None = None
    triangles: NDArray[np.int32] | None = None
    at = 0
    for element in header.elements:
        if not any(p.count for p in element.properties):
            record = element.record(header.order)
            if len(body) < at + element.count * record.itemsize:
                raise wrong_mesh(name, "fewer bytes than its header announces")
            rows = np.frombuffer(body, record, element.count, at)
            at += element.count * record.itemsize
            if element.name == "vertex":
                if not {"x", "y", "z"} <= set(record.names or ()):
                    raise wrong_mesh(name, "corners without x, y and z")
                corners = np.column_stack([rows[axis] for axis in "xyz"]).astype(float)
        elif element.name == "face" and len(element.properties) == 1:
            require_few(element.count, name)
            triangles, at = _binary_faces(body, at, element, header.order, name)
        else:
            got = message("lists in its element {element!r}", element=element.name[:30])
            raise wrong_mesh(name, got, "Export it with corners and faces alone.")
        if corners is not None and triangles is not None:
            return MeshData(corners, triangles)
    return None


def _binary_faces(body: bytes, at: int, element: _Element, order: str, name: str) -> tuple[NDArray[np.int32], int]:
    listed, count = element.properties[0], element.count
    size, of = np.dtype(order + (listed.count or "u1")), np.dtype(order + listed.type)
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
            raise wrong_mesh(name, "fewer bytes than its header announces, or a face without three corners")
        ring = np.frombuffer(body, of, corners, at).astype(np.int32)
        at += corners * of.itemsize
        fans.append(_fan(ring))
    return np.concatenate(fans) if fans else np.zeros((0, 3), np.int32), at


def _text_mesh(body: bytes, header: _Header, name: str) -> MeshData | None:
    lines = body.split(b"\n")
    corners = triangles = None
    at = 0
    try:
        for element in header.elements:
            rows = [line.split() for line in lines[at : at + element.count]]
            at += element.count
            if len(rows) != element.count:
                raise wrong_mesh(name, "fewer lines than its header announces")
            if element.name == "vertex":
                columns = [[p.name for p in element.properties].index(axis) for axis in "xyz"]
                corners = np.array([[row[c] for c in columns] for row in rows], dtype=float)
            elif element.name == "face":
                require_few(element.count, name)
                rings = [np.array(row[1 : 1 + int(row[0])], dtype=np.int32) for row in rows]
                triangles = np.concatenate([_fan(ring) for ring in rings]) if rings else np.zeros((0, 3), np.int32)
    except (ValueError, IndexError, OverflowError):
        raise wrong_mesh(name, "a line that is not as its header says") from None
    if corners is None or triangles is None or not len(corners):
        return None
    return MeshData(corners, triangles)


def _fan(ring: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the triangles (K − 2, 3) of a face with K corners."""
    return np.stack([np.full(len(ring) - 2, ring[0], np.int32), ring[1:-1], ring[2:]], axis=1)


def ply_pieces(values: ArrayLike, names: tuple[str, ...] = XYZ, triangles: ArrayLike | None = None) -> Pieces:
    """Give a binary PLY file of points, or of a mesh.

    Parameters
    ----------
    values : (N, K)
        A row a point; written in single precision but for float64 far from zero.
    names : tuple of K str
        The columns; the first three are x, y, z in mm.  `nx ny nz` is what other programs know as the normal.
    triangles : (M, 3), optional
        Indices of points.

    Raises
    ------
    InputError
        If there are no points, or names and columns differ in number.
    """
    table = next(in_one_type([values], names)[1])
    faces = None if triangles is None else faces_of(triangles, len(table))
    yield _written_header(names, table.dtype, len(table), None if faces is None else len(faces))
    yield table.data.cast("B")
    if faces is not None:
        records = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
        records["count"], records["corners"] = 3, faces
        yield records.tobytes()


def ply_pieces_of(tables: Iterable[ArrayLike], count: int, names: tuple[str, ...] = XYZ) -> Pieces:
    """Give a binary PLY file of points that are never in memory together.

    Parameters
    ----------
    tables : iterable of (N, K)
        As in `ply_pieces`.
    count : int
        Of all points.
    names : tuple of K str

    Raises
    ------
    InputError
        If there are no points, or names and columns differ in number.
    """
    kind, rows = in_one_type(tables, names)
    yield _written_header(names, np.dtype(kind), count, None)
    for table in rows:
        yield table.data.cast("B")


def _written_header(names: tuple[str, ...], kind: np.dtype[Any], points: int, triangles: int | None) -> bytes:
    header = ["ply", "format binary_little_endian 1.0", "comment unit mm", f"element vertex {points}"]
    header += [f"property {'float' if kind.itemsize == 4 else 'double'} {name}" for name in names]
    if triangles is not None:
        header += [f"element face {triangles}", "property list uchar int vertex_indices"]
    return ("\n".join([*header, "end_header"]) + "\n").encode("ascii")


FORMAT = Format(
    name="ply",
    title="PLY (ascii, binary)",
    endings=(".ply",),
    kinds=("cloud", "profile", "mesh"),
    recognise=recognise,
    read=read,
    media_type="model/ply",
    write_cloud=ply_pieces_of,
    read_mesh=parse_ply_mesh,
    write_mesh=lambda corners, blocks, count: ply_pieces(corners, triangles=np.concatenate(list(blocks))),
    proof="real files",
)
