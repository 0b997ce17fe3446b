"""Plane of light, boards and, where the boards gave it, the camera, refined together.

A line that is straight on every board, all of them in one plane, tells of the camera too: without it the camera's
error goes into every point on the plane.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray
from calib_core.kernels.bundle import SHAPE_TERMS
from calib_core.optics.adjust import (
    Adjusted,
    Adjustment,
    Corners,
    LaserLines,
    State,
    fit_poses,
    plane_start,
    shape_start,
    shared_vector,
)
from calib_core.optics.board import BoardView
from calib_core.optics.board_shape import BoardShape, shape_basis
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane_borne_out import Boards, borne_out, student
from calib_core.optics.laser_plane_held_out import stripes_worsen_corners
from calib_core.optics.stripe import StripeCenters

HUBER = 3.0
_LEAST_STRIPE_SIGMA_PX = 0.01
_OUTLIER_SIGMAS = 6.0
_NOISE_ROUNDS = 3
_RUN = 8
_DOUBLINGS = 5  # runs of 8, 16, … 128 centres
_LEAST_RUNS = 12


@dataclass(frozen=True, eq=False)
class CameraUncertainty:
    """What is known of how well the camera is known.

    Parameters
    ----------
    free : (C,)
        Places of the camera's uncertain parameters in `adjust`'s shared vector.
    covariance : (C, C)
    boards : tuple of BoardView or None
        The other boards that the camera was found from: camera, boards and plane are then refined together.  None:
        the camera stays as it is, and its covariance is carried through.
    shape : BoardShape or None
        How the board is bent; its coefficients are among the uncertain parameters.
    """

    free: NDArray[np.int64]
    covariance: FloatArray
    boards: tuple[BoardView, ...] | None = None
    shape: BoardShape | None = None


@dataclass(frozen=True, eq=False)
class Joint:
    """Where the refinement ended.

    Attributes
    ----------
    camera : CameraModel
    inverse_plane : (3,)
        q = normal / distance, 1/mm.
    covariance : (C + 3, C + 3)
        Of the camera's uncertain parameters, if any, and of q; without the board's shape.
    state : State
        The plane's boards come first.
    shape : BoardShape or None
        Of the board, where it is bent.
    noise_factor : float
        How much larger the stripe's residuals are than its centres' own standard deviations.
    camera_moved_sigmas : float
        How far the stripes drew the camera from where its boards have it: the largest change of a parameter in its
        standard deviations, or that of all together where it is the rarer one.
    corners_worsened : float or None
        By what share the stripes raise the squared error of corners that were held out, where they do.
    excess_px : float
        By how much more than stated the boards' lines lie off the plane.
    """

    camera: CameraModel
    inverse_plane: FloatArray
    covariance: FloatArray
    state: State
    shape: BoardShape | None
    noise_factor: float
    camera_moved_sigmas: float
    corners_worsened: float | None = None
    excess_px: float = 0.0

    def doubting(self, error: FloatArray) -> "Joint":
        """Return the same where the inverse plane may be off by an error (3,) that all boards have alike."""
        grown = self.covariance.copy()
        grown[-3:, -3:] += np.outer(error, error)
        return replace(self, covariance=grown)


@dataclass(frozen=True, eq=False)
class Together:
    """What is refined together.

    Parameters
    ----------
    camera : CameraModel
    corners : Corners
        Of the boards with the stripe, then of those without; weighed by their noise.
    stripes : sequence of StripeCenters
        Of the boards with the stripe.
    places_mm : sequence of (N, 3)
        Where on its board each of their centres lies.
    start : State
        Of all boards.
    inverse_plane : (3,)
        Where to begin.
    uncertainty : CameraUncertainty, optional
        Left out, the camera counts as exact.
    """

    camera: CameraModel
    corners: Corners
    stripes: Sequence[StripeCenters]
    places_mm: Sequence[FloatArray]
    start: State
    inverse_plane: FloatArray
    uncertainty: CameraUncertainty | None

    def boards(self) -> tuple[Boards, float]:
        """Return camera, plane and boards fitted by what each line states, and the noise of `Joint`."""
        uncertainty, corners = self.uncertainty, self.corners
        bands, near, far = self.camera.bands
        first = plane_start(len(bands))
        plane = np.arange(first, first + 3)
        with_camera = uncertainty is not None and uncertainty.boards is not None
        free = np.concatenate([uncertainty.free, plane]) if uncertainty is not None and with_camera else plane
        bases = [shape_basis(p, corners.extent_mm) for p in self.places_mm]
        lines = _lines(self.stripes, bases, corners.views)
        shape = None if uncertainty is None else uncertainty.shape
        fine = _without_outliers(corners, self.start, (near, far))
        problem = Adjustment(fine, near, far, free, HUBER, lines)
        shared = shared_vector(self.camera.camera_matrix, bands, self.inverse_plane, shape)
        problem, adjusted, factor = _with_stripe_noise(problem, replace(self.start, shared=shared))
        return Boards(problem, adjusted, self.start), factor

    def refined(self) -> Joint:
        """Return camera, plane and boards that fit corners and stripes best, with their covariance."""
        uncertainty = self.uncertainty
        first, board = plane_start(len(self.camera.bands[0])), shape_start(len(self.camera.bands[0]))
        fitted, factor = self.boards()
        fitted, excess_px = borne_out(fitted)
        problem, adjusted = fitted.problem, fitted.adjusted
        shared = adjusted.state.shared
        covariance = adjusted.covariance * _correlation(problem, adjusted) * student(fitted)
        with_camera = uncertainty is not None and uncertainty.boards is not None
        if uncertainty is not None and not with_camera:
            covariance = _carried_through(problem, adjusted, uncertainty, covariance)
        moved, worsened, final = 0.0, None, self.camera
        if uncertainty is not None and with_camera and np.any(uncertainty.free < board):
            moved = _moved_sigmas(self.camera, shared, uncertainty)
            final = _camera_with(self.camera, shared)
            worsened = stripes_worsen_corners(problem, adjusted)
        shape = None if uncertainty is None else uncertainty.shape
        if shape is not None:
            shape = BoardShape(shared[board : board + SHAPE_TERMS], self.corners.extent_mm)
        covariance = _without_board(covariance, uncertainty, first)
        plane = shared[first : first + 3]
        return Joint(final, plane, covariance, adjusted.state, shape, factor, moved, worsened, excess_px)


def _without_board(covariance: FloatArray, uncertainty: CameraUncertainty | None, plane_at: int) -> FloatArray:
    """Return the covariance of camera and plane alone, where the board's shape was among the unknowns."""
    if uncertainty is None:
        return covariance
    camera = np.flatnonzero(uncertainty.free < plane_at - SHAPE_TERMS)
    kept = np.concatenate([camera, np.arange(len(covariance) - 3, len(covariance))])
    return covariance[np.ix_(kept, kept)]


