"""How far scans lie apart where they overlap, before any registration: the promise of the whole chain, measured.

Each scan is averaged in voxels of its own.  In every voxel that several scans have seen, each pair of scans gives
the distance of their means along their common normal.  Beside its RMS stands the one that is expected from the
noise and from what the calibration leaves uncertain.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.frames import FloatArray, rotation_from_vector, skew
from calib_core.fusion.clean_scan import KEPT, CleanScan
from calib_core.fusion.merge import VoxelGrid

_FEWEST_POINTS = 3
_TOTALS = 4
_FEWEST_AROUND, _IN_LINE, _ALIKE, _ONE_SIDED = 5, 0.1, 0.95, 0.25
_FLAT, _FLAT_SPREAD = 0.015, 3.0  # how far below 1 the mean normal's length may be, at least and beside the usual
_MANY_ERRORS = 72  # shared by scans: from here a pair's errors cost less by the scans' covariance than one by one


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """What the calibration leaves uncertain of each scan's place in T.

    Parameters
    ----------
    common : (S, 6, D)
        The move of each scan (rx ry rz about T's origin, rad; tx ty tz, mm) by one standard deviation of each of
        D independent errors that scans share, such as those of the TCP and the table's axis.
    own : (S, 6, 6)
        Covariance of the moves of each scan alone: the robot's repeatability, the table's angle.
    """

    common: FloatArray
    own: FloatArray

    @classmethod
    def none(cls, scans: int) -> "PoseErrors":
        """Return no errors for so many scans."""
        return cls(np.zeros((scans, 6, 0)), np.zeros((scans, 6, 6)))


@dataclass(frozen=True, eq=False)
class Patches:
    """The scans' means in voxels, those of one voxel side by side.

    Parameters
    ----------
    names : tuple of str
    scans, points_mm, normals, variances_mm2 : (N,), (N, 3), (N, 3), (N,)
        Without a normal (0, 0, 0) where a patch is not flat: across an edge a mean is no place of the surface.
    bounds : (G + 1,)
        Where each voxel's rows begin.
    size_mm : float
    """

    names: tuple[str, ...]
    scans: NDArray[np.int64]
    points_mm: FloatArray
    normals: FloatArray
    variances_mm2: FloatArray
    bounds: NDArray[np.int64]
    size_mm: float

    def rows_of_scans(self) -> list[NDArray[np.int64]]:
        """Return each scan's rows, ascending; found once for all scans, of which there may be thousands."""
        order = np.argsort(self.scans, kind="stable")
        ends = np.searchsorted(self.scans[order], np.arange(1, len(self.names)))
        return np.split(order, ends)

    def moved(self, moves: FloatArray, centre_mm: FloatArray) -> "Patches":
        """Return the patches after each scan's move (S, 6): rx ry rz about `centre_mm`, tx ty tz."""
        return self.transformed(transforms_of_moves(moves, centre_mm))

    def transformed(self, turntable_from_scan: FloatArray) -> "Patches":
        """Return the patches after a transform of each scan's points, (S, 4, 4)."""
        ways = turntable_from_scan[self.scans]
        points = np.einsum("nij,nj->ni", ways[:, :3, :3], self.points_mm) + ways[:, :3, 3]
        return replace(self, points_mm=points, normals=np.einsum("nij,nj->ni", ways[:, :3, :3], self.normals))

    def in_voxels(self) -> "Patches":
        """Return the patches, wherever they are now, put into voxels anew."""
        from calib_core.kernels.fusion import pack_keys

        keys = pack_keys(np.floor(self.points_mm / self.size_mm).astype(np.int64))
        order = np.argsort(keys, kind="stable")
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(keys[order])) + 1, [len(order)]])
        return replace(
            self,
            scans=self.scans[order],
            points_mm=self.points_mm[order],
            normals=self.normals[order],
            variances_mm2=self.variances_mm2[order],
            bounds=bounds.astype(np.int64),
        )

    def coarser(self, size_mm: float) -> "Patches":
        """Return the means of each scan's flat patches in larger voxels."""
        from calib_core.kernels.fusion import pack_keys

        flat = np.flatnonzero(self.normals.any(axis=1))
        cells = pack_keys(np.floor(self.points_mm[flat] / size_mm).astype(np.int64))
        order = np.lexsort((self.scans[flat], cells))
        rows, cells = flat[order], cells[order]
        change = (np.diff(cells) != 0) | (np.diff(self.scans[rows]) != 0)
        starts = np.concatenate([[0], np.flatnonzero(change) + 1]) if len(rows) else np.zeros(0, np.int64)
        counts = np.diff(np.append(starts, len(rows)))[:, None]
        normals = np.add.reduceat(self.normals[rows], starts) if len(rows) else np.zeros((0, 3))
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        plain = (lengths > _ALIKE * counts)[:, 0]
        points = np.add.reduceat(self.points_mm[rows], starts)[plain] / counts[plain] if len(rows) else normals
        return replace(
            self,
            scans=self.scans[rows[starts]][plain],
            points_mm=points,
            normals=(normals / np.maximum(lengths, 1e-12))[plain],
            variances_mm2=self.variances_mm2[rows[starts]][plain],
            bounds=np.array([0, int(plain.sum())]),
            size_mm=size_mm,
        ).in_voxels()


