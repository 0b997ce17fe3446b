"""What a camera's solution says about itself: covariance, correlations, coverage, and what is noticed."""

from typing import TYPE_CHECKING, Final

import numpy as np

from calib_core.findings import Finding
from calib_core.findings.codes import camera as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.kernels.bundle import SHAPE_TERMS
from calib_core.messages import message, templates
from calib_core.optics.adjust import Adjustment
from calib_core.optics.camera_choice import Candidate
from calib_core.optics.camera_layout import corner_depths
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import Coverage
from calib_core.optics.coverage_cells import ENOUGH_COVERED, image_coverage
from calib_core.optics.extrapolation import extrapolation, projection_sigmas

if TYPE_CHECKING:
    from calib_core.optics.camera_layout import Layout
    from calib_core.optics.camera_solution import CameraSolution, Fit, PitchRatio

_ADVISED_VIEWS = 10
_HARMLESS_EXTRAPOLATION = 3.0
_GOOD_PX = 0.125  # a standard deviation of the projection that is good wherever in the image the work is
_LARGE_RMS_PX, _FAIL_RMS_PX = 1.0, 3.0
_UNSURE_FOCAL = 0.005
_NOTABLE_BEND_GAIN = 0.15
_ADVISED_TILT_RAD = 0.26
MODELS: Final = templates({
    "plain": "plain",
    "rational": "rational",
    "tilted": "tilted sensor",
    "segmental": "segments over depth",
})  # fmt: skip
_BENDS: Final = templates({3: "{model} + bend", SHAPE_TERMS: "{model} + cubic bend"})


def coverage(fit: "Fit", layout: "Layout", image_size: tuple[int, int], inflation: float) -> Coverage:
    """Return where in the image and how deep the boards were seen, and how that holds for the rest."""
    counts = image_coverage(fit.corners.pixels, image_size)
    depths = corner_depths(fit.corners, fit.adjusted.state)
    tilt = np.arccos(np.clip(np.abs(fit.adjusted.state.rotations[:, 2, 2]), 0, 1)).max()
    sigmas_px = projection_sigmas(fit, layout, image_size, counts > 0)
    return Coverage(
        counts,
        (float(depths.min()), float(depths.max())),
        float((counts > 0).mean()),
        float(tilt),
        extrapolation(sigmas_px),
        np.sqrt(inflation) * sigmas_px,
    )


def summarise(
    fit: "Fit",
    layout: "Layout",
    image_size: tuple[int, int],
    candidates: tuple[Candidate, ...],
    bent: "Fit | None" = None,
    pitch: "PitchRatio | None" = None,
) -> "CameraSolution":
    """Return the solution of a finished fit.

    Parameters
    ----------
    fit, layout, image_size, candidates
    bent : Fit, optional
        The same with a board that may be bent.
    pitch : PitchRatio, optional
        By how much the board's pitches differ from the told ones, where they do.
    """
    from calib_core.optics.adjust import shape_start
    from calib_core.optics.board_shape import BoardShape
    from calib_core.optics.camera_layout import camera_of
    from calib_core.optics.camera_solution import CameraSolution

    end, state = fit.adjusted, fit.adjusted.state
    weight = float(fit.corners.weights.max())
    scale = (fit.sigma_px * weight) ** 2  # the covariance was for 1 / weight as standard deviation
    inflation = correlation_inflation(fit, layout, scale)
    scale *= inflation
    covariance = end.covariance * scale
    if pitch is not None:
        covariance = covariance + np.outer(pitch.change, pitch.change)
    kept = fit.corners.weights > 0
    poses: list[RigidTransform | None] = [None] * fit.all_corners.views
    for view, pose in zip(fit.used, state.poses(), strict=True):
        poses[view] = pose
    residuals = [np.zeros((0, 2))] * fit.all_corners.views
    for k, view in enumerate(fit.used):
        residuals[view] = end.corner_residuals[fit.corners.ends[k] : fit.corners.ends[k + 1]]
    shape_at = shape_start(len(layout.nears))
    shaped = fit if layout.bends else bent
    shape = None if shaped is None else shaped.adjusted.state.shared[shape_at : shape_at + SHAPE_TERMS].copy()
    bend = None if shape is None else BoardShape(shape, fit.corners.extent_mm)
    is_told = bend is not None and layout.prior is None
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
        board_shape=bend if layout.bends else None,
        bend_mm=bend.bend_mm(shaped.corners.points_mm) if is_told and bend and shaped else None,
        bend_gain=None if bent is None else 1 - bent.sigma_px / fit.sigma_px,
        inflation=inflation,
        coverage=coverage(fit, layout, image_size, inflation),
        converged=end.converged,
        pitch=pitch,
    )