def _moved_sigmas(camera: CameraModel, shared: FloatArray, uncertainty: CameraUncertainty) -> float:
    """Return how far the camera moved: the boards' own covariance is what moving it costs them."""
    from scipy.special import chdtrc, ndtri  # scipy.stats has them too, but takes a second to import

    before = shared_vector(camera.camera_matrix, camera.bands[0], None, uncertainty.shape)[uncertainty.free]
    change, sigma = shared[uncertainty.free] - before, np.sqrt(np.diag(uncertainty.covariance))
    moves = sigma > 0  # what the model holds fixed does not
    change, sigma = change[moves], sigma[moves]
    together = float(
        change @ np.linalg.pinv(uncertainty.covariance[np.ix_(moves, moves)], hermitian=True) @ change
    )
    as_one = -float(ndtri(chdtrc(len(change), together) / 2)) if len(change) else 0.0
    return max(float(np.max(np.abs(change) / sigma, initial=0.0)), as_one)


def _lines(stripes: Sequence[StripeCenters], bases: Sequence[FloatArray], views: int) -> LaserLines:
    counts = [len(s.sigma_px) for s in stripes] + [0] * (views - len(stripes))
    sigma = np.concatenate([np.maximum(s.sigma_px, _LEAST_STRIPE_SIGMA_PX) for s in stripes])
    axes = np.concatenate([np.full(len(s.sigma_px), 1 if s.axis == "columns" else 0) for s in stripes])
    ends = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    pixels, basis = np.concatenate([s.pixels for s in stripes]), np.concatenate(bases)
    return LaserLines(pixels, axes.astype(np.int64), ends, 1.0 / sigma, basis)


def _without_outliers(corners: Corners, start: State, bands: tuple[FloatArray, FloatArray]) -> Corners:
    residuals = fit_poses(corners, start, bands, HUBER).corner_residuals
    far_off = np.hypot(*residuals.T) * corners.weights > _OUTLIER_SIGMAS
    return corners.weighted(np.where(far_off, 0.0, corners.weights))


