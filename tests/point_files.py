"""Points and meshes of tests as files, by the writers that the formats register."""

import numpy as np
from numpy.typing import ArrayLike

from calib_core.formats.format import Pieces, ending_of
from calib_core.formats.points import FORMATS
from calib_core.formats.shared.writing import XYZ, table_of


def cloud_pieces(name: str, points_mm: ArrayLike, names: tuple[str, ...] = XYZ) -> Pieces:
    """Give the file of a cloud (N, K) in the format that the file's name ends in."""
    writers = {ending: entry.write_cloud for entry in FORMATS if entry.write_cloud for ending in entry.endings}
    table = table_of(points_mm, names)
    return writers[ending_of(name)]([table], len(table), names)


def mesh_file(name: str, points_mm: ArrayLike, triangles: ArrayLike) -> bytes:
    """Return the file of a mesh, points (N, 3) in mm and triangles (M, 3) of indices, in the named format."""
    write = FORMATS.get(name).write_mesh
    assert write is not None
    faces = np.asarray(triangles)
    return b"".join(bytes(piece) for piece in write(np.asarray(points_mm, np.float32), [faces], len(faces)))
