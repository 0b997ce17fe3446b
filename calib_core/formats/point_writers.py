"""Clouds and meshes as PLY, PCD, XYZ, STL and E57: a header and the array as it lies in memory.

Every writer gives pieces of bytes; `write_pieces` puts them into a file that appears whole or not at all.
"""

import errno
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.errors import InputError
from calib_core.formats.e57_writer import e57_pieces

Pieces = Iterator[bytes | memoryview]
SingleArray = NDArray[np.float32]

_XYZ = ("x", "y", "z")
_BLOCK = 50_000
_LARGE = 1 << 20


def ply_pieces(values: ArrayLike, names: tuple[str, ...] = _XYZ, triangles: ArrayLike | None = None) -> Pieces:
    """Give a binary PLY file of points, or of a mesh.

    Parameters
    ----------
    values : (N, K) float32
        A row a point.
    names : tuple of K str
        The columns; the first three are x, y, z in mm.  `nx ny nz` is what other programs know as the normal.
    triangles : (M, 3), optional
        Indices of points.

    Raises
    ------
    InputError
        If there are no points, or names and columns differ in number.
    """
    table = _table(values, names)
    faces = None if triangles is None else _faces(triangles, len(table))
    yield _ply_header(names, len(table), None if faces is None else len(faces))
    yield table.data.cast("B")
    if faces is not None:
        records = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", (3,))])
        records["count"], records["corners"] = 3, faces
        yield records.tobytes()


def ply_pieces_of(tables: Iterable[ArrayLike], count: int, names: tuple[str, ...] = _XYZ) -> Pieces:
    """Give a binary PLY file of points that are never in memory together.

    Parameters
    ----------
    tables : iterable of (N, K) float32
        As in `ply_pieces`.
    count : int
        Of all points.
    names : tuple of K str

    Raises
    ------
    InputError
        If there are no points, or names and columns differ in number.
    """
    yield _ply_header(names, count, None)
    for values in tables:
        yield _table(values, names).data.cast("B")


def _ply_header(names: tuple[str, ...], points: int, triangles: int | None) -> bytes:
    header = ["ply", "format binary_little_endian 1.0", "comment unit mm", f"element vertex {points}"]
    header += [f"property float {name}" for name in names]
    if triangles is not None:
        header += [f"element face {triangles}", "property list uchar int vertex_indices"]
    return ("\n".join([*header, "end_header"]) + "\n").encode("ascii")


def pcd_pieces(values: ArrayLike, names: tuple[str, ...] = _XYZ) -> Pieces:
    """Give a binary PCD file of points (N, K), as `ply_pieces`; normals are renamed to what PCD calls them."""
    table = _table(values, names)
    yield from pcd_pieces_of([table], len(table), names)


