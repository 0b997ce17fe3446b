"""The camera stage: the board found in every frame that shows it, the adjustment, a row of residuals a capture."""

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from calib_core.captures.boards import board_in, board_of, relative_pitch_sigma, shows_stripe_alone
from calib_core.captures.solved_optics import camera_segments, remembered
from calib_core.errors import CalibrationError, InputError, MeasurementError, MotionError
from calib_core.evidence.words import not_used
from calib_core.frames import RigidTransform
from calib_core.graph.stage import SOFTWARE
from calib_core.optics.board import BoardView
from calib_core.optics.board_refusal import COLOUR_NOTE
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_evidence import problems_of, remarks_of
from calib_core.optics.camera_model import TILT, CameraModel
from calib_core.optics.camera_solution import CameraSolution
from calib_core.optics.robot_lengths import RobotLengths, RobotPoses
from calib_core.poses.numbers import parse_pose
from calib_core.records import Board, Capture, Verdict
from calib_core.records.camera_result import (
    CameraByRobot,
    CameraCandidate,
    CameraCoverage,
    CameraResidual,
    CameraResult,
)

if TYPE_CHECKING:
    from calib_core.graph.stage_input import StageInput

_FAIL_RMS_PX = 3.0
_FINDING_SHARE = 0.7
_PITCH_SIGMAS, _HARMLESS_PITCH = 3.0, 1e-3  # what an ordinary arm's lengths are off themselves, some times over
_RARE = 0.001
_STRIPE_ALONE = "the stripe alone"


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
        first_name, first = next(iter(failed.items()))
        got = f"{first.got} (none of {len(captures)} frames shows the board)"
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
        given.progress(_FINDING_SHARE * number / len(captures), f"Finding the board in {capture.id}")
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
                f"frames of one size, {usual[0]}×{usual[1]} as in most captures",
                f"mixed image sizes, {view.image_size[0]}×{view.image_size[1]} here",
                "Take all frames with one camera and one setting, or remove this capture.",
                name,
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

    options = CameraOptions(refine_board=not board.flat)
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
    for name in views:
        told = captures[name].pose
        try:
            poses.append(None if told is None else parse_pose(cell.pose_convention, told, name))
        except CalibrationError:  # whoever needs the pose refuses it
            poses.append(None)
    if not any(poses):
        return None
    one_way_up = not any(view.turn_is_ambiguous for view in views.values())
    sigmas = cell.robot.position_sigma_mm, cell.robot.orientation_sigma_rad
    return RobotPoses(poses, *sigmas, one_way_up, relative_pitch_sigma(board))


def _result(
    given: "StageInput",
    solution: CameraSolution,
    views: dict[str, BoardView],
    failed: dict[str, MeasurementError],
    image_size: tuple[int, int],
) -> CameraResult:
    camera = solution.camera
    board = board_of(given.session.cell)
    problems = [*problems_of(solution), *_robot_problems(solution.robot, board)]
    rows = _rows(given, solution, views, failed)
    left_out = {
        row.capture: row.reason
        for row in rows
        if not row.used and row.reason and not row.reason.startswith(("excluded", _STRIPE_ALONE))
    }
    seen = solution.coverage
    return CameraResult(
        method="bundle adjustment of camera and board poses, least squares after robust rejection; "
        "model by held-out error",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        verdict=_verdict(solution, bool(problems), len(views) - len(solution.rejected), _expected_views(rows)),
        warnings=[*problems, *not_used(left_out, [row.capture for row in rows])],
        notes=[*remarks_of(solution), *_unverifiable(given, views, solution.robot)],
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
        candidates=[
            CameraCandidate(model=c.model, parameters=c.parameters, held_out_rms_px=c.held_out_rms_px)
            for c in solution.candidates
        ],
        coverage=CameraCoverage(
            counts=seen.counts.tolist(),
            covered=seen.covered,
            near_mm=seen.depth_mm[0],
            far_mm=seen.depth_mm[1],
            largest_tilt_rad=seen.largest_tilt_rad,
        ),
        by_robot=None if solution.robot is None else _by_robot(camera, solution.robot),
        residuals=rows,
    )


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


