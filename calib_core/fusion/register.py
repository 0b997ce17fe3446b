"""Fine registration, an option: what small moves of the scans would close the gaps between them.

All scans move at once.  The distances between them along the surface's normal (see `overlap`) are weighed against
what the calibration says of each scan's place, so that a direction in which the surfaces can slide stays where the
calibration put it.  The moves are the answer's evidence: large ones mean that the calibration is off.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, skew
from calib_core.fusion.overlap import Overlap, Patches, PoseErrors, overlap, transforms_of_moves

_ROUNDS = 8
_POSITION_SIGMA_MM, _TURN_SIGMA_RAD = 0.1, 0.001  # per axis, about the middle of all points
_CONVERGED_MM = 1e-5


@dataclass(frozen=True, eq=False)
class Registration:
    """The moves that a fine registration made.

    Parameters
    ----------
    turntable_from_scan : (S, 4, 4)
        To be applied to each scan's points in T.
    shift_mm : (S,)
        How far each scan's middle moved.
    turn_rad : (S,)
    before, after : Overlap
        Distances between the scans.
    moved : Patches
        Where the patches are then.
    errors : PoseErrors
        What is left uncertain of each scan's place: where scans overlap they lie together, and all move as one.
    """

    turntable_from_scan: FloatArray
    shift_mm: FloatArray
    turn_rad: FloatArray
    before: Overlap
    after: Overlap
    moved: Patches
    errors: PoseErrors


def register(seen: Patches, errors: PoseErrors | None = None) -> Registration:
    """Return the small moves of the scans that bring them together.

    Parameters
    ----------
    seen : Patches
        Voxels several times as large as the moves that are expected.
    errors : PoseErrors, optional
        What the calibration leaves uncertain; 0.1 mm and 0.001 rad per axis for every scan if left out.
    """
    from calib_core.kernels.overlap import registration_sums

    count = len(seen.names)
    centre = seen.points_mm.mean(axis=0)
    prior = np.kron(np.eye(count), np.diag([_TURN_SIGMA_RAD**2] * 3 + [_POSITION_SIGMA_MM**2] * 3))
    if errors is not None:
        prior = covariance_of_moves(errors, centre) + 1e-6 * prior
    information: FloatArray = np.linalg.inv(prior).astype(float)
    before = overlap(seen, errors)
    moves = np.zeros((count, 6))
    now, matrix = seen, information
    for _ in range(_ROUNDS):
        matrix = information.copy()
        vector: FloatArray = -information @ moves.ravel()
        rows = (now.bounds, now.scans, now.points_mm, now.normals, now.variances_mm2)
        registration_sums(*rows, 0.5 * seen.size_mm, centre, matrix, vector)
        step = np.linalg.solve(matrix, vector).reshape(count, 6)
        moves = moves + step  # small turns about one centre add up
        now = seen.moved(moves, centre)
        reach = float(np.linalg.norm(now.points_mm - centre, axis=1).max())
        if np.abs(step * np.array([reach] * 3 + [1] * 3)).max() < _CONVERGED_MM:
            break
    left = _left(matrix, centre)
    matrices, shift_mm = _ways(seen, moves, centre)
    turn_rad = np.linalg.norm(moves[:, :3], axis=1)
    return Registration(matrices, shift_mm, turn_rad, before, overlap(now, left), now, left)


def covariance_of_moves(errors: PoseErrors, centre: FloatArray) -> FloatArray:
    """Return the covariance (6S, 6S) of all scans' moves about a centre, out of those about T's origin."""
    about = np.eye(6)
    about[3:, :3] = -skew(centre)  # the centre moves by ω × centre + v
    count = len(errors.own)
    common = np.einsum("ij,sjd->sid", about, errors.common).reshape(6 * count, -1)
    covariance = common @ common.T
    for scan in range(count):
        block = slice(6 * scan, 6 * scan + 6)
        covariance[block, block] += about @ errors.own[scan] @ about.T
    return covariance


def _left(information: FloatArray, centre: FloatArray) -> PoseErrors:
    """Return the errors whose covariance about a centre is the inverse of (6S, 6S), about T's origin."""
    count = len(information) // 6
    # A root of the inverse: L⁻ᵀ where the matrix is L Lᵀ.
    root = np.linalg.inv(np.linalg.cholesky(information)).T.reshape(count, 6, -1)
    about = np.eye(6)
    about[3:, :3] = skew(centre)
    return PoseErrors(np.einsum("ij,sjd->sid", about, root), np.zeros((count, 6, 6)))


def _ways(seen: Patches, moves: FloatArray, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the scans' moves (S, 6) as transforms (S, 4, 4), and how far each scan's middle moves (S,), mm."""
    matrices = transforms_of_moves(moves, centre)
    shift_mm = np.zeros(len(moves))
    for number, (matrix, rows) in enumerate(zip(matrices, seen.rows_of_scans(), strict=True)):
        mine = seen.points_mm[rows]
        if len(mine):
            middle = mine.mean(axis=0)
            shift_mm[number] = np.linalg.norm(matrix[:3, :3] @ middle + matrix[:3, 3] - middle)
    return matrices, shift_mm