def correlation_inflation(fit: "Fit", layout: "Layout", scale: float) -> float:
    """Return by how much the covariance must grow because the errors of a view's corners are not independent.

    At the optimum the views' scores s_v (their gradients, poses eliminated, information H_v) add up to zero. For
    independent errors and C = (Σ H_v)⁻¹ the expectation of Σ s_vᵀ C s_v is P − Σ tr (C H_v)², its relative
    deviation √(2 / (P V)); where something is known before any view, P is Σ tr C H_v. What is beyond two
    deviations is taken for correlation (the localisation's bias).
    """
    corners, state = fit.corners, fit.adjusted.state
    found, expected = 0.0, 0.0
    for view in range(corners.views):
        alone = Adjustment(corners.take([view]), *layout.bands, layout.free).equations(state.take([view]))
        share = fit.adjusted.covariance @ alone.hessian
        found += float(alone.gradient @ fit.adjusted.covariance @ alone.gradient)
        expected += float(np.trace(share) - np.sum(share * share.T))
    ratio = found / (scale * max(expected, 0.2 * len(layout.free)))
    return ratio if ratio > 1 + 2 * np.sqrt(2 / (len(layout.free) * corners.views)) else 1.0


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


def camera_findings(solution: "CameraSolution", plane_follows: bool = False) -> list[Finding]:
    """Return what makes a solution doubtful, and how its model was chosen.

    Where a plane of light follows, that tells which part of the image is used, and warns of what no board covers.
    """
    return [*_of_views(solution, plane_follows), *_of_lens(solution), *_of_model(solution)]


def _of_views(solution: "CameraSolution", plane_follows: bool) -> list[Finding]:
    found: list[Finding] = []
    used = sum(pose is not None for pose in solution.camera_from_board)
    if not solution.converged:
        found.append(codes.CAMERA_NOT_CONVERGED())
    if used < _ADVISED_VIEWS:
        found.append(codes.FEW_VIEWS(count=used))
    seen = solution.coverage
    tells_later = plane_follows and np.isfinite(seen.extrapolation)
    largest_px = 0.0 if tells_later else float(seen.projection_sigma_px.max())
    found.extend(coverage_findings(seen.covered, seen.extrapolation, largest_px))
    if seen.largest_tilt_rad < _ADVISED_TILT_RAD:
        found.append(codes.BOARDS_NOT_TILTED(tilt_deg=float(np.rad2deg(seen.largest_tilt_rad))))
    return found


def coverage_findings(covered: float, extrapolation: float, largest_px: float) -> list[Finding]:
    """Return how an image that boards cover in part counts: as little as what was seen tells of the rest."""
    if covered >= ENOUGH_COVERED:
        return []
    if extrapolation > _HARMLESS_EXTRAPOLATION and not largest_px < _GOOD_PX:
        return [codes.IMAGE_NOT_COVERED(covered=covered)]
    return [codes.IMAGE_COVERED_IN_PART(covered=covered, ratio=extrapolation)]


def _of_lens(solution: "CameraSolution") -> list[Finding]:
    found: list[Finding] = []
    focal, deviation = solution.camera.camera_matrix[0, 0], float(np.sqrt(solution.covariance[0, 0]))
    if _folds_inside(solution.camera):
        found.append(codes.DISTORTION_FOLDS())
    if deviation > _UNSURE_FOCAL * focal:
        found.append(codes.FOCAL_LENGTH_UNSURE(share=float(2 * deviation / focal)))
    if solution.bend_gain is not None and solution.bend_gain > _NOTABLE_BEND_GAIN and solution.bend_mm is not None:
        found.append(codes.BOARD_BENT(bend_mm=solution.bend_mm, gain=solution.bend_gain))
    if (pitch := solution.pitch) is not None:
        found.append(
            codes.PITCHES_DIFFER(ratio=pitch.ratio, uncertainty=2 * pitch.sigma, focal_ratio=pitch.focal_ratio)
        )
    if solution.board_shape is not None and solution.bend_mm is not None:
        found.append(codes.BOARD_SHAPE_SOLVED(bend_mm=solution.bend_mm))
    if (rms_px := solution.reprojection_rms_px) > _LARGE_RMS_PX:
        found.append((codes.CORNERS_FAR_OFF if rms_px > _FAIL_RMS_PX else codes.CORNERS_OFF)(rms_px=rms_px))
    return found


def _named(candidate: Candidate) -> str:
    name, bend = MODELS[candidate.model], _BENDS.get(candidate.shape_terms)
    return name if bend is None else message(bend, model=name)


def _of_model(solution: "CameraSolution") -> list[Finding]:
    found: list[Finding] = []
    chosen = solution.camera.model
    if solution.candidates:
        errors = [
            message("{what}: {off_px:.3f} px", what=_named(one), off_px=one.held_out_rms_px)
            for one in solution.candidates
        ]
        than = "plain" if chosen == "plain" else "other"
        told = message("{errors:,}", errors=errors)
        found.append(codes.CAMERA_MODEL(than=than, model=MODELS[chosen], errors=told))
    if chosen in ("plain", "tilted") and "k3" not in solution.parameters:
        found.append(codes.TERMS_AT_ZERO(terms=[k for k in ("k2", "k3") if k not in solution.parameters]))
    if solution.tilt_correlation is not None and solution.tilt_correlation > 0.9:
        found.append(codes.TILT_CORRELATED(correlation=solution.tilt_correlation))
    if solution.rejected_corners:
        found.append(codes.CORNERS_LEFT_OUT(count=solution.rejected_corners))
    return found
