"""STL: triangle meshes, binary and text."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.formats.format import NO_MATCH, Format, Match, Pieces, by_ending
from calib_core.formats.shared.mesh import MeshData, require_few, wrong
from calib_core.formats.shared.writing import faces_of, number_type
from calib_core.frames import FloatArray
from calib_core.messages import message, plural

_RECORD = np.dtype([("normal", "<f4", (3,)), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_FACET = "facet normal %.6g %.6g %.6g\nouter loop\n" + "vertex %.6f %.6f %.6f\n" * 3 + "endloop\nendfacet\n"
_HEADER = 84


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is STL."""
    if data.lstrip()[:5] == b"solid" and b"facet" in data[:2000]:
        return Match(0.9, "begins with 'solid'")
    if by_ending(name, FORMAT.endings).sure:
        return by_ending(name, FORMAT.endings)
    count = int.from_bytes(data[80:84], "little") if len(data) >= _HEADER else 0
    whole = count and len(data) == _HEADER + count * _RECORD.itemsize
    return Match(0.8, message("has the size of {count} triangles", count=count)) if whole else NO_MATCH


def parse_stl(data: bytes, name: str) -> MeshData:
    """Return the triangles of an STL file; raises InputError."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= _HEADER else -1
    if count >= 0 and len(data) == _HEADER + count * _RECORD.itemsize:
        require_few(count, name)
        corners = np.frombuffer(data, _RECORD, count, _HEADER)["corners"]
    elif data.lstrip()[:5] == b"solid":
        corners = _text_corners(data, name)
    else:
        got = plural(
            "{count} byte where {count_other} triangles are announced",
            "{count} bytes where {count_other} triangles are announced",
            by="count",
            count=len(data),
            count_other=max(count, 0),
        )
        raise wrong(name, got)
    flat = np.ascontiguousarray(corners.reshape(-1, 3))
    return MeshData(flat, np.arange(len(flat), dtype=np.int32).reshape(-1, 3))


def _text_corners(data: bytes, name: str) -> FloatArray:
    require_few(data.count(b"vertex") // 3, name)
    words = [line.split()[1:] for line in data.splitlines() if line.lstrip().startswith(b"vertex")]
    try:
        corners = np.array(words, dtype=float)
    except ValueError:
        raise wrong(name, message("a corner that is not three numbers")) from None
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) % 3:
        raise wrong(name, message("a triangle without three corners"))
    return corners.reshape(-1, 3, 3)


def stl_pieces(points_mm: NDArray[np.floating], blocks: Iterable[ArrayLike], count: int) -> Pieces:
    """Give an STL file of points (N, 3) and triangles that come in blocks (M, 3), `count` in all.

    It is binary; far from zero, where single precision does not do, text.

    Raises
    ------
    InputError
        If there are no triangles, or one names a point that is not there.
    """
    if number_type(points_mm) == "<f8":
        yield b"solid scancell mesh, mm\n"
        for triangles in blocks:
            corners = points_mm[faces_of(triangles, len(points_mm))]
            rows = np.concatenate([_normals(corners)[:, None], corners], axis=1).reshape(-1, 12)
            yield (_FACET * len(rows) % tuple(rows.ravel().tolist())).encode()
        yield b"endsolid scancell mesh, mm\n"
        return
    yield b"scancell mesh, mm".ljust(80) + count.to_bytes(4, "little")
    for triangles in blocks:
        yield _stl_records(points_mm[faces_of(triangles, len(points_mm))])


def _normals(corners: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return the normals (M, 3) of triangles (M, 3, 3)."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(lengths > 0, lengths, 1)


def _stl_records(corners: NDArray[np.floating]) -> bytes:
    """Return the records of triangles (M, 3, 3)."""
    records = np.zeros(len(corners), dtype=_RECORD)
    records["normal"] = _normals(corners)
    records["corners"] = corners
    return records.tobytes()


FORMAT = Format(
    name="stl",
    title="STL mesh",
    endings=(".stl",),
    kinds=("mesh",),
    recognise=recognise,
    media_type="model/stl",
    read_mesh=parse_stl,
    write_mesh=stl_pieces,
    proof="real files",
)
