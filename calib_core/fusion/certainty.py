"""How well the merged surface stands where it is: what calibration and scans' own errors leave uncertain of it."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.fusion.overlap import Patches, PoseErrors


def surface_sigma_mm(seen: Patches, errors: PoseErrors) -> float:
    """Return the standard deviation of a scan's surface along its normal, as it stands in T: RMS over all, mm.

    The mean of scans that overlap is better; but voxels smaller than the scans' distances sort them by distance,
    so this is what a merged point is off.

    Parameters
    ----------
    seen : Patches
        The scans' means in voxels.
    errors : PoseErrors
    """
    levers = _levers(seen.points_mm, seen.normals)
    variance = seen.variances_mm2.copy()
    for mine, common, own in zip(seen.rows_of_scans(), errors.common, errors.own, strict=True):
        variance[mine] += ((levers[mine] @ common) ** 2).sum(axis=1)
        variance[mine] += np.einsum("ni,ij,nj->n", levers[mine], own, levers[mine])
    return float(np.sqrt(variance.mean())) if len(variance) else float("nan")


def sphere_covariance(seen: Patches, errors: PoseErrors, center_mm: FloatArray) -> FloatArray:
    """Return the covariance (4, 4) of centre and radius, mm, of a sphere fitted to merged points, all alike.

    A voxel's point is the mean of what the scans saw of it, each by its weight; so is its error, the scans' moves
    along the normal.  Errors that scans share do not average out.

    Parameters
    ----------
    seen : Patches
        Of the sphere alone.
    errors : PoseErrors
    center_mm : (3,)
        About where the sphere is.
    """
    counts = np.diff(seen.bounds)
    voxels = np.repeat(np.arange(len(counts)), counts)
    weights = 1 / seen.variances_mm2
    shares = weights / np.add.reduceat(weights, seen.bounds[:-1])[voxels]
    points = np.add.reduceat(shares[:, None] * seen.points_mm, seen.bounds[:-1])
    outward = points - center_mm
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    jacobian = np.column_stack([outward, np.ones(len(outward))])
    gain = np.linalg.solve(jacobian.T @ jacobian, jacobian.T)[:, voxels] * shares
    levers = _levers(points, outward)[voxels]
    by_scan = np.stack([gain[:, seen.scans == s] @ levers[seen.scans == s] for s in range(len(errors.own))])
    common = np.einsum("sim,smd->id", by_scan, errors.common)
    covariance = common @ common.T + np.einsum("sim,smn,sjn->ij", by_scan, errors.own, by_scan)
    return covariance + (gain * seen.variances_mm2) @ gain.T


def _levers(points_mm: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how points move along their normals with a move ω, v about T's origin, (N, 6): (p × n, n)."""
    return np.concatenate([np.cross(points_mm, normals), normals], axis=1)
