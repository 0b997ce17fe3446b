"""Stored clouds and meshes: read back as they were written, given in the formats of other programs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError, NotFoundError
from calib_core.session.e57_writer import e57_pieces
from calib_core.session.point_writers import Pieces, pcd_pieces, ply_pieces, stl_pieces, xyz_pieces

CLOUD_FOLDER: Final = "clouds"
CLOUD_FILE: Final = f"{CLOUD_FOLDER}/merged.ply"
MESH_FILE: Final = f"{CLOUD_FOLDER}/mesh.ply"
REFERENCE_FILE: Final = f"{CLOUD_FOLDER}/reference.ply"
"""The mesh that says what the object should be: the user's, not a stage's."""

SCAN_COLUMN: Final = "scan"
"""The number of the scan that weighs most around a point, by `MergeResult.scan_names`; −1 where none does."""

MEDIA_TYPES: Final[Mapping[str, str]] = {
    "ply": "model/ply",
    "pcd": "application/octet-stream",
    "xyz": "text/plain",
    "e57": "model/e57",
    "stl": "model/stl",
}
"""Of each format that clouds and meshes are given in."""

OF_CLOUDS: Final = ("ply", "pcd", "xyz", "e57")
OF_MESHES: Final = ("ply", "stl")

_MAX_HEADER_BYTES = 4000
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])


@dataclass(frozen=True, eq=False)
class StoredCloud:
    """A cloud or a mesh as `point_writers.ply_pieces` wrote it.

    Parameters
    ----------
    values : (N, K) float32
        A row a point.
    names : tuple of K str
        x, y, z in mm, and what else there is.
    triangles : (M, 3) int32 or None
        Of a mesh.
    """

    values: NDArray[np.float32]
    names: tuple[str, ...]
    triangles: NDArray[np.int32] | None

    @property
    def scans(self) -> NDArray[np.int64] | None:
        """The number (N,) of the scan that weighs most around each point; None where the file does not say."""
        return (
            self.values[:, self.names.index(SCAN_COLUMN)].astype(np.int64) if SCAN_COLUMN in self.names else None
        )

    @property
    def points_mm(self) -> NDArray[np.float32]:
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
        If the format is none of `MEDIA_TYPES`.
    """
    stem, _, ending = name.rpartition(".")
    if not stem:
        stem, ending = name, "ply"
    wanted = (wanted or ending).lower()
    if wanted not in MEDIA_TYPES:
        raise NotFoundError(
            "a format among " + ", ".join(MEDIA_TYPES), repr(wanted[:40]), "Name one of these.", "format"
        )
    return f"{CLOUD_FOLDER}/{stem}.ply", wanted


def read_stored_ply(data: bytes, where: str) -> StoredCloud:
    """Return what a PLY file of this program holds.

    Raises
    ------
    InputError
        If it is cut off, or was written by another program.
    """
    end = data.find(b"end_header\n", 0, _MAX_HEADER_BYTES)
    lines = data[: max(end, 0)].decode("ascii", "replace").splitlines()
    if end < 0 or lines[:2] != ["ply", "format binary_little_endian 1.0"]:
        raise _not_ours(where, "another file")
    vertices, names, faces = 0, list[str](), -1
    for line in lines[2:]:
        match line.split():
            case ["element", "vertex", count] if count.isdecimal():
                vertices = int(count)
            case ["element", "face", count] if count.isdecimal():
                faces = int(count)
            case ["property", "float", name] if faces < 0:
                names.append(name)
            case ["comment", *_] | ["property", "list", "uchar", "int", "vertex_indices"]:
                continue
            case _:
                raise _not_ours(where, f"a line {line[:60]!r} in its header")
    start = end + len(b"end_header\n")
    size = 4 * vertices * len(names)
    expected = start + size + max(faces, 0) * _FACE.itemsize
    if len(data) != expected or names[:3] != ["x", "y", "z"]:
        raise _not_ours(where, f"{len(data)} bytes where its header announces {expected}")
    values = np.frombuffer(data, "<f4", vertices * len(names), start).reshape(vertices, len(names))
    if faces < 0:
        return StoredCloud(values, tuple(names), None)
    records = np.frombuffer(data, _FACE, faces, start + size)
    return StoredCloud(values, tuple(names), records["corners"])


def in_format(stored: StoredCloud, wanted: str, where: str) -> Pieces:
    """Give a cloud or a mesh in a format; normals and sigmas go where the format has a place for them.

    Raises
    ------
    InputError
        If the format is for meshes and this is a cloud, or the other way round.
    """
    fitting = OF_CLOUDS if stored.triangles is None else OF_MESHES
    if wanted not in fitting:
        what, other = ("a cloud", "the mesh") if stored.triangles is None else ("a mesh", "the cloud")
        need = f"{what} as " + ", ".join(fitting)
        raise InputError(need, f"'{wanted}'", f"Name one of these, or take {other}.", where)
    match wanted:
        case "pcd":
            return pcd_pieces(stored.values, stored.names)
        case "xyz":
            return xyz_pieces(stored.points_mm)
        case "e57":
            return e57_pieces(stored.points_mm)
        case "stl":
            assert stored.triangles is not None
            return stl_pieces(stored.points_mm, stored.triangles)
        case _:
            return ply_pieces(stored.values, stored.names, stored.triangles)


def _not_ours(where: str, got: str) -> InputError:
    return InputError("a cloud as scancell writes it", got, "Solve the merge stage again.", where)
