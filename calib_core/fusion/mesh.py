"""Meshes: each scan's own grid as triangles, and one closed-up surface over the merged cloud (Poisson)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.fusion.clean_scan import KEPT, CleanScan
from calib_core.fusion.merge import VoxelCloud
from calib_core.lean_open3d import open3d
from calib_core.messages import message

_FEWEST_POINTS = 50
_MARGIN = 1.1  # of the octree's cube over the points
_REACH, _REACH_OVER_HOLES = 2.5, 10.0  # voxels from every point


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles in T, counter-clockwise seen from outside.

    Parameters
    ----------
    points_mm : (N, 3) float32
    triangles : (M, 3) int32
    """

    points_mm: NDArray[np.float32]
    triangles: NDArray[np.int32]


def joined(sheets: Sequence[Mesh]) -> Mesh:
    """Return the scans' sheets as one mesh; raises MeasurementError where there is no triangle at all."""
    points = np.concatenate([s.points_mm for s in sheets])
    offsets = np.cumsum([0, *(len(s.points_mm) for s in sheets)])[:-1]
    triangles = np.concatenate([s.triangles + offset for s, offset in zip(sheets, offsets, strict=True)])
    if not len(triangles):
        to_do = message("Scan in rows of at least two profiles, or use the Poisson mesh.")
        raise MeasurementError("scans with neighbouring points in rows", "none", to_do)
    return Mesh(points, triangles.astype(np.int32))


def turned_round(mesh: Mesh) -> Mesh:
    """Return a mesh whose outside is what was its inside."""
    return Mesh(mesh.points_mm, mesh.triangles[:, [0, 2, 1]])


def sheet(scan: CleanScan) -> Mesh:
    """Return one scan's rows and columns as triangles; none without a grid."""
    points, triangles = _points_and_triangles(scan)
    return Mesh(points, triangles.astype(np.int32))


def _points_and_triangles(scan: CleanScan) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    kept = scan.verdicts == KEPT
    rows, columns = kept.shape
    number = np.full(kept.shape, -1)
    number[kept] = np.arange(np.count_nonzero(kept))
    points = scan.points_in_turntable_mm[kept]
    none = np.empty((0, 3), dtype=np.int64)
    if scan.reach_mm == 0 or min(rows, columns) < 2:
        return points, none
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1]
    # Each cell by its diagonal a-c, or by b-d where a or c is missing.
    diagonal = (a >= 0) & (c >= 0)
    candidates = [(a, b, c, diagonal), (a, c, d, diagonal), (a, b, d, ~diagonal), (b, c, d, ~diagonal)]
    found = [
        np.stack([p, q, r], axis=-1)[use & (p >= 0) & (q >= 0) & (r >= 0)].reshape(-1, 3)
        for p, q, r, use in candidates
    ]
    triangles = np.concatenate(found)
    if not len(triangles):
        return points, none
    corners = points[triangles].astype(float)
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("ni,ni->n", normals, scan.normals[kept][triangles[:, 0]].astype(float))
    # Rows that run the other way turn every triangle over: the majority says which way round is outside.
    if np.median(outward) < 0:
        triangles, outward = triangles[:, [0, 2, 1]], -outward
    return points, triangles[(edges < np.sqrt(2) * scan.reach_mm) & (outward > 0)]


def poisson_mesh(cloud: VoxelCloud, voxel_mm: float, over_holes: bool = False) -> Mesh:
    """Return one surface over a merged cloud (screened Poisson, Open3D), without what it invents far from points.

    Parameters
    ----------
    cloud : VoxelCloud
        With normals.
    voxel_mm : float
        The cloud's spacing: surface farther than 2.5 of it from every point is cut away.
    over_holes : bool
        Whether it may go 10 of it away from points, so that holes of 20 close smoothly.

    Raises
    ------
    MeasurementError
        If the cloud has too few points with normals.
    """
    from scipy.spatial import KDTree

    o3d = open3d()
    good = np.isfinite(cloud.normals).all(axis=1) if len(cloud.normals) else np.zeros(len(cloud), dtype=bool)
    if np.count_nonzero(good) < _FEWEST_POINTS:
        got = f"{np.count_nonzero(good)}"
        need = "at least {fewest_points} points with normals"
        raise MeasurementError(need, got, "Merge more scans.", fewest_points=_FEWEST_POINTS)
    points: FloatArray = cloud.points_mm[good].astype(float)
    extent = float(np.ptp(points, axis=0).max())
    depth = int(np.clip(np.ceil(np.log2(_MARGIN * extent / voxel_mm)), 4, 10))
    theirs = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    theirs.normals = o3d.utility.Vector3dVector(cloud.normals[good].astype(float))
    # A cube whose finest cells are the voxels: smaller ones take up to twice as long and tell nothing more.
    scale = max(_MARGIN, voxel_mm * 2**depth / extent)
    surface, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
        theirs, depth=depth, scale=scale, n_threads=1
    )
    vertices = np.asarray(surface.vertices)
    far, _ = KDTree(points).query(
        vertices, distance_upper_bound=(_REACH_OVER_HOLES if over_holes else _REACH) * voxel_mm
    )
    surface.remove_vertices_by_mask((~np.isfinite(np.asarray(far))).tolist())
    return Mesh(np.asarray(surface.vertices).astype(np.float32), np.asarray(surface.triangles).astype(np.int32))
