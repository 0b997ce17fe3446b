"""The laser-plane stage: board and stripe found in every capture, the plane through them, one row a capture."""

from collections.abc import Sequence

import numpy as np

from calib_core.captures.boards import board_first, board_in, board_of, frames_not_used, likeliest_failure
from calib_core.captures.contradictions import EXCLUDED, NOT_A_FRAME
from calib_core.captures.lost_rays import lost_rays
from calib_core.captures.plane_views import PlaneViews
from calib_core.captures.solved_optics import camera_of, camera_segments, remembered
from calib_core.errors import InputError, MeasurementError, MotionError
from calib_core.findings import Finding, judgement, reasons_of
from calib_core.findings.codes import camera as camera_codes
from calib_core.findings.codes import laser_plane as codes
from calib_core.frames import FloatArray
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.messages import Value, message
from calib_core.optics.adjust import Adjustment, shape_start
from calib_core.optics.board import BoardView
from calib_core.optics.board_shape import BoardShape
from calib_core.optics.camera_choice import choose_layout
from calib_core.optics.camera_evidence import coverage_findings
from calib_core.optics.camera_layout import Layout
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.extrapolation import extrapolation, sigmas_in_light
from calib_core.optics.focus_change import is_changed
from calib_core.optics.laser_plane import (
    camera_from_laser_covariance,
    camera_from_laser_of,
    plane_findings,
    rotation_sigma_deg,
)
from calib_core.optics.laser_plane_joint import HUBER, CameraUncertainty
from calib_core.optics.laser_plane_solve import PlaneSolution, PlaneView, ViewFigures, posed_corners, solve_plane
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import (
    LaserPlaneResidual,
    LaserPlaneResult,
    PlaneInCamera,
    RefinedCamera,
)

_LEAST_VIEWS = 6
_FOLDS = 5

_FINDING_SHARE = 0.6
_LEAST_DISTANCE_SIGMAS = 3.0
_SMALLEST_MM, _LARGEST_MM = 2.0, 20_000.0  # that a cell's plane of light is seen on


def solve(given: StageInput) -> LaserPlaneResult:
    """Return the plane of light in the camera frame and the frame L, from captures of the board with the stripe.

    Raises
    ------
    InputError
        If the cell names no board, a file is of no use, or a frame's size is not the camera's.
    MeasurementError
        If no capture shows board and stripe.
    MotionError
        If the boards do not fix a plane.
    """
    camera, result = camera_of(given.session, given.read)
    return remembered("laser-plane", given.inputs_sha256, solve_laser_plane(given, camera, result))


def solve_laser_plane(
    given: StageInput, camera: CameraModel, camera_result: CameraResult | None = None
) -> LaserPlaneResult:
    """Return the plane of light for a camera; with the camera's result its uncertainty counts too."""
    boards = PlaneViews(given.session, camera, given.read)
    views, failed = _find_all(given, boards)
    if not views:
        if not failed:
            to_do = "Capture some and add them."
            raise InputError("frames of the board with the stripe on it", "none", to_do, "captures")
        first_name, first = likeliest_failure(failed)
        got = message(
            "{found} (none of {count} captures shows both board and stripe)", found=first.got, count=len(failed)
        )
        raise MeasurementError(first.need, got, first.to_do, first_name)

    def tell(fraction: float, what: str) -> None:
        given.progress(_FINDING_SHARE + (1 - _FINDING_SHARE) * fraction, what.capitalize())

    try:
        board = board_of(given.session.cell)
        known = known_of(given, camera, camera_result, views)
        solution = solve_plane(camera, views, known, tell, board.margin_mm)
    except MotionError as error:
        raise error.with_failures(failed) from None
    shape = known.shape if known is not None and camera_result is None else None
    bent = [] if shape is None else [shape.bend_mm(np.concatenate([v.board.points_in_board_mm for v in views]))]
    return _result(
        given, solution, failed, camera_result, [camera_codes.BOARD_SHAPE_SOLVED(bend_mm=mm) for mm in bent]
    )


def _find_all(given: StageInput, boards: PlaneViews) -> tuple[list[PlaneView], dict[str, MeasurementError]]:
    captures = [c for c in given.captures if c.kind == "frame" and not c.excluded]
    views: list[PlaneView] = []
    failed: dict[str, MeasurementError] = {}
    for number, capture in enumerate(captures):
        given.progress(
            _FINDING_SHARE * number / len(captures),
            message("Finding board and stripe in {capture}", capture=capture.id),
        )
        try:
            views.append(boards.of(capture))
        except MeasurementError as error:
            failed[capture.id] = error
    return views, failed


