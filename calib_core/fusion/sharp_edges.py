"""Where a nominal turns so sharply that the mean of a voxel's points lies on none of its faces.

A mean across an edge of 90° lies up to a quarter of the voxel inside of it, however well the points are measured:
that is no deviation of the part.
"""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

_SHARP_RAD = 0.35  # between two faces: a mean across them is off by less than a twentieth of a voxel below that
_WITHIN_A_VOXEL_RAD = 0.8  # of many small faces: a radius of 1.3 voxels


def near_sharp_edges(
    points_mm: NDArray[np.floating], corners_mm: FloatArray, triangles: NDArray[np.integer], voxel_mm: float
) -> NDArray[np.bool_]:
    """Return which points (N, 3) lie within a voxel of an edge of a mesh, or of a rounding smaller than that.

    Parameters
    ----------
    points_mm : (N, 3)
    corners_mm : (C, 3)
        In the points' own frame.
    triangles : (M, 3) int
    voxel_mm : float
    """
    from scipy.spatial import KDTree

    places = _places(*_sharp(corners_mm, triangles, voxel_mm), voxel_mm / 2)
    if not len(places):
        return np.zeros(len(points_mm), dtype=bool)
    reach_mm = float(np.hypot(voxel_mm, voxel_mm / 4))  # of places half a voxel apart
    apart_mm, _ = KDTree(places).query(points_mm, distance_upper_bound=reach_mm)
    return np.isfinite(apart_mm)


def _sharp(
    corners_mm: FloatArray, triangles: NDArray[np.integer], voxel_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return both ends (E, 3) of the edges at which a mesh turns sharply, within a voxel at most."""
    corners, which = np.unique(corners_mm, axis=0, return_inverse=True)  # an STL names each corner in each face
    faces = which.ravel()[triangles]
    across = np.cross(corners[faces[:, 1]] - corners[faces[:, 0]], corners[faces[:, 2]] - corners[faces[:, 0]])
    area2 = np.linalg.norm(across, axis=1)
    normals = across / np.maximum(area2, 1e-12)[:, None]
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owners = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, owners = ends[order], owners[order]
    twice = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1))
    a, b, ends = owners[twice], owners[twice + 1], ends[twice]
    turning = np.arccos(np.clip((normals[a] * normals[b]).sum(axis=1), -1.0, 1.0))
    length = np.linalg.norm(corners[ends[:, 1]] - corners[ends[:, 0]], axis=1)
    width = (area2[a] + area2[b]) / np.maximum(2 * length, 1e-12)  # between the middles of both faces' heights
    bent = turning * np.minimum(voxel_mm / np.maximum(width, 1e-12), 1e6) > _WITHIN_A_VOXEL_RAD
    sharp = (area2[a] > 0) & (area2[b] > 0) & ((turning > _SHARP_RAD) | bent)
    return corners[ends[sharp, 0]], corners[ends[sharp, 1]]


def _places(first: FloatArray, last: FloatArray, step_mm: float) -> FloatArray:
    """Return places (P, 3) along lines, `step_mm` apart at most, each line's ends among them."""
    parts = np.maximum(1, np.ceil(np.linalg.norm(last - first, axis=1) / step_mm).astype(np.int64))
    line = np.repeat(np.arange(len(first)), parts + 1)
    begun = np.repeat(np.cumsum(parts + 1) - (parts + 1), parts + 1)
    share = ((np.arange(len(line)) - begun) / parts[line])[:, None]
    return first[line] + share * (last - first)[line]
