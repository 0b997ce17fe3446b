"""Stored clouds and meshes: read back as they were written, given in the formats of other programs."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import IO, Any, Final

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, NotFoundError
from calib_core.formats.format import INTENSITY, SCAN_COLUMN, Pieces, ScanPlace
from calib_core.formats.points import FORMATS
from calib_core.messages import message

CLOUD_FOLDER: Final = "clouds"
CLOUD_FILE: Final = f"{CLOUD_FOLDER}/merged.ply"
MESH_FILE: Final = f"{CLOUD_FOLDER}/mesh.ply"
REFERENCE_FILE: Final = f"{CLOUD_FOLDER}/reference.ply"
"""The mesh that says what the object should be: the user's, not a stage's."""

_MAX_HEADER_BYTES = 4000
_BLOCK_BYTES = 1 << 20
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])


def media_types() -> dict[str, str]:
    """Return the media type of each format that clouds or meshes are given in."""
    return {entry.name: entry.media_type for entry in FORMATS if entry.write_cloud or entry.write_mesh}


def cloud_formats() -> list[str]:
    """Return the formats that clouds are given in."""
    return [entry.name for entry in FORMATS if entry.write_cloud]


def mesh_formats() -> list[str]:
    """Return the formats that meshes are given in."""
    return [entry.name for entry in FORMATS if entry.write_mesh]


@dataclass(frozen=True, eq=False)
class StoredCloud:
    """A cloud or a mesh as `formats.ply.ply_pieces` wrote it.

    Parameters
    ----------
    values : (N, K) float32, float64 far from zero
        A row a point.
    names : tuple of K str
        x, y, z in mm, and what else there is.
    triangles : (M, 3) int32 or None
        Of a mesh.
    """

    values: NDArray[np.floating]
    names: tuple[str, ...]
    triangles: NDArray[np.int32] | None

    @property
    def scans(self) -> NDArray[np.int64] | None:
        """The number (N,) of the scan that weighs most around each point; None where the file does not say."""
        return (
            self.values[:, self.names.index(SCAN_COLUMN)].astype(np.int64) if SCAN_COLUMN in self.names else None
        )

    @property
    def intensity(self) -> NDArray[np.floating] | None:
        """How bright each point (N,) came back; None where the file does not say."""
        return self.values[:, self.names.index(INTENSITY)] if INTENSITY in self.names else None

    @property
    def points_mm(self) -> NDArray[np.floating]:
        """The points, (N, 3)."""
        return self.values[:, :3]


def requested(name: str, wanted: str | None) -> tuple[str, str]:
    """Return the stored file and the format that a request names, such as ``merged.e57`` or ``mesh`` with "stl".

    Parameters
    ----------
    name : str
        Of the cloud, with or without the ending of a format; the ending is left aside where `wanted` is given.
    wanted : str, optional
        The format; PLY where neither says.

    Raises
    ------
    NotFoundError
        If the format is none of `media_types`.
    """
    stem, _, ending = name.rpartition(".")
    if not stem:
        stem, ending = name, "ply"
    wanted = (wanted or ending).lower()
    known = media_types()
    if wanted not in known:
        raise NotFoundError.unknown(wanted, known, "format")
    return f"{CLOUD_FOLDER}/{stem}.ply", wanted


def read_stored_ply(data: bytes, where: str) -> StoredCloud:
    """Return what a PLY file of this program holds.

    Raises
    ------
    InputError
        If it is cut off, or was written by another program.
    """
    layout = _layout(data[:_MAX_HEADER_BYTES], len(data), where)
    values = np.frombuffer(data, layout.kind, layout.points * layout.width, layout.start)
    values = values.reshape(layout.points, layout.width)
    if layout.faces is None:
        return StoredCloud(values, layout.names, None)
    return StoredCloud(values, layout.names, np.frombuffer(data, _FACE, layout.faces, layout.faces_at)["corners"])


@dataclass(frozen=True)
class _Layout:
    """Where what stands in a file: points with their columns, then faces, None in a cloud."""

    names: tuple[str, ...]
    points: int
    faces: int | None
    start: int
    kind: str

    @property
    def width(self) -> int:
        return len(self.names)

    @property
    def faces_at(self) -> int:
        return self.start + np.dtype(self.kind).itemsize * self.points * self.width


def _layout(head: bytes, size: int, where: str) -> _Layout:
    """Return the layout that a file's first bytes announce; raises InputError where its size is another."""
    end = head.find(b"end_header\n")
    lines = head[: max(end, 0)].decode("ascii", "replace").splitlines()
    if end < 0 or lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise _not_ours(where, message("something else"))
    vertices, names, faces, kinds = 0, list[str](), -1, set[str]()
    for line in lines[2:]:
        match line.split():
            case ["element", "vertex", count] if count.isdecimal():
                vertices = int(count)
            case ["element", "face", count] if count.isdecimal():
                faces = int(count)
            case ["property", "float" | "double" as kind, name] if faces < 0:
                names.append(name)
                kinds.add("<f4" if kind == "float" else "<f8")
            case ["comment", *_] | ["property", "list", "uchar", "int", "vertex_indices"]:
                continue
            case _:
                raise _not_ours(where, message("a line {line!r} in its header", line=line[:60]))
    if len(kinds) != 1:
        raise _not_ours(where, message("something else"))
    start = end + len(b"end_header\n")
    layout = _Layout(tuple(names), vertices, None if faces < 0 else faces, start, kinds.pop())
    expected = layout.faces_at + max(faces, 0) * _FACE.itemsize
    if size != expected or names[:3] != ["x", "y", "z"]:
        raise _not_ours(
            where, message("{size} bytes where its header announces {expected}", size=size, expected=expected)
        )
    return layout


