"""The camera stage: the board found in every frame that shows it, the adjustment, a row of residuals a capture."""

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from calib_core.captures.boards import (
    board_first,
    board_in,
    board_of,
    frames_not_used,
    likeliest_failure,
    relative_pitch_sigma,
)
from calib_core.captures.contradictions import EXCLUDED, NOT_A_FRAME
from calib_core.captures.plane_views import robot_pose
from calib_core.captures.solved_optics import camera_segments, remembered
from calib_core.cell.carriers import ball_on_flange
from calib_core.errors import CalibrationError, InputError, MeasurementError, MotionError
from calib_core.findings import Finding, judgement, reasons_of
from calib_core.findings.codes import camera as codes
from calib_core.frames import RigidTransform
from calib_core.graph.stage import SOFTWARE
from calib_core.messages import Value, message
from calib_core.optics.board import BoardView
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_evidence import camera_findings
from calib_core.optics.camera_model import TILT, CameraModel
from calib_core.optics.camera_solution import CameraSolution
from calib_core.optics.robot_lengths import RobotLengths, RobotPoses
from calib_core.records import Board, Capture
from calib_core.records.camera_result import (
    CameraByRobot,
    CameraCandidate,
    CameraCoverage,
    CameraResidual,
    CameraResult,
    SolvedBoardShape,
)
from calib_core.stages.camera.evidence import grid_rows

if TYPE_CHECKING:
    from calib_core.graph.stage_input import StageInput

_FINDING_SHARE = 0.7
_PITCH_SIGMAS, _HARMLESS_PITCH = 3.0, 1e-3  # what an ordinary arm's lengths are off themselves, some times over
_RARE = 0.001


def solve(given: "StageInput") -> CameraResult:
    """Return the camera from all frames that show the board, of camera and laser-plane captures.

    Raises
    ------
    InputError
        If the cell names no board, a file is of no use, or frames differ in size.
    MeasurementError
        If no frame shows the board.
    MotionError
        If the views do not determine a camera.
    """
    board = board_of(given.session.cell)
    captures = [c for c in given.captures if c.kind == "frame" and not c.excluded]
    views, failed = _find_all(given, captures, board)
    if not views:
        if not failed:
            raise InputError("frames of the board", "none", "Capture the board and add the frames.", "captures")
        first_name, first = likeliest_failure(failed)
        got = message("{found} (none of {count} frames shows the board)", found=first.got, count=len(captures))
        raise MeasurementError(first.need, got, first.to_do, first_name)
    image_size = _one_size(views)
    solution = _calibrate(given, views, image_size, failed, board)
    return remembered("camera", given.inputs_sha256, _result(given, solution, views, failed, image_size))


def _find_all(
    given: "StageInput", captures: list[Capture], board: Board
) -> tuple[dict[str, BoardView], dict[str, MeasurementError]]:
    views: dict[str, BoardView] = {}
    failed: dict[str, MeasurementError] = {}
    for number, capture in enumerate(captures):
        given.progress(
            _FINDING_SHARE * number / len(captures), message("Finding the board in {capture}", capture=capture.id)
        )
        try:
            views[capture.id] = board_in(capture, board, given.read)
        except MeasurementError as error:
            failed[capture.id] = error
    return views, failed


def _one_size(views: dict[str, BoardView]) -> tuple[int, int]:
    sizes = Counter(view.image_size for view in views.values())
    usual = sizes.most_common(1)[0][0]
    for name, view in views.items():
        if view.image_size != usual:
            raise InputError(
                "frames of one size, {width}×{height} as in most captures",
                "mixed image sizes, {width_other}×{height_other} here",
                "Take all frames with one camera and one setting, or remove this capture.",
                name,
                width=usual[0],
                height=usual[1],
                width_other=view.image_size[0],
                height_other=view.image_size[1],
            )
    return usual


