"""Meshes from other programs, as a reference to compare with."""

import numpy as np

from calib_core.errors import InputError
from calib_core.formats.shared.mesh import MeshData, wrong
from calib_core.messages import message


def parse_mesh(data: bytes, name: str) -> MeshData:
    """Return the triangles of a file in one of the formats that hold meshes, such as STL and PLY.

    Raises
    ------
    InputError
        If the file is none of them, is cut off, or has no triangles.
    TooLargeError
        If there are more than `shared.mesh.MAX_TRIANGLES`.
    """
    from calib_core.formats.points import FORMATS

    found = [(entry.recognise(data, name).sure, entry) for entry in FORMATS if entry.read_mesh]
    sure, entry = max(found, key=lambda each: each[0])
    if not sure or entry.read_mesh is None:
        titles = sorted((entry.name.upper() for _, entry in found), reverse=True)
        got = f"'.{name.rsplit('.', 1)[-1]}'" if "." in name else message("no ending")
        raise InputError("a mesh as {titles:or}", got, "Export it in one of these formats.", name, titles=titles)
    mesh = entry.read_mesh(data, name)
    if not len(mesh.triangles):
        raise wrong(name, message("no triangle"), message("Export a mesh, not a cloud."))
    if not np.isfinite(mesh.corners_mm).all():
        raise wrong(name, message("corners that are not finite numbers"))
    if mesh.triangles.min() < 0 or mesh.triangles.max() >= len(mesh.corners_mm):
        raise wrong(name, message("triangles with corners that are not there"))
    return mesh