def transforms_of_moves(moves: FloatArray, centre: FloatArray) -> FloatArray:
    """Return moves (S, 6) about a centre as transforms (S, 4, 4)."""
    matrices = np.tile(np.eye(4), (len(moves), 1, 1))
    for matrix, move in zip(matrices, moves, strict=True):
        matrix[:3, :3] = rotation_from_vector(move[:3])
        matrix[:3, 3] = centre - matrix[:3, :3] @ centre + move[3:]
    return matrices


@dataclass(frozen=True, eq=False)
class Overlap:
    """Distances between scans.

    Parameters
    ----------
    rms_mm : float
        Over all pairs of scans in all voxels that both have seen; NaN where no two scans overlap.
    expected_rms_mm : float
        The same from noise and calibration.
    pairs : int
    beyond : int
        Pairs that were farther apart than half a voxel and count as other surfaces.
    per_scan : (S, 4)
        Pairs, mean distance in front of the others, RMS, and the RMS expected, in mm.
    """

    rms_mm: float
    expected_rms_mm: float
    pairs: int
    beyond: int
    per_scan: FloatArray


def patches(scans: Iterable[CleanScan], size_mm: float = 1.0) -> Patches:
    """Return the means of each scan in voxels of its own.

    Parameters
    ----------
    scans : iterable of CleanScan
        Taken one at a time, so that they need not be in memory together.
    size_mm : float
        The voxels' edge: large beside the scans' distances, small beside the object's curvature.

    Raises
    ------
    InputError
        If there are no scans or the size is not a positive number.
    """
    return joined_patches([(scan.name, seen_by(scan, size_mm)) for scan in scans], size_mm)


class SeenBy(NamedTuple):
    """The means of one scan in voxels: packed indices (N,), points (N, 3), normals (N, 3), variances (N,)."""

    keys: NDArray[np.int64]
    points_mm: NDArray[np.float32]
    normals: NDArray[np.float32]
    variances_mm2: FloatArray


def seen_by(scan: CleanScan, size_mm: float) -> SeenBy:
    """Return the means of one scan in voxels of this size, where it has enough points."""
    grid = VoxelGrid(size_mm, normals=True)
    # A distance along the normal has the noise that the scan states, at every angle of incidence.
    weights = ((scan.verdicts == KEPT) / scan.point_sigma_mm**2).astype(np.float32)
    grid.add(scan.points_in_turntable_mm, None, weights, scan.normals, scan.name)
    cloud = grid.cloud()
    good = (cloud.counts >= _FEWEST_POINTS) & np.isfinite(cloud.normals).all(axis=1)
    order = np.flatnonzero(good)[np.argsort(cloud.keys[good])]
    keys, normals = cloud.keys[order], cloud.normals[order]
    return SeenBy(
        keys,
        cloud.points_mm[order],
        _of_flat(keys, cloud.points_mm[order], normals, size_mm),
        cloud.sigma_mm[order].astype(float) ** 2,
    )