def _calibrate(
    given: "StageInput",
    views: dict[str, BoardView],
    image_size: tuple[int, int],
    failed: dict[str, MeasurementError],
    board: Board,
) -> CameraSolution:
    def tell(fraction: float, what: str) -> None:
        given.progress(_FINDING_SHARE + (1 - _FINDING_SHARE) * fraction, what.capitalize())

    options = CameraOptions(refine_board=None if board.flat is None else not board.flat)
    try:
        return calibrate_camera(list(views.values()), image_size, options, tell, _robot_of(given, views, board))
    except MotionError as error:
        raise error.with_failures(failed) from None


def _robot_of(given: "StageInput", views: dict[str, BoardView], board: Board) -> RobotPoses | None:
    """Return the robot's poses of the views of a fixed board; None where none is told."""
    cell, captures = given.session.cell, {c.id: c for c in given.captures}
    if not board.fixed:
        return None
    poses: list[RigidTransform | None] = []
    for name, view in views.items():
        told = captures[name].pose if view.is_numbered else None
        try:
            poses.append(None if told is None else robot_pose(cell, captures[name]))
        except CalibrationError:  # whoever needs the pose refuses it
            poses.append(None)
    if not any(poses):
        return None
    one_way_up = not any(view.turn_is_ambiguous for view in views.values())
    sigmas = cell.robot.position_sigma_mm, cell.robot.orientation_sigma_rad
    return RobotPoses(poses, *sigmas, one_way_up, relative_pitch_sigma(board), ball_on_flange(cell))


def _result(
    given: "StageInput",
    solution: CameraSolution,
    views: dict[str, BoardView],
    failed: dict[str, MeasurementError],
    image_size: tuple[int, int],
) -> CameraResult:
    camera = solution.camera
    board = board_of(given.session.cell)
    unused = views_not_used(solution, views, failed, len(given.captures))
    found = [
        *camera_findings(solution, _plane_follows(given)),
        *by_robot_findings(solution.robot, board),
        *unverifiable(board, views, solution.robot),
        *unused,
    ]
    seen = solution.coverage
    return CameraResult(
        method="bundle adjustment of camera and board poses, least squares after robust rejection; "
        "model by held-out error",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(board_first(found)),
        model=camera.model,
        image_size=image_size,
        camera_matrix=camera.camera_matrix.tolist(),
        distortion=camera.distortion_by_name,
        tilt_rad=camera.distortion[TILT].tolist(),
        segments=camera_segments(camera),
        reprojection_rms_px=solution.reprojection_rms_px,
        corner_sigma_px=solution.corner_sigma_px,
        parameters=list(solution.parameters),
        covariance=solution.covariance.tolist(),
        inflation=solution.inflation,
        tilt_correlation=solution.tilt_correlation,
        board_bend_mm=solution.bend_mm,
        board_shape=None
        if (shape := solution.board_shape) is None
        else SolvedBoardShape(coefficients_mm=shape.coefficients_mm.tolist(), extent_mm=shape.extent_mm.tolist()),
        candidates=[
            CameraCandidate(model=c.model, parameters=c.parameters, held_out_rms_px=c.held_out_rms_px, bent=c.bent)
            for c in solution.candidates
        ],
        coverage=CameraCoverage(
            counts=seen.counts.tolist(),
            covered=seen.covered,
            near_mm=seen.depth_mm[0],
            far_mm=seen.depth_mm[1],
            largest_tilt_rad=seen.largest_tilt_rad,
            projection_sigma_px=grid_rows(seen.projection_sigma_px),
        ),
        by_robot=None if solution.robot is None else _by_robot(camera, solution.robot),
        residuals=_rows(given, solution, views, reasons_of(unused)),
    )


def _plane_follows(given: "StageInput") -> bool:
    """Whether a plane of light is solved with the camera: it tells which part of the image is used."""
    in_use = (one for one in given.captures if not one.excluded)
    return given.session.cell.known.laser_plane is None and any(one.step == "laser-plane" for one in in_use)


