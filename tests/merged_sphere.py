"""How well a sphere stands that was fitted to merged points, by what calibration and scans leave uncertain."""

import numpy as np

from calib_core.frames import FloatArray
from calib_core.fusion.overlap import Patches, PoseErrors


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
    levers = np.concatenate([np.cross(points, outward), outward], axis=1)[voxels]
    by_scan = np.stack([gain[:, seen.scans == s] @ levers[seen.scans == s] for s in range(len(errors.own))])
    common = np.einsum("sim,smd->id", by_scan, errors.common)
    covariance = common @ common.T + np.einsum("sim,smn,sjn->ij", by_scan, errors.own, by_scan)
    return covariance + (gain * seen.variances_mm2) @ gain.T