def known_of(
    given: StageInput, camera: CameraModel, result: CameraResult | None, views: Sequence[PlaneView]
) -> CameraUncertainty | None:
    """Return what is known of camera and board besides, to be refined with the plane; None: both are exact."""
    if result is not None:
        return _uncertainty(given, result)
    return bend_of(camera, [view.board for view in views], board_of(given.session.cell).flat)


def _uncertainty(given: StageInput, result: CameraResult) -> CameraUncertainty:
    """Return how well the camera is known, with the boards that it was found from besides the plane's."""
    from calib_core.optics.camera_layout import parameter_places

    board = board_of(given.session.cell)
    used = {row.capture for row in result.residuals if row.used}
    others = [c for c in given.session.captures if c.step == "camera" and c.id in used]
    boards = tuple(board_in(capture, board, given.read) for capture in others)
    places = parameter_places(result.parameters, with_board=True)
    told = result.board_shape
    shape = None if told is None else BoardShape(np.array(told.coefficients_mm), np.array(told.extent_mm))
    return CameraUncertainty(places, np.array(result.covariance, dtype=float), boards, shape)


def _result(
    given: StageInput,
    solution: PlaneSolution,
    failed: dict[str, MeasurementError],
    camera: CameraResult | None,
    bent: list[Finding],
) -> LaserPlaneResult:
    normal, distance = solution.normal, solution.distance_mm
    covariance = _with_pitch(solution.covariance, distance, camera)
    sigma_deg = rotation_sigma_deg(covariance)
    unused = lines_not_used(solution, failed, len(given.captures))
    found = [*noticed(solution, sigma_deg), *bent, *lost_rays(sum(view.without_ray for view in solution.views))]
    found += [solution.camera_held] if solution.camera_held else []
    found += [] if camera is None else not_covered(camera, solution)
    return LaserPlaneResult(
        method="robust plane through the stripe's points on the boards, then plane and board poses together",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(board_first([*found, *unused])),
        plane_in_camera=PlaneInCamera(normal=normal.tolist(), distance_mm=distance),
        camera_from_laser=camera_from_laser_of(normal, distance).to_rows(),
        plane_rms_mm=solution.rms_mm,
        covariance=camera_from_laser_covariance(normal, distance, covariance).tolist(),
        plane_covariance=covariance.tolist(),
        camera=None if camera is None else _refined(solution.camera),
        joint_parameters=[name for name in camera.parameters if not name.startswith("board")] if camera else [],
        joint_covariance=solution.joint_covariance.tolist(),
        normal_sigma_deg=sigma_deg,
        distance_sigma_mm=float(np.sqrt(covariance[3, 3])),
        residuals=_rows(given, solution, reasons_of(unused)),
    )


def _with_pitch(covariance: FloatArray, distance_mm: float, camera: CameraResult | None) -> FloatArray:
    """Return the plane's covariance (4, 4) with the error of the pitch that the robot's lengths show."""
    told = None if camera is None else camera.by_robot
    if told is None:
        return covariance
    excess = max(0.0, (told.pitch_factor - 1) ** 2 - told.pitch_sigma**2)
    grown = covariance.copy()
    grown[3, 3] += excess * distance_mm**2
    return grown


def noticed(solution: PlaneSolution, normal_sigma_deg: float) -> list[Finding]:
    """Return why the plane must not be used, or is less certain than it should be."""
    distance_sigma_mm = float(np.sqrt(solution.covariance[3, 3]))
    figures = [*solution.normal, solution.distance_mm, normal_sigma_deg, distance_sigma_mm, solution.rms_mm]
    if not np.isfinite(figures).all():
        return [codes.PLANE_NOT_FINITE()]
    found = plane_findings(solution.fit, solution.lines, normal_sigma_deg)
    if solution.distance_mm < _LEAST_DISTANCE_SIGMAS * distance_sigma_mm:
        found.append(
            codes.PLANE_THROUGH_CAMERA(distance_mm=solution.distance_mm, uncertainty_mm=2 * distance_sigma_mm)
        )
    if (focus := solution.focus) is not None and is_changed(focus):
        how, change = "longer" if focus.factor > 1 else "shorter", abs(focus.factor - 1)
        how = f"{how}-than-told" if focus.is_of_told else how
        found.append(codes.FOCUS_CHANGED(how=how, change=change, uncertainty=2 * focus.sigma))
    length_mm = 4 * solution.fit.length_mm  # two standard deviations to either side
    if not _SMALLEST_MM < length_mm < _LARGEST_MM:
        unit = "m" if length_mm < _LARGEST_MM else "um"
        found.append(codes.BOARD_PITCH_IN_OTHER_UNIT(length_mm=length_mm, unit=unit))
    left_out = [view.left_out for view in solution.views if view.left_out != "no-line"]
    rejected = sum(why is not None for why in left_out)
    if rejected > len(left_out) / 2:
        found.append(codes.MOST_LINES_OFF(rejected=rejected, count=len(left_out)))
    return found


