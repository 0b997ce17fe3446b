"""Cleaning a cloud whose points have no known order: by the nearest neighbours in space."""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.fusion.clean_scan import BLANK, GRAZING, KEPT, STRAY, CleanOptions, CleanScan
from calib_core.fusion.scan import Scan

_NEIGHBOURS = 24
_BLOCK = 200_000
_SPARSE = 4.0


def clean_unordered(scan: Scan, options: CleanOptions) -> CleanScan:
    """Return a scan in T with normals by principal components of its points' 24 nearest neighbours.

    A point is a stray where its neighbours are `_SPARSE` times as far as is usual in the scan, or where it lies
    off their plane by more than `stray_cut` of the noise.  Mixed points cannot be told apart without a grid.
    """
    points = scan.points_in_laser_mm.astype(float)
    matrices = scan.turntable_from_laser
    moved = np.einsum("pij,pcj->pci", matrices[:, :3, :3], points) + matrices[:, None, :3, 3]
    rays = np.broadcast_to(scan.sight[:, None], moved.shape)
    there = np.isfinite(moved).all(axis=2)
    verdicts = np.full(there.shape, BLANK, np.uint8)
    normals = np.zeros(moved.shape, np.float32)
    cosines = np.ones(there.shape)
    verdicts[there], normals[there], cosines[there] = _judge(
        moved[there], rays[there], scan.point_sigma_mm, options
    )
    least = np.cos(np.deg2rad(options.grazing_deg))
    sigma = np.hypot(scan.point_sigma_mm / np.maximum(cosines, least), scan.position_sigma_mm)
    return CleanScan(
        scan.name, moved.astype(np.float32), normals, verdicts, sigma.astype(np.float32), scan.point_sigma_mm, 0.0
    )


def _judge(
    points: FloatArray, rays: FloatArray, sigma_mm: float, options: CleanOptions
) -> tuple[NDArray[np.uint8], FloatArray, FloatArray]:
    """Return verdict, normal and cosine of incidence of points (N, 3)."""
    from scipy.spatial import KDTree

    count = min(_NEIGHBOURS, len(points) - 1)
    verdicts = np.full(len(points), STRAY, np.uint8)
    normals = np.zeros((len(points), 3))
    cosines = np.zeros(len(points))
    if count < options.fewest_neighbours:
        return verdicts, normals, cosines
    tree = KDTree(points)
    far = np.empty(len(points))
    off2 = np.empty(len(points))
    for start in range(0, len(points), _BLOCK):
        part = slice(start, start + _BLOCK)
        distances, found = (np.asarray(a) for a in tree.query(points[part], k=count + 1))
        far[part] = distances[:, count // 2]
        around = points[found[:, 1:]]
        middle = around.mean(axis=1)
        spread = around - middle[:, None]
        values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", spread, spread) / (count - 2))
        normal = vectors[:, :, 0]
        cosine = np.einsum("ni,ni->n", normal, rays[part])
        normals[part] = -np.sign(cosine)[:, None] * normal
        cosines[part] = np.abs(cosine)
        offset = np.einsum("ni,ni->n", normal, points[part] - middle)
        off2[part] = offset**2 / np.maximum(values[:, 0], sigma_mm**2)
    believed = (far <= _SPARSE * np.median(far)) & (off2 <= options.stray_cut**2)
    verdicts[believed] = KEPT
    verdicts[believed & (cosines < np.cos(np.deg2rad(options.grazing_deg)))] = GRAZING
    return verdicts, normals, cosines