class StoredFile:
    """A cloud or a mesh in a file of this program that is read in blocks, never as a whole.

    Parameters
    ----------
    file : binary file
        Open for reading, and kept open as long as it is read from.
    where : str
        Its name, for errors.

    Raises
    ------
    InputError
        If it is cut off, or was written by another program.
    """

    def __init__(self, file: IO[bytes], where: str) -> None:
        self._file, self._where = file, where
        size = file.seek(0, os.SEEK_END)
        file.seek(0)
        self._layout = _layout(file.read(_MAX_HEADER_BYTES), size, where)
        self.names, self.points, self.faces = self._layout.names, self._layout.points, self._layout.faces

    def bytes(self) -> Iterator[bytes]:
        """Give the file as it is."""
        self._file.seek(0)
        while piece := self._file.read(_BLOCK_BYTES):
            yield piece

    def tables(self) -> Iterator[NDArray[np.floating]]:
        """Give the points, a row each with all columns."""
        layout = self._layout
        return self._records(np.dtype((layout.kind, (layout.width,))), layout.start, layout.points)

    def triangles(self) -> Iterator[NDArray[np.int32]]:
        """Give the triangles of a mesh, (M, 3)."""
        for rows in self._records(_FACE, self._layout.faces_at, self._layout.faces or 0):
            yield rows["corners"]

    def corners(self) -> NDArray[np.floating]:
        """Return the corners (N, 3) of a mesh, which stay in the file until they are asked for."""
        layout = self._layout
        shape = (layout.points, layout.width)
        return np.memmap(self._file, layout.kind, "r", layout.start, shape)[:, :3]

    def _records(self, kind: np.dtype[Any], start: int, count: int) -> Iterator[NDArray[Any]]:
        block = max(_BLOCK_BYTES // kind.itemsize, 1)
        for first in range(0, count, block):
            many = min(block, count - first)
            self._file.seek(start + first * kind.itemsize)
            data = self._file.read(many * kind.itemsize)
            if len(data) != many * kind.itemsize:
                raise _not_ours(self._where, message("a file that became shorter while it was read"))
            yield np.frombuffer(data, kind, many)


def in_format(stored: StoredFile, wanted: str, where: str, scans: Sequence[ScanPlace] = ()) -> Pieces:
    """Give a cloud or a mesh in a format, in bounded memory; normals and sigmas go where the format has a place.

    So do the scans, where they are known: their numbers in the cloud count `scans`.

    Raises
    ------
    InputError
        If the format is for meshes and this is a cloud, or the other way round.
    """
    fitting = cloud_formats() if stored.faces is None else mesh_formats()
    if wanted not in fitting:
        if stored.faces is None:
            need = message("a cloud as {fitting:,}", fitting=list(fitting))
            to_do = message("Name one of these, or take the mesh.")
        else:
            need = message("a mesh as {fitting:,}", fitting=list(fitting))
            to_do = message("Name one of these, or take the cloud.")
        raise InputError(need, f"'{wanted}'", to_do, where)
    entry = FORMATS.get(wanted, where)
    if wanted == "ply":
        return stored.bytes()
    if entry.write_scans is not None and scans and SCAN_COLUMN in stored.names:
        return entry.write_scans(stored.tables, stored.names, scans)
    if stored.faces is None and entry.write_cloud is not None:
        return entry.write_cloud(stored.tables(), stored.points, stored.names)
    assert entry.write_mesh is not None
    return entry.write_mesh(stored.corners(), stored.triangles(), stored.faces or 0)


def _not_ours(where: str, got: str) -> InputError:
    return InputError("a cloud as scancell writes it", got, "Solve the session again.", where)
