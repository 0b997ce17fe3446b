"""What a camera's solution says about itself: covariance, correlations, coverage, and warnings in sentences."""

from typing import TYPE_CHECKING

import numpy as np

from calib_core.frames import FloatArray, RigidTransform
from calib_core.optics.adjust import Adjustment
from calib_core.optics.camera_choice import Candidate
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_segments import corner_depths
from calib_core.optics.camera_solution import Coverage

if TYPE_CHECKING:
    from calib_core.optics.camera_layout import Layout
    from calib_core.optics.camera_solution import CameraSolution, Fit

_CELLS = (8, 6)
_ADVISED_VIEWS = 10
_ADVISED_COVERAGE = 0.6
_LARGE_RMS_PX = 1.0
_UNSURE_FOCAL = 0.005
_NOTABLE_BEND_GAIN = 0.15
_ADVISED_TILT_RAD = 0.26


def coverage(fit: "Fit", image_size: tuple[int, int]) -> Coverage:
    """Return where in the image and how deep the boards were seen."""
    counts = image_coverage(fit.corners.pixels, image_size)
    depths = corner_depths(fit.corners, fit.adjusted.state)
    tilt = np.arccos(np.clip(np.abs(fit.adjusted.state.rotations[:, 2, 2]), 0, 1)).max()
    return Coverage(counts, (float(depths.min()), float(depths.max())), float((counts > 0).mean()), float(tilt))


def image_coverage(pixels: FloatArray, image_size: tuple[int, int]) -> np.ndarray:
    """Return how many points (N, 2) fall into each of 8 × 6 cells of the image, as (6, 8)."""
    width, height = image_size
    counts, _, _ = np.histogram2d(
        pixels[:, 1], pixels[:, 0], bins=_CELLS[::-1], range=((-0.5, height - 0.5), (-0.5, width - 0.5))
    )
    return counts.astype(np.int64)


def summarise(
    fit: "Fit",
    layout: "Layout",
    image_size: tuple[int, int],
    candidates: tuple[Candidate, ...],
    bent: "Fit | None" = None,
) -> "CameraSolution":
    """Return the solution of a finished fit; `bent` is the same with a board that may be bent."""
    from calib_core.optics.adjust import shape_start
    from calib_core.optics.camera_layout import camera_of
    from calib_core.optics.camera_solution import CameraSolution

    end, state = fit.adjusted, fit.adjusted.state
    weight = float(fit.corners.weights.max())
    scale = (fit.sigma_px * weight) ** 2  # the covariance was for 1 / weight as standard deviation
    inflation = correlation_inflation(fit, layout, scale)
    scale *= inflation
    covariance = end.covariance * scale
    kept = fit.corners.weights > 0
    poses: list[RigidTransform | None] = [None] * fit.all_corners.views
    for view, pose in zip(fit.used, state.poses(), strict=True):
        poses[view] = pose
    residuals = [np.zeros((0, 2))] * fit.all_corners.views
    for k, view in enumerate(fit.used):
        residuals[view] = end.corner_residuals[fit.corners.ends[k] : fit.corners.ends[k + 1]]
    shape_at = shape_start(len(layout.nears))
    refined = bool(np.any(layout.free >= shape_at))
    shaped = fit if refined else bent
    return CameraSolution(
        camera=camera_of(state.shared, layout, image_size),
        parameters=layout.names,
        covariance=covariance,
        camera_from_board=tuple(poses),
        pose_covariances={v: c * scale for v, c in zip(fit.used, end.pose_covariances, strict=True)},
        reprojection_rms_px=float(np.sqrt((end.corner_residuals[kept] ** 2).sum(axis=1).mean())),
        corner_sigma_px=fit.sigma_px,
        view_rms_px=fit.view_rms_px,
        residuals_px=tuple(residuals),
        rejected=fit.rejected,
        rejected_corners=int((~kept).sum()),
        candidates=candidates,
        tilt_correlation=tilt_correlation(layout.names, covariance),
        board_shape_mm=state.shared[shape_at : shape_at + 7].copy() if refined else None,
        bend_mm=None if shaped is None else _bend_mm(shaped, shape_at),
        bend_gain=None if bent is None else 1 - bent.sigma_px / fit.sigma_px,
        inflation=inflation,
        coverage=coverage(fit, image_size),
        converged=end.converged,
    )


def correlation_inflation(fit: "Fit", layout: "Layout", scale: float) -> float:
    """Return by how much the covariance must grow because the errors of a view's corners are not independent.

    At the optimum the views' scores s_v (their gradients, poses eliminated, information H_v) add up to zero. For
    independent errors and C = (Σ H_v)⁻¹ the expectation of Σ s_vᵀ C s_v is P − Σ tr (C H_v)², its relative
    deviation √(2 / (P V)). What is beyond two deviations is taken for correlation (the localisation's bias).
    """
    corners, state = fit.corners, fit.adjusted.state
    found, expected = 0.0, float(len(layout.free))
    for view in range(corners.views):
        alone = Adjustment(corners.take([view]), *layout.bands, layout.free).equations(state.take([view]))
        share = fit.adjusted.covariance @ alone.hessian
        found += float(alone.gradient @ fit.adjusted.covariance @ alone.gradient)
        expected -= float(np.sum(share * share.T))
    ratio = found / (scale * max(expected, 0.2 * len(layout.free)))
    return ratio if ratio > 1 + 2 * np.sqrt(2 / (len(layout.free) * corners.views)) else 1.0


