"""How far scans' poses scatter, from the scans themselves, where no calibration says.

Where scans overlap, the distances between them are what the scans' moves make of them, and the surface's noise.
With M and b the normal equations of the moves m (see `register`), and every scan's move drawn from one
distribution, N(0, D²) about the middle of all, the sigmas in D maximise

    log L = −½ log |1 + D M D| + ½ (D b)ᵀ (1 + D M D)⁻¹ (D b)

in which the moves are integrated out: a direction in which surfaces slide says nothing of them.  The noise is
what is left after a registration; neighbouring patches share some of it, so they count for fewer.  A scan that is
far off the others has its own sigma, so that one wrong pose does not excuse all.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray, skew
from calib_core.fusion.overlap import Patches, PoseErrors

_ROUNDS = 3
_SIMPLEX = np.array([[0.0, 0.0], [0.7, 0.0], [0.0, 0.7]])
_USUAL_MM, _USUAL_RAD = 0.1, 3e-4
_WIDE = 2.5  # of the priors' logarithms: a factor of twelve
_FARTHEST = 1000.0  # times the usual: scans whose poses are of others ask for ever more
_OUTLYING = 4.0  # of its expected square
_FEWEST_FOR_OUTLIERS = 5
_BLOCK_PATCHES = 8.0
_FAR = 4.0  # robust sigmas
_MOST_PATCHES = 300_000  # of which they are found, by whole blocks, so that what neighbours share is seen
_MIXED = np.array([73_856_093, 19_349_663, 83_492_791])
_MOST_SCANS = 120  # of which the sigmas are found: the equations' cost grows with the third power


@dataclass(frozen=True, eq=False)
class Scatter:
    """How far scans' poses scatter.

    Parameters
    ----------
    position_sigma_mm, turn_sigma_rad : float
        Per axis, of a scan's place about the middle of all.
    surface_sigma_mm : float
        Of a patch beside the noise that its scan states.
    patches_per_independent : float
        So many neighbouring patches say as much as one alone would.
    errors : PoseErrors
        The same for all scans.
    """

    position_sigma_mm: float
    turn_sigma_rad: float
    surface_sigma_mm: float
    patches_per_independent: float
    errors: PoseErrors

    def with_noise(self, seen: Patches) -> Patches:
        """Return patches whose variances hold the surface's own scatter."""
        return replace(seen, variances_mm2=seen.variances_mm2 + self.surface_sigma_mm**2)

    def for_registration(self, seen: Patches) -> Patches:
        """Return patches that count as many as are independent."""
        noisy = self.with_noise(seen)
        return replace(noisy, variances_mm2=noisy.variances_mm2 * self.patches_per_independent)


def scatter(seen: Patches) -> Scatter | None:
    """Return how far the scans' poses scatter; None where too little of them overlaps to say.

    Parameters
    ----------
    seen : Patches
        Voxels several times as large as the distances between scans.
    """
    used = _overlapping(seen)
    if used is None:
        return None
    centre = used.points_mm.mean(axis=0)
    sigmas = np.array([_USUAL_RAD, _USUAL_MM])
    now, moves, own = used, np.zeros((len(used.names), 6)), np.ones(len(used.names))
    surface2, dependent = 0.0, 1.0
    for _ in range(_ROUNDS):
        noisy = replace(now, variances_mm2=(now.variances_mm2 + surface2) * dependent)
        matrix, vector = _equations(noisy, centre)
        vector = vector + matrix @ moves.ravel()
        sigmas = _likeliest(matrix, vector, own, sigmas)
        moves, own = _moves(matrix, vector, own, sigmas)
        now = used.moved(moves, centre)
        surface2, dependent = _noise(now)
    about = np.eye(6)
    about[3:, :3] = skew(centre)
    covariance = about @ np.diag(np.repeat(sigmas**2, 3)) @ about.T
    count = len(seen.names)
    errors = PoseErrors(np.zeros((count, 6, 0)), np.tile(covariance, (count, 1, 1)))
    return Scatter(float(sigmas[1]), float(sigmas[0]), float(np.sqrt(surface2)), dependent, errors)


def _overlapping(seen: Patches) -> Patches | None:
    """Return the patches that several scans have seen, of the first scans where there are many."""
    shared = np.repeat(np.diff(seen.bounds) > 1, np.diff(seen.bounds)) & (seen.scans < _MOST_SCANS)
    if not shared.any():
        return None
    every = int(np.count_nonzero(shared)) // _MOST_PATCHES
    if every > 1:
        shared &= _blocks(seen.points_mm, seen.size_mm) % every == 0
    groups = np.repeat(np.arange(len(seen.bounds) - 1), np.diff(seen.bounds))[shared]
    bounds = np.concatenate([[0], np.flatnonzero(np.diff(groups)) + 1, [len(groups)]])
    few = Patches(
        seen.names[:_MOST_SCANS],
        seen.scans[shared],
        seen.points_mm[shared],
        seen.normals[shared],
        seen.variances_mm2[shared],
        bounds.astype(np.int64),
        seen.size_mm,
    )
    return few if len(_pairs(few)[0]) >= 6 * len(few.names) else None