def _of_flat(
    keys: NDArray[np.int64], points: NDArray[np.float32], normals: NDArray[np.float32], size_mm: float
) -> NDArray[np.float32]:
    """Return the normals (N, 3) of voxels with ascending keys by the planes through their neighbours' means.

    The points' own normals are rounded off beside an edge, so that surfaces seem to be held where they slide.
    Where the normals around differ much, or neighbours lie in a line or on one side, it is (0, 0, 0).
    """
    from calib_core.kernels.fusion import BITS
    from calib_core.kernels.overlap import add_neighbours

    if not len(keys):
        return normals
    around = np.array([(x << 2 * BITS) + (y << BITS) + z for x, y, z in product((-1, 0, 1), repeat=3)])
    around = around[around > 0]
    values = np.column_stack([normals, np.ones(len(keys))]).astype(float)
    sums = values.copy()
    add_neighbours(keys, values, around, sums)
    bent = 1 - np.linalg.norm(sums[:, :3], axis=1) / sums[:, 3]
    flat = bent <= max(_FLAT, _FLAT_SPREAD * float(np.median(bent)))
    off = points.astype(float) - points.mean(axis=0)
    squares = (off[:, :, None] * off[:, None, :]).reshape(-1, 9)
    values = np.column_stack([off, squares, np.ones(len(keys))]) * flat[:, None]
    sums = values.copy()
    add_neighbours(keys, values, around, sums)
    count = np.maximum(sums[:, 12], 1.0)
    mean = sums[:, :3] / count[:, None]
    moments = sums[:, 3:12].reshape(-1, 3, 3) / count[:, None, None] - mean[:, :, None] * mean[:, None, :]
    spread, axes = np.linalg.eigh(moments)
    fitted = axes[:, :, 0] * np.sign((axes[:, :, 0] * normals).sum(axis=1))[:, None]
    flat &= (count >= _FEWEST_AROUND) & (spread[:, 1] > _IN_LINE * spread[:, 2])
    flat &= (fitted * normals).sum(axis=1) > _ALIKE
    flat &= np.linalg.norm(off - mean, axis=1) < _ONE_SIDED * size_mm
    return np.where(flat[:, None], fitted, 0.0).astype(np.float32)


def joined_patches(seen: Sequence[tuple[str, SeenBy]], size_mm: float) -> Patches:
    """Return the patches of scans by name, from what each has seen; raises InputError where there are none."""
    if not seen:
        raise InputError("scans to compare", "none", "Add scans of the object.", "scans")
    columns = [(*own, np.full(len(own.keys), number)) for number, (_, own) in enumerate(seen)]
    keys, points, normals, variances, scan_numbers = (np.concatenate(c) for c in zip(*columns, strict=True))
    order = np.argsort(keys, kind="stable")
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(keys[order])) + 1, [len(keys)]])
    return Patches(
        tuple(name for name, _ in seen),
        scan_numbers[order],
        points[order].astype(float),
        normals[order].astype(float),
        variances[order].astype(float),
        bounds.astype(np.int64),
        size_mm,
    )


def overlap(seen: Patches, errors: PoseErrors | None = None) -> Overlap:
    """Return how far the scans lie apart where they overlap.

    Parameters
    ----------
    seen : Patches
    errors : PoseErrors, optional
        For the RMS that is expected; noise alone if left out.
    """
    from calib_core.kernels.overlap import pair_sums

    count = len(seen.names)
    e = errors or PoseErrors.none(count)
    if len(e.common) != count or len(e.own) != count:
        need = "the errors of {count} scans"
        to_do = "Give one for each, in their order."
        raise InputError(need, "those of {count_other}", to_do, "errors", count=count, count_other=len(e.own))
    totals = np.zeros((count, _TOTALS))
    cut = 0.5 * seen.size_mm
    rows = (seen.bounds, seen.scans, seen.points_mm, seen.normals, seen.variances_mm2)
    common, together = e.common, np.empty((0, 0))
    if common.shape[2] > _MANY_ERRORS:
        flat = common.reshape(6 * count, -1)
        common, together = common[:, :, :0], flat @ flat.T
    common, own = np.ascontiguousarray(common), np.ascontiguousarray(e.own)
    pairs, squares, expected, beyond = pair_sums(*rows, cut, common, together, own, totals).tolist()
    divisor = np.where(totals[:, :1] > 0, totals[:, :1], np.nan)
    per_scan = np.concatenate([totals[:, :1], totals[:, 1:] / divisor], axis=1)
    per_scan[:, 2:] = np.sqrt(per_scan[:, 2:])
    if not pairs:
        return Overlap(float("nan"), float("nan"), 0, int(beyond), per_scan)
    return Overlap(
        float(np.sqrt(squares / pairs)), float(np.sqrt(expected / pairs)), int(pairs), int(beyond), per_scan
    )


def move_of_pose_change(into_from_outof: FloatArray, perturbation: FloatArray) -> FloatArray:
    """Return the moves in T (6, K) that small changes of a pose cause.

    Parameters
    ----------
    into_from_outof : (4, 4)
        A pose whose `into` frame is T (or moves rigidly with it).
    perturbation : (6, K)
        Columns rx ry rz tx ty tz as in `frames`: the rotation on the right, the translation added in `into`.

    Returns
    -------
    (6, K)
        Rotation about T's origin and translation there: a point p moves by ω × p + v.
    """
    rotation, translation = into_from_outof[:3, :3], into_from_outof[:3, 3]
    turning = rotation @ perturbation[:3]
    return np.concatenate([turning, perturbation[3:] + skew(translation) @ turning])