def not_covered(camera: CameraResult, solution: PlaneSolution) -> list[Finding]:
    """Return whether the lens is a guess where the plane is seen, at the distances of the boards."""
    seen = camera.coverage
    if not seen.projection_sigma_px:  # an answer of before these were kept
        return []
    sigmas_px = np.array(seen.projection_sigma_px, dtype=float)
    light, depth_mm = (solution.normal, solution.distance_mm), (seen.near_mm, seen.far_mm)
    used_px = sigmas_in_light(solution.camera, sigmas_px, light, depth_mm)
    if not len(used_px):
        return []
    found = coverage_findings(seen.covered, extrapolation(used_px), float(used_px.max()))
    return [one for one in found if one.severity == "warning"]


def lines_not_used(solution: PlaneSolution, failed: dict[str, MeasurementError], count: int) -> list[Finding]:
    """Return which frames of `count` captures are not used."""
    dark = [view.name for view in solution.views if view.left_out == "no-line"]
    off: dict[str, dict[str, Value]] = {
        view.name: {"off_mm": view.line_rms_mm} for view in solution.views if view.left_out == "off-plane"
    }
    used = sum(view.left_out is None for view in solution.views)
    return [
        *frames_not_used(failed, used),
        *([camera_codes.FEW_FRAMES_USED(used=used, count=count)] if used < 0.5 * count else []),
        *([codes.LINE_OFF_PLANE(list(off), each=off)] if off else []),
        *([codes.NO_LINE_ON_BOARD(dark)] if dark else []),
    ]


def _refined(camera: CameraModel) -> RefinedCamera:
    return RefinedCamera(
        model=camera.model,
        image_size=camera.image_size,
        camera_matrix=camera.camera_matrix.tolist(),
        distortion=camera.distortion_by_name,
        segments=camera_segments(camera),
    )


def _rows(given: StageInput, solution: PlaneSolution, reasons: dict[str, str]) -> list[LaserPlaneResidual]:
    seen = {view.name: view for view in solution.views}
    rows: list[LaserPlaneResidual] = []
    for capture in given.captures:
        reason = reasons.get(capture.id)
        if capture.id in seen:
            rows.append(_row(seen[capture.id], reason))
            continue
        if capture.kind != "frame":
            reason = str(NOT_A_FRAME)
        elif capture.excluded:
            reason = str(EXCLUDED)
        rows.append(LaserPlaneResidual(capture=capture.id, used=False, reason=reason))
    return rows


def _row(view: ViewFigures, reason: str | None) -> LaserPlaneResidual:
    measured = view.points > 0
    return LaserPlaneResidual(
        capture=view.name,
        used=view.left_out is None,
        reason=reason,
        points=view.points,
        line_rms_mm=view.line_rms_mm if measured else None,
        line_mean_mm=view.line_mean_mm if measured else None,
        stripe_sigma_px=view.stripe_sigma_px,
        board_sigma_px=view.board_sigma_px if np.isfinite(view.board_sigma_px) else None,
        board_distance_mm=view.board_distance_mm,
    )


def bend_of(camera: CameraModel, views: Sequence[BoardView], flat: bool | None) -> CameraUncertainty | None:
    """Return how a board is bent, to be refined with the plane of light; None: it is flat, or nothing tells.

    Parameters
    ----------
    camera : CameraModel
        Exact.
    views : sequence of BoardView
    flat : bool or None
        What is told of the board; None: held-out views decide.
    """
    if flat or len(views) < _LEAST_VIEWS or not all(view.is_numbered for view in views):
        return None
    corners, state = posed_corners(camera, views)
    _, near, far = camera.bands
    known = Layout(camera.model, near, far, np.zeros(0, np.int64))
    layout, _ = choose_layout(corners, state, [known], _FOLDS, None if flat is None else True)
    if not layout.bends:
        return None
    end = Adjustment(corners, near, far, layout.free, HUBER).solve(state)
    start = shape_start(len(near))
    shape = BoardShape(end.state.shared[start : start + 7].copy(), corners.extent_mm)
    return CameraUncertainty(layout.free, end.covariance, (), shape)