def _blocks(points_mm: FloatArray, size_mm: float) -> NDArray[np.int64]:
    """Return a number (N,) for the block of neighbouring patches that each lies in; far ones may share it."""
    return np.abs(np.floor(points_mm / (_BLOCK_PATCHES * size_mm)).astype(np.int64) @ _MIXED)


def _equations(seen: Patches, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    from calib_core.kernels.overlap import registration_sums

    size = 6 * len(seen.names)
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    rows = (seen.bounds, seen.scans, seen.points_mm, seen.normals, seen.variances_mm2)
    registration_sums(*rows, 0.5 * seen.size_mm, centre, matrix, vector)
    return matrix, vector


def _scales(sigmas: FloatArray, own: FloatArray) -> FloatArray:
    return (own[:, None] * np.repeat(sigmas, 3)).ravel()


def _likeliest(matrix: FloatArray, vector: FloatArray, own: FloatArray, start: FloatArray) -> FloatArray:
    from scipy.optimize import minimize

    usual = np.log([_USUAL_RAD, _USUAL_MM])

    def cost(logs: FloatArray) -> float:
        scale = _scales(np.exp(logs), own)
        root = np.linalg.cholesky(np.eye(len(scale)) + scale[:, None] * matrix * scale)
        explained = np.linalg.solve(root, scale * vector)
        prior = (((logs - usual) / _WIDE) ** 2).sum()
        return float(2 * np.log(np.diag(root)).sum() - explained @ explained + prior)

    options = {"xatol": 0.02, "fatol": 0.01, "initial_simplex": np.log(start) + _SIMPLEX}
    bounds = [(one - np.log(_FARTHEST), one + np.log(_FARTHEST)) for one in usual]
    return np.exp(minimize(cost, np.log(start), method="Nelder-Mead", bounds=bounds, options=options).x)


def _moves(
    matrix: FloatArray, vector: FloatArray, own: FloatArray, sigmas: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the scans' likeliest moves (S, 6), and the factors (S,) of the sigmas of those far off."""
    scale = _scales(sigmas, own)
    inverse = np.linalg.inv(np.eye(len(scale)) + scale[:, None] * matrix * scale)
    relative = inverse @ (scale * vector)
    moves = (scale * relative).reshape(-1, 6)
    if len(own) < _FEWEST_FOR_OUTLIERS:
        return moves, own
    squares = (relative.reshape(-1, 6) ** 2).sum(axis=1)
    expected = 6 - np.diag(inverse).reshape(-1, 6).sum(axis=1)
    ratio = squares / np.maximum(expected, 1.0)
    return moves, own * np.where(ratio > _OUTLYING, np.sqrt(ratio), 1.0)


def _pairs(seen: Patches) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Return the distances (K,) of neighbouring scans' patches, what noise makes of them, (K,) mm², and blocks."""
    first = np.repeat(seen.bounds[:-1], np.diff(seen.bounds))
    count = np.repeat(np.diff(seen.bounds), np.diff(seen.bounds))
    here = np.arange(len(seen.scans))
    there = first + (here - first + 1) % count
    one = (count > 2) | ((count == 2) & (here < there))
    a, b = here[one], there[one]
    normal = seen.normals[a] + seen.normals[b]
    length = np.linalg.norm(normal, axis=1)
    good = length > 1.7
    a, b, normal = a[good], b[good], normal[good] / length[good, None]
    apart = (normal * (seen.points_mm[a] - seen.points_mm[b])).sum(axis=1)
    near = np.abs(apart) <= 0.5 * seen.size_mm
    a, b = a[near], b[near]
    low, high = np.minimum(seen.scans[a], seen.scans[b]), np.maximum(seen.scans[a], seen.scans[b])
    pair = low * len(seen.names) + high
    _, blocks = np.unique(
        _blocks(seen.points_mm[a], seen.size_mm) * len(seen.names) ** 2 + pair, return_inverse=True
    )
    sign = np.where(seen.scans[a] == low, 1.0, -1.0)
    stated = seen.variances_mm2[a] + seen.variances_mm2[b]
    return sign * apart[near], stated, blocks.ravel().astype(np.int64)


def _noise(seen: Patches) -> tuple[float, float]:
    """Return the variance of a patch beside its own, and how many neighbouring ones say as much as one."""
    apart, stated, blocks = _pairs(seen)
    usual = 1.4826 * np.median(np.abs(apart)) if len(apart) else 0.0
    kept = np.abs(apart) <= _FAR * usual
    if not kept.any():
        return 0.0, 1.0
    apart, stated, blocks = apart[kept], stated[kept], blocks[kept]
    sums = np.bincount(blocks, apart)
    square = float((apart**2).sum())
    dependent = float((sums**2).sum()) / square if square else 1.0  # 0: the same scan, given twice
    return max(0.0, float((apart**2 - stated).mean() / 2)), max(1.0, dependent)
