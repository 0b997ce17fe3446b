"""OBJ (Wavefront): meshes in text, read and written; in mm, which the format cannot say but in a comment."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib_core.formats.format import Format, Match, Pieces, by_ending
from calib_core.formats.shared.mesh import MeshData, require_few, wrong
from calib_core.formats.shared.writing import BLOCK, faces_of
from calib_core.messages import message


def recognise(data: bytes, name: str) -> Match:
    """Return how sure it is that a file is OBJ: by its ending."""
    del data
    return by_ending(name, FORMAT.endings)


def parse_obj(data: bytes, name: str) -> MeshData:
    """Return the triangles of an OBJ file; faces of more corners are cut into triangles.  Raises InputError."""
    corners: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    require_few(data.count(b"\nf "), name)
    for number, line in enumerate(data.splitlines(), start=1):
        words = line.split()
        try:
            if words[:1] == [b"v"]:
                corners.append([float(word) for word in words[1:4]])
            elif words[:1] == [b"f"]:
                ring = [int(word.split(b"/")[0]) for word in words[1:]]
                ring = [index - 1 if index > 0 else len(corners) + index for index in ring]
                triangles += [(ring[0], b, c) for b, c in pairwise(ring[1:])]
        except ValueError:
            raise wrong(name, message("a line {number} that is no corner or face", number=number)) from None
    if not corners or any(len(corner) != 3 for corner in corners):
        raise wrong(name, "corners without x, y and z")
    faces = np.array(triangles, np.float64).reshape(-1, 3)  # numbers of any size: which are corners is asked later
    return MeshData(np.array(corners, float), np.clip(faces, -1, len(corners)).astype(np.int32))


def obj_pieces(points_mm: NDArray[np.floating], blocks: Iterable[ArrayLike], count: int) -> Pieces:
    """Give an OBJ file of points (N, 3) in mm and triangles that come in blocks (M, 3).

    Raises
    ------
    InputError
        If there are no triangles, or one names a point that is not there.
    """
    del count
    yield b"# scancell mesh, mm\n"
    for start in range(0, len(points_mm), BLOCK):
        rows = points_mm[start : start + BLOCK].astype(np.float64)
        yield ("v %.6f %.6f %.6f\n" * len(rows) % tuple(rows.ravel().tolist())).encode()
    for triangles in blocks:
        faces = faces_of(triangles, len(points_mm)) + 1
        yield ("f %d %d %d\n" * len(faces) % tuple(faces.ravel().tolist())).encode()


FORMAT = Format(
    name="obj",
    title="OBJ (Wavefront)",
    endings=(".obj",),
    kinds=("mesh",),
    recognise=recognise,
    media_type="model/obj",
    read_mesh=parse_obj,
    write_mesh=obj_pieces,
)
