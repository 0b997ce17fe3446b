"""What a mesh is made ready by: open edges counted, holes closed, flat places of few triangles."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from calib_core.fusion.merge import VoxelCloud
from calib_core.fusion.mesh import Mesh
from calib_core.lean_open3d import open3d

if TYPE_CHECKING:
    import open3d as o3d

_FIRST_ERROR = 4.0  # of the tolerance's square times a triangle's area, over which Open3D sums a corner's errors
_MOST_ROUNDS = 8
_MOST_MENDED = 5

_FLAT, _BENT = 0.98, 0.95  # mean lengths of a voxel's normals: of a plane, of a sharp edge at most
_BESIDE, _REACH, _FARTHEST = 1.5, 2.5, 0.75  # voxels: from an edge, of the planes around, that a corner moves
_PLANES, _TWO_PLANES, _ALONG = 32, 0.05, 0.05


def open_edges(triangles: NDArray[np.int32]) -> int:
    """Return how many edges do not belong to just two triangles that run along them in opposite directions."""
    single, paired = _edges(triangles)
    return int(np.count_nonzero(~(single & paired)))


def _edges(triangles: NDArray[np.int32]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return of each triangle's three edges (M, 3) whether none runs alike, and whether just one runs back."""
    if not len(triangles):
        return np.zeros((0, 3), bool), np.zeros((0, 3), bool)
    start, end = triangles.astype(np.int64), np.roll(triangles, -1, axis=1).astype(np.int64)
    forward, backward = start << 32 | end, end << 32 | start
    there, counts = np.unique(forward, return_counts=True)
    single = counts[np.searchsorted(there, forward)] == 1
    at = np.minimum(np.searchsorted(there, backward), len(there) - 1)
    return single, (there[at] == backward) & (counts[at] == 1)


def closed(mesh: Mesh) -> Mesh:
    """Return a mesh whose holes are filled: each ring of open edges by triangles about its middle."""
    for _ in range(_MOST_MENDED):
        single, paired = _edges(mesh.triangles)
        sound = single.all(axis=1)
        if sound.all() and paired.all():
            break
        if not sound.all():  # where more than two meet in an edge
            mesh = Mesh(mesh.points_mm, mesh.triangles[sound])
            _, paired = _edges(mesh.triangles)
        mesh = _filled(mesh, paired)
    return _used(mesh)


def _filled(mesh: Mesh, paired: NDArray[np.bool_]) -> Mesh:
    ends = np.roll(mesh.triangles, -1, axis=1)
    rings = _rings(ends[~paired].tolist(), mesh.triangles[~paired].tolist())
    points, triangles = [mesh.points_mm], [mesh.triangles]
    for number, ring in enumerate(rings):
        middle = np.full(len(ring), len(mesh.points_mm) + number)
        points.append(mesh.points_mm[ring].mean(axis=0, keepdims=True))
        triangles.append(np.column_stack([ring, np.roll(ring, -1), middle]).astype(np.int32))
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def _rings(starts: list[int], ends: list[int]) -> list[list[int]]:
    """Return edges put together as rings, none of which passes a corner twice."""
    following: dict[int, list[int]] = {}
    for start, end in zip(starts, ends, strict=True):
        following.setdefault(start, []).append(end)
    rings: list[list[int]] = []
    for first in list(following):
        path, place = [first], {first: 0}
        while path and following.get(path[-1]):
            corner = following[path[-1]].pop()
            if corner in place:
                rings.append(path[place[corner] :])
                for passed in path[place[corner] + 1 :]:
                    del place[passed]
                path = path[: place[corner] + 1]
            else:
                place[corner] = len(path)
                path.append(corner)
    return [ring for ring in rings if len(ring) > 2]