def _bend_mm(fit: "Fit", shape_at: int) -> float:
    heights = fit.corners.shape_basis() @ fit.adjusted.state.shared[shape_at : shape_at + 7]
    places = np.column_stack([fit.corners.points_mm[:, :2], np.ones(len(heights))])
    return float(np.ptp(heights - places @ np.linalg.lstsq(places, heights, rcond=None)[0]))


def tilt_correlation(names: tuple[str, ...], covariance: FloatArray) -> float | None:
    """Return the largest |correlation| between a tilt and the principal point, or None without tilts."""
    if "tauX" not in names:
        return None
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    tilts, centres = [names.index("tauX"), names.index("tauY")], [names.index("cx"), names.index("cy")]
    return float(np.abs(correlation[np.ix_(tilts, centres)]).max())


def _folds_inside(camera: CameraModel) -> bool:
    """Whether some pixels of the image's border are reached by no ray."""
    width, height = camera.image_size
    corners = [[0.0, 0.0], [width - 1.0, 0.0], [0.0, height - 1.0], [width - 1.0, height - 1.0]]
    depths = [s.near_mm for s in camera.segments] or [None]
    return any(bool(np.isnan(camera.undistort(corners, depth)).any()) for depth in depths)


def remarks_of(solution: "CameraSolution") -> list[str]:
    """Return how the model was chosen and what that means, in sentences; nothing in them is wrong."""
    found: list[str] = []
    chosen = solution.camera.model
    if solution.candidates:
        errors = ", ".join(f"{c.model} {c.held_out_rms_px:.3f} px" for c in solution.candidates)
        why = "no other is" if chosen == "plain" else "it is"
        found.append(f"The {chosen} model was chosen: {why} significantly better on held-out views ({errors}).")
    if chosen in ("plain", "tilted") and "k3" not in solution.parameters:
        none = "k3 is" if "k2" in solution.parameters else "k2 and k3 are"
        found.append(
            f"{none} fixed at zero: views that have no part in the fit are not foretold better with more."
        )
    if solution.tilt_correlation is not None and solution.tilt_correlation > 0.9:
        found.append(
            f"Tilt and principal point are correlated by {solution.tilt_correlation:.3f}: "
            "use them together, never one of them alone."
        )
    if solution.rejected_corners:
        found.append(f"{solution.rejected_corners} single corners were left out as outliers.")
    return found


def problems_of(solution: "CameraSolution") -> list[str]:
    """Return what makes a solution doubtful and what to do about it, in sentences."""
    found: list[str] = []
    used = sum(pose is not None for pose in solution.camera_from_board)
    if not solution.converged:
        found.append("The adjustment did not converge: the views barely determine this model. Take more views.")
    if used < _ADVISED_VIEWS:
        found.append(f"Only {used} views are used: take at least {_ADVISED_VIEWS}, better 15 to 25.")
    seen = solution.coverage
    if seen.covered < _ADVISED_COVERAGE:
        found.append(
            f"The boards cover {seen.covered:.0%} of the image: the distortion of the rest is extrapolated. "
            "Show the board in the corners too."
        )
    if seen.largest_tilt_rad < _ADVISED_TILT_RAD:
        found.append(
            f"No board is tilted by more than {np.rad2deg(seen.largest_tilt_rad):.0f}°: focal length and distance "
            "are hard to tell apart. Tilt it by 20 to 45° in some views."
        )
    focal, deviation = solution.camera.camera_matrix[0, 0], float(np.sqrt(solution.covariance[0, 0]))
    if _folds_inside(solution.camera):
        found.append(
            "The distortion turns back before the image's corners, where no board was seen: pixels there give no "
            "points. Show the board in the corners too."
        )
    if deviation > _UNSURE_FOCAL * focal:
        found.append(f"The focal length is known only to ±{200 * deviation / focal:.1f} %: tilt the board more.")
    if solution.bend_gain is not None and solution.bend_gain > _NOTABLE_BEND_GAIN and solution.bend_mm is not None:
        found.append(
            f"The board seems to be bent by {solution.bend_mm:.2f} mm: the residuals would be "
            f"{solution.bend_gain:.0%} smaller. "
            'Take a flatter board, or set "flat": false in cell.board to have its shape refined.'
        )
    if solution.reprojection_rms_px > _LARGE_RMS_PX:
        found.append(
            f"The corners lie {solution.reprojection_rms_px:.1f} px RMS from their predicted places, where "
            "0.05 to 0.5 px is usual: check that the board is flat and still, and its columns and rows."
        )
    return found