def _with_stripe_noise(problem: Adjustment, state: State) -> tuple[Adjustment, Adjusted, float]:
    """Return the solved problem with each stripe weighed by its residuals where those are the larger ones."""
    lines = problem.lines
    assert lines is not None
    adjusted, factors = problem.solve(state), np.ones(problem.corners.views)
    for _ in range(_NOISE_ROUNDS):
        grown = np.maximum(_stripe_noise(lines, adjusted.line_residuals), factors)
        if np.all(grown < 1.05 * factors):
            break
        factors = grown
        weights = lines.weights / np.repeat(factors, np.diff(lines.ends))
        problem = replace(problem, lines=replace(lines, weights=weights))
        adjusted = problem.solve(adjusted.state)
    return problem, adjusted, float(np.median(factors[np.diff(lines.ends) > 0]))


def _stripe_noise(lines: LaserLines, residuals_px: FloatArray) -> FloatArray:
    """Return how much larger than stated the noise of each board's centres is, (V,): of one, or of neighbours.

    Speckle and light that spreads below the surface move neighbours alike: means of a run of centres then scatter
    by more than 1 / √run of what a single one does, and it is such runs that move a plane.  Short runs are judged
    on each board; long ones, of which a board has few, on all boards together.
    """
    single, of_runs, off = np.ones(len(lines.ends) - 1), np.ones(len(lines.ends) - 1), {}
    for board, (first, last) in enumerate(zip(lines.ends[:-1], lines.ends[1:], strict=True)):
        count = int(last - first)
        if count < 3 * _RUN:
            continue
        normed = residuals_px[first:last] * lines.weights[first:last]
        along = np.linspace(-1.0, 1.0, count)
        off[board] = normed - np.polyval(np.polyfit(along, normed, 1), along)
        single[board] = _robust_rms(off[board])
        of_runs[board] = _robust_rms(_scaled_means(off[board], _RUN))
    standardised = [each / max(single[board], 1e-9) for board, each in off.items()]
    longest = max(1.0, *(_scatter_of_runs(standardised, _RUN * 2**k) for k in range(_DOUBLINGS)))
    return np.maximum.reduce([single, of_runs, single * longest])


def _scatter_of_runs(boards: Sequence[FloatArray], run: int) -> float:
    """Return how much more than independent centres' the means of runs on all boards scatter; 1 where few are."""
    means = [_scaled_means(each, run) for each in boards if len(each) >= 3 * run]
    joined = np.concatenate(means) if means else np.zeros(0)
    return _robust_rms(joined) if len(joined) >= _LEAST_RUNS else 1.0


def _scaled_means(values: FloatArray, run: int) -> FloatArray:
    """Return the means of runs, times √run: as large as one value where all are independent."""
    return values[: len(values) // run * run].reshape(-1, run).mean(axis=1) * np.sqrt(run)


def _robust_rms(values: FloatArray) -> float:
    return 1.4826 * float(np.median(np.abs(values)))


def _camera_with(camera: CameraModel, shared: FloatArray) -> CameraModel:
    """Return a camera with the lens and the bands of a shared vector."""
    matrix = camera.camera_matrix.copy()
    matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2] = shared[:4]
    bands = shared[4 : 4 + 14 * len(camera.bands[0])].reshape(-1, 14)
    segments = tuple(replace(s, distortion=d) for s, d in zip(camera.segments, bands, strict=False))
    return replace(camera, camera_matrix=matrix, distortion=bands[len(bands) // 2], segments=segments)


def _carried_through(
    problem: Adjustment, adjusted: Adjusted, uncertainty: CameraUncertainty, covariance: FloatArray
) -> FloatArray:
    """Return the covariance of camera and plane where the camera stays: the plane follows its errors."""
    size = len(uncertainty.free)
    both_free = replace(problem, free=np.concatenate([uncertainty.free, problem.free]))
    both = both_free.equations(adjusted.state).hessian
    follows = -np.linalg.solve(both[size:, size:], both[size:, :size])
    cross = uncertainty.covariance @ follows.T
    return np.block([[uncertainty.covariance, cross], [cross.T, covariance + follows @ cross]])


def _correlation(problem: Adjustment, adjusted: Adjusted) -> float:
    """Return how much more the boards' scores scatter than independent errors explain (variance ratio), or 1.

    The same as `camera_evidence.correlation_inflation`, for corners and lines.
    """
    lines = problem.lines
    assert lines is not None
    size, views = len(problem.free), problem.corners.views
    found, expected = 0.0, float(size)
    for view in range(views):
        own = lines.take([view])
        alone = replace(problem, corners=problem.corners.take([view]), lines=own)
        equations = alone.equations(adjusted.state.take([view]))
        share = adjusted.covariance @ equations.hessian
        found += float(equations.gradient @ adjusted.covariance @ equations.gradient)
        expected -= float(np.sum(share * share.T))
    ratio = found / max(expected, 0.2 * size)
    return ratio if ratio > 1 + 2 * np.sqrt(2 / (size * views)) else 1.0