def _robot_problems(told: RobotLengths | None, board: Board) -> list[str]:
    """Return where the robot's lengths contradict pitch or camera, in sentences."""
    if told is None:
        return []
    off = told.pitch_factor - 1
    if abs(off) > max(_PITCH_SIGMAS * told.pitch_sigma, _HARMLESS_PITCH):
        pitch_mm, sigma_mm = board.pitch_mm * told.pitch_factor, board.pitch_mm * told.pitch_sigma
        return [
            f"The board's pitch is {pitch_mm:.3f} ± {2 * sigma_mm:.3f} mm by the robot's moves, and told as "
            f"{board.pitch_mm:g} mm: all lengths scale with it. Measure it over several squares and correct "
            "cell.board.pitch_mm."
        ]
    if told.chance < _RARE:
        return [
            "The robot's moves ask for another camera than the boards do, beyond both uncertainties: the stated "
            "one holds the difference. Check that the board is flat and stands still, and the robot's accuracy."
        ]
    return []


def _unverifiable(given: "StageInput", views: dict[str, BoardView], told: RobotLengths | None) -> list[str]:
    """Return what frames of this kind of board cannot tell, in sentences."""
    board = board_of(given.session.cell)
    sentences: list[str] = []
    if told is None:
        sentences.append(
            f"The board's pitch, {board.pitch_mm:g} mm, is not checked: frames of it look the same at any pitch, "
            "and all lengths scale with it. Measure it over several squares; of a board that stands still "
            "(cell.board.fixed) six robot poses check it."
        )
    if any(view.turn_is_ambiguous for view in views.values()):
        sentences.append(
            "The board looks the same turned by 180°, so the camera is right but a board's pose may be turned: "
            "take a chessboard with an odd sum of columns and rows, or ChArUco, where that matters."
        )
    in_colour = [name for name, view in views.items() if COLOUR_NOTE in view.notes]
    if in_colour:
        sentences.append(
            f"Frames in colour were turned into grey ({', '.join(in_colour[:5])}"
            f"{' …' if len(in_colour) > 5 else ''}): a camera that interpolates colours blurs the corners."
        )
    if board.kind != "charuco":
        sentences.append(
            f"A mirrored {board.kind} board looks like one that is not: if the driver mirrors frames, turn it off."
        )
    return sentences


def _verdict(solution: CameraSolution, problems: bool, used: int, captures: int) -> Verdict:
    if solution.reprojection_rms_px > _FAIL_RMS_PX:
        return "fail"
    return "warn" if problems or used < 0.5 * captures else "pass"


def _expected_views(rows: list[CameraResidual]) -> int:
    """Return how many captures should show the board."""
    return sum(not (row.reason or "").startswith(_STRIPE_ALONE) for row in rows)


def _rows(
    given: "StageInput",
    solution: CameraSolution,
    views: dict[str, BoardView],
    failed: dict[str, MeasurementError],
) -> list[CameraResidual]:
    place = {name: index for index, name in enumerate(views)}
    rows: list[CameraResidual] = []
    for capture in given.captures:
        if capture.kind != "frame":
            reason = f"a capture of kind '{capture.kind}', not a frame"
        elif capture.excluded:
            reason = "excluded by the user"
        elif capture.id in failed and shows_stripe_alone(given.session.cell, capture, given.read):
            reason = f"{_STRIPE_ALONE}: it serves the plane of light, the board is not seen"
        elif capture.id in failed:
            reason = failed[capture.id].reason
        else:
            rows.append(_row_of_view(capture.id, views[capture.id], solution, place[capture.id]))
            continue
        rows.append(CameraResidual(capture=capture.id, used=False, reason=reason))
    return rows


def _row_of_view(name: str, view: BoardView, solution: CameraSolution, index: int) -> CameraResidual:
    pose = solution.camera_from_board[index]
    rms, width = float(solution.view_rms_px[index]), view.edge_width_px
    return CameraResidual(
        capture=name,
        used=pose is not None,
        reason=solution.rejected.get(index),
        corners=len(view.ids),
        rms_px=rms if np.isfinite(rms) else None,
        edge_width_px=width if np.isfinite(width) else None,
        camera_from_board=None if pose is None else pose.to_rows(),
        points_px=np.round(view.points_px, 3).tolist(),
        residuals_px=np.round(solution.residuals_px[index], 4).tolist(),
    )