def sharpened(mesh: Mesh, cloud: VoxelCloud, voxel_mm: float) -> Mesh:
    """Return a mesh whose corners beside a sharp edge lie where the planes around meet: Poisson rounds edges off.

    A corner goes where planes through the flat places near it are nearest to it, and hardly along them.
    """
    from scipy.spatial import KDTree

    flat, bent = cloud.coherence > _FLAT, cloud.coherence < _BENT
    if np.count_nonzero(flat) < _PLANES or not bent.any():
        return mesh
    far, _ = KDTree(cloud.points_mm[bent]).query(mesh.points_mm, distance_upper_bound=_BESIDE * voxel_mm)
    rows = np.flatnonzero(np.isfinite(far))
    moved, places, normals = mesh.points_mm.astype(float), cloud.points_mm[flat], cloud.normals[flat]
    far, near = KDTree(places).query(moved[rows], k=_PLANES, distance_upper_bound=_REACH * voxel_mm)
    there = np.isfinite(far)
    weights = np.where(there, np.exp(-0.5 * (np.where(there, far, 0.0) / voxel_mm) ** 2), 0.0)
    weights /= np.maximum(weights.sum(axis=1, keepdims=True), 1e-12)
    near = np.where(there, near, 0)
    across, off = normals[near].astype(float), places[near] - moved[rows, None]
    planes = np.einsum("nk,nki,nkj->nij", weights, across, across)
    pulled = np.einsum("nk,nki,nk->ni", weights, across, np.einsum("nki,nki->nk", across, off))
    steps = np.linalg.solve(planes + _ALONG * np.eye(3), pulled[..., None])[..., 0]
    steps[np.linalg.eigvalsh(planes)[:, 1] < _TWO_PLANES] = 0.0
    lengths = np.linalg.norm(steps, axis=1, keepdims=True)
    moved[rows] += steps * np.minimum(1.0, _FARTHEST * voxel_mm / np.maximum(lengths, 1e-12))
    return Mesh(moved.astype(np.float32), mesh.triangles)


def thinned(mesh: Mesh, tolerance_mm: float) -> Mesh:
    """Return a mesh of fewer triangles, none of whose places, nor of the former's, lies off by more."""
    theirs = _legacy(mesh)
    error = _FIRST_ERROR * tolerance_mm**2 * theirs.get_surface_area() / max(len(mesh.triangles), 1)
    for _ in range(_MOST_ROUNDS):
        fewer = _of(theirs.simplify_quadric_decimation(4, maximum_error=error, boundary_weight=10.0))
        if len(fewer.triangles) and _apart_mm(mesh, fewer) <= tolerance_mm:
            return fewer
        error /= 3
    return mesh


def _apart_mm(one: Mesh, other: Mesh) -> float:
    """Return the largest distance of either one's corners, and middles of triangles, from the other."""
    return max(_farthest_mm(one, other), _farthest_mm(other, one))


def _farthest_mm(points_of: Mesh, surface: Mesh) -> float:
    o3d = open3d()
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(np.ascontiguousarray(surface.points_mm)),
        o3d.core.Tensor(surface.triangles.astype(np.uint32)),
    )
    middles = points_of.points_mm[points_of.triangles].mean(axis=1)
    places = np.concatenate([points_of.points_mm, middles]).astype(np.float32)
    return float(scene.compute_distance(o3d.core.Tensor(places)).numpy().max())


def _legacy(mesh: Mesh) -> "o3d.geometry.TriangleMesh":
    o3d = open3d()
    return o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(mesh.points_mm.astype(float)), o3d.utility.Vector3iVector(mesh.triangles)
    )


def _of(theirs: "o3d.geometry.TriangleMesh") -> Mesh:
    return Mesh(np.asarray(theirs.vertices).astype(np.float32), np.asarray(theirs.triangles).astype(np.int32))


def _used(mesh: Mesh) -> Mesh:
    """Return a mesh without corners that no triangle has."""
    kept, triangles = np.unique(mesh.triangles, return_inverse=True)
    return Mesh(mesh.points_mm[kept], triangles.reshape(-1, 3).astype(np.int32))