def pcd_pieces_of(tables: Iterable[ArrayLike], count: int, names: tuple[str, ...] = _XYZ) -> Pieces:
    """Give the same file of points that are never in memory together; parameters as in `ply_pieces_of`."""
    renamed = {"nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}
    fields = [renamed.get(name, name) for name in names]
    ones = " ".join(["1"] * len(fields))
    header = [
        "# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7", f"FIELDS {' '.join(fields)}",
        f"SIZE {' '.join(['4'] * len(fields))}", f"TYPE {' '.join(['F'] * len(fields))}", f"COUNT {ones}",
        f"WIDTH {count}", "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", f"POINTS {count}", "DATA binary",
    ]  # fmt: skip
    yield ("\n".join(header) + "\n").encode("ascii")
    for values in tables:
        yield _table(values, names).data.cast("B")


def xyz_pieces(values: ArrayLike, names: tuple[str, ...] = _XYZ) -> Pieces:
    """Give a text file of points (N, K), one a line, five decimals, without a header as other programs expect."""
    table = _table(values, names)
    line = " ".join(["%.5f"] * table.shape[1]) + "\n"
    for start in range(0, len(table), _BLOCK):
        block = table[start : start + _BLOCK]
        yield (line * len(block) % tuple(block.ravel().tolist())).encode("ascii")


def stl_pieces(points_mm: ArrayLike, triangles: ArrayLike) -> Pieces:
    """Give a binary STL file of a mesh: points (N, 3) in mm, triangles (M, 3) of indices.

    Raises
    ------
    InputError
        If there are no triangles, or one names a point that is not there.
    """
    points = _table(points_mm, _XYZ)
    faces = _faces(triangles, len(points))
    yield from stl_pieces_of(points, (faces[at : at + _BLOCK] for at in range(0, len(faces), _BLOCK)), len(faces))


def stl_pieces_of(points_mm: NDArray[np.float32], blocks: Iterable[ArrayLike], count: int) -> Pieces:
    """Give the same file of triangles that come in blocks (M, 3), `count` in all; raises as `stl_pieces`."""
    yield b"scancell mesh, mm".ljust(80) + count.to_bytes(4, "little")
    for triangles in blocks:
        yield _stl_records(points_mm[_faces(triangles, len(points_mm))])


def _stl_records(corners: NDArray[np.float32]) -> bytes:
    """Return the records of triangles (M, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records = np.zeros(len(corners), dtype=[("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
    records["normal"] = normals / np.where(lengths > 0, lengths, 1)
    records["corners"] = corners
    return records.tobytes()


CLOUD_WRITERS: dict[str, Callable[[ArrayLike], Iterator[bytes | memoryview]]] = {
    "ply": ply_pieces,
    "pcd": pcd_pieces,
    "xyz": xyz_pieces,
    "e57": e57_pieces,
}
"""By the ending of the file."""


def cloud_pieces(name: str, points_mm: ArrayLike) -> Pieces:
    """Give the file of a cloud (N, 3) in the format that the file's name ends in; raises InputError."""
    ending = Path(name).suffix.lower().removeprefix(".")
    if ending not in CLOUD_WRITERS:
        need = "a cloud's file as " + ", ".join(f".{known}" for known in CLOUD_WRITERS)
        raise InputError(need, Path(name).suffix or "no ending", "Name it so.", name)
    return CLOUD_WRITERS[ending](points_mm)


def write_pieces(path: Path, pieces: Iterable[bytes | memoryview]) -> int:
    """Write a file beside its name, then rename it; return its size in bytes.

    What stood under the name stays whole unless all was written.

    Raises
    ------
    InputError
        If the disk is full or the folder cannot be written; nothing is left behind.
    """
    temporary: Path | None = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        size = 0
        with os.fdopen(handle, "wb", buffering=0) as file:
            for step in _in_large_steps(pieces):
                length = sum(len(piece) for piece in step)
                if size or length >= _LARGE:
                    _reserve(file.fileno(), size, length)
                for piece in step:
                    size += _write_all(file.fileno(), piece)
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        _remove(temporary)
        got = error.strerror or type(error).__name__
        to_do = "Make room, or give a folder that may be written."
        raise InputError("a place to write to", got, to_do, str(path)) from None
    except BaseException:
        _remove(temporary)
        raise
    return size


def _in_large_steps(pieces: Iterable[bytes | memoryview]) -> Iterator[list[bytes | memoryview]]:
    """Give pieces together until they are large, so that a header does not go alone."""
    step: list[bytes | memoryview] = []
    for piece in pieces:
        step.append(piece)
        if sum(len(one) for one in step) >= _LARGE:
            yield step
            step = []
    if step:
        yield step


def _reserve(handle: int, start: int, length: int) -> None:
    """Reserve room: a full disk is known at once, and renaming need not wait until the disk has found the room."""
    if hasattr(os, "posix_fallocate"):
        try:
            os.posix_fallocate(handle, start, length)
        except OSError as error:
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL):
                raise


def _write_all(handle: int, piece: bytes | memoryview) -> int:
    rest = memoryview(piece)
    while len(rest):
        rest = rest[os.write(handle, rest) :]
    return len(piece)


def _remove(path: Path | None) -> None:
    if path is not None:
        with suppress(OSError):
            path.unlink()


def _table(values: ArrayLike, names: tuple[str, ...]) -> SingleArray:
    table = np.ascontiguousarray(values, dtype="<f4")
    if table.ndim != 2 or not len(table):
        raise InputError("at least one point to write", f"an array of shape {table.shape}", "Merge scans first.")
    if table.shape[1] != len(names) or names[:3] != _XYZ:
        raise InputError(f"{len(names)} columns ({' '.join(names)})", f"{table.shape[1]}", "Name each column.")
    return table


def _faces(triangles: ArrayLike, points: int) -> NDArray[np.int32]:
    faces = np.asarray(triangles)
    if faces.ndim != 2 or faces.shape[1] != 3 or not len(faces):
        raise InputError("triangles of three corners", f"an array of shape {faces.shape}", "Mesh the cloud first.")
    if faces.min() < 0 or faces.max() >= points:
        raise InputError(
            f"corners among {points} points", f"number {faces.max()}", "Give mesh and points together."
        )
    return faces.astype("<i4")