def _by_robot(camera: CameraModel, told: RobotLengths) -> CameraByRobot:
    focal = camera.camera_matrix[[0, 1], [0, 1]] + told.change[:2]
    return CameraByRobot(
        views=told.views,
        pitch_factor=told.pitch_factor,
        pitch_sigma=told.pitch_sigma,
        focal_px=focal.tolist(),
        focal_sigma_px=told.sigmas[:2].tolist(),
        chance=told.chance,
        position_sigma_mm=told.position_sigma_mm,
        orientation_sigma_deg=float(np.rad2deg(told.orientation_sigma_rad)),
    )


def by_robot_findings(told: RobotLengths | None, board: Board) -> list[Finding]:
    """Return where the robot's lengths contradict pitch or camera."""
    if told is None:
        return []
    off = told.pitch_factor - 1
    if abs(off) > max(_PITCH_SIGMAS * told.pitch_sigma, _HARMLESS_PITCH):
        pitch = board.pitch_mm
        shown_mm, uncertainty_mm = pitch * told.pitch_factor, 2 * pitch * told.pitch_sigma
        return [codes.PITCH_BY_ROBOT(pitch_mm=shown_mm, uncertainty_mm=uncertainty_mm, told_mm=pitch)]
    return [codes.CAMERA_BY_ROBOT()] if told.chance < _RARE else []


def unverifiable(board: Board, views: dict[str, BoardView], told: RobotLengths | None) -> list[Finding]:
    """Return what frames of this kind of board cannot tell."""
    found = [codes.PITCH_NOT_CHECKED(pitch_mm=board.pitch_mm)] if told is None else []
    if any(view.turn_is_ambiguous for view in views.values()):
        found.append(codes.BOARD_TURN_AMBIGUOUS())
    in_colour = [name for name, view in views.items() if view.in_colour]
    if in_colour:
        found.append(codes.FRAMES_IN_COLOUR(in_colour))
    if board.kind != "charuco" and (board.kind != "asymmetric-circles" or board.rows % 2):
        found.append(codes.BOARD_MAY_BE_MIRRORED())
    return found


def views_not_used(
    solution: CameraSolution, views: dict[str, BoardView], failed: dict[str, MeasurementError], expected: int
) -> list[Finding]:
    """Return which of the frames that should show the board are not used."""
    names, groups = list(views), dict[str, dict[str, dict[str, Value]]]()
    for place, values in solution.rejected.items():
        groups.setdefault(str(values["off"]), {})[names[place]] = values
    off = [codes.VIEW_NOT_USED(list(each), each=each) for each in groups.values()]
    used = len(views) - len(solution.rejected)
    few = [codes.FEW_FRAMES_USED(used=used, count=expected)] if used < 0.5 * expected else []
    return [*frames_not_used(failed, used), *few, *off]


def _rows(
    given: "StageInput", solution: CameraSolution, views: dict[str, BoardView], reasons: dict[str, str]
) -> list[CameraResidual]:
    place = {name: index for index, name in enumerate(views)}
    rows: list[CameraResidual] = []
    for capture in given.captures:
        if capture.kind != "frame":
            reason = str(NOT_A_FRAME)
        elif capture.excluded:
            reason = str(EXCLUDED)
        elif capture.id not in views:
            reason = reasons[capture.id]
        else:
            row = _row_of_view(capture.id, views[capture.id], solution, place[capture.id])
            rows.append(row.model_copy(update={"reason": reasons.get(capture.id)}))
            continue
        rows.append(CameraResidual(capture=capture.id, used=False, reason=reason))
    return rows


def _row_of_view(name: str, view: BoardView, solution: CameraSolution, index: int) -> CameraResidual:
    pose = solution.camera_from_board[index]
    rms, width = float(solution.view_rms_px[index]), view.edge_width_px
    return CameraResidual(
        capture=name,
        used=pose is not None,
        corners=len(view.ids),
        rms_px=rms if np.isfinite(rms) else None,
        edge_width_px=width if np.isfinite(width) else None,
        camera_from_board=None if pose is None else pose.to_rows(),
        points_px=np.round(view.points_px, 3).tolist(),
        residuals_px=np.round(solution.residuals_px[index], 4).tolist(),
    )
