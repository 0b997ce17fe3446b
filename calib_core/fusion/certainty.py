"""How well the merged surface stands where it is: what calibration and scans' own errors leave uncertain of it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, skew
from calib_core.fusion.datums import Feature, seen_by
from calib_core.fusion.overlap import Patches, PoseErrors

_MOST_NUMBERS = 20_000_000
_FEWEST = 10


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


@dataclass(frozen=True, eq=False)
class AgainstNominal:
    """What calibration and scans leave uncertain where the merged points are compared with a nominal.

    Parameters
    ----------
    covariance : (6, 6)
        Of the nominal's place: rx ry rz tx ty tz, the rotation on the right, the translation added.
    deviation_sigma_mm : float
        Of a point's deviation after the alignment, RMS over all.
    """

    covariance: FloatArray
    deviation_sigma_mm: float


def against_nominal(
    seen: Patches,
    errors: PoseErrors,
    cloud_from_reference: FloatArray,
    aligned: bool,
    datums: Sequence[Feature] = (),
    noise_mm2: float = 0.0,
) -> AgainstNominal:
    """Return how uncertain the nominal's place and the deviations from it are.

    Parameters
    ----------
    seen : Patches
    errors : PoseErrors
    cloud_from_reference : (4, 4)
    aligned : bool
        The nominal follows the points; one that lies where it was told takes up nothing of their errors.
    datums : sequence of Feature, optional
        What it goes by, in the nominal's frame; all over if left out.
    noise_mm2 : float
        Mean variance of the merged points by noise alone.
    """
    rows = np.flatnonzero(seen.normals.any(axis=1))
    scans, shared = len(seen.names), errors.common.shape[2]
    rows = rows[:: max(1, len(rows) * (shared + 6 * scans) // _MOST_NUMBERS)]
    if len(rows) < _FEWEST:
        return AgainstNominal(np.zeros((6, 6)), float("nan"))
    points, normals, scan = seen.points_mm[rows], seen.normals[rows], seen.scans[rows]
    levers = _levers(points, normals)
    off = np.zeros((len(rows), shared + 6 * scans))
    off[:, :shared] = np.einsum("ni,nid->nd", levers, errors.common[scan])
    values, vectors = np.linalg.eigh(errors.own)
    roots = vectors * np.sqrt(np.maximum(values, 0))[:, None]
    places = shared + 6 * scan[:, None] + np.arange(6)
    off[np.arange(len(rows))[:, None], places] = np.einsum("ni,nij->nj", levers, roots[scan])
    covariance, centre = np.zeros((6, 6)), points.mean(axis=0)
    if aligned:
        rotation, place = cloud_from_reference[:3, :3], cloud_from_reference[:3, 3]
        about = _levers(points - centre, normals)
        goes_by, its_off = about, off
        if datums:
            there = (points - place) @ rotation
            goes_by, its_off = np.zeros((0, 6)), np.zeros((0, off.shape[1]))
            for datum in datums:
                at, along = (rows @ rotation.T for rows in datum.places())
                here, share = _levers(at + place, along), seen_by(datum, there, scan, scans)
                own = np.einsum("ki,sij,s->ksj", here, roots, share).reshape(len(here), -1)
                common = np.einsum("ki,sid,s->kd", here, errors.common, share)
                goes_by = np.concatenate([goes_by, _levers(at + place - centre, along)])
                its_off = np.concatenate([its_off, np.concatenate([common, own], axis=1)])
        moves = np.linalg.pinv(goes_by) @ its_off
        off = off - about @ moves
        back = np.zeros((6, 6))
        back[:3, :3], back[3:, 3:], back[3:, :3] = rotation.T, np.eye(3), -skew(place - centre)
        covariance = (back @ moves) @ (back @ moves).T
    return AgainstNominal(covariance, float(np.sqrt(np.mean((off**2).sum(axis=1)) + noise_mm2)))


def _levers(points_mm: FloatArray, normals: FloatArray) -> FloatArray:
    """Return how points move along their normals with a move ω, v about T's origin, (N, 6): (p × n, n)."""
    return np.concatenate([np.cross(points_mm, normals), normals], axis=1)
