"""The laser-plane stage: board and stripe found in every capture, the plane through them, one row a capture."""

import numpy as np

from calib_core.captures.boards import board_in, board_of
from calib_core.captures.camera_source import camera_of
from calib_core.captures.dark_boards import PlaneViews
from calib_core.captures.lost_rays import lost_rays
from calib_core.captures.solved_optics import camera_segments, remembered
from calib_core.errors import InputError, MeasurementError, MotionError
from calib_core.evidence.words import not_used
from calib_core.findings import sentence_of
from calib_core.frames import FloatArray
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.laser_plane import (
    camera_from_laser_covariance,
    camera_from_laser_of,
    plane_warnings,
    rotation_sigma_deg,
)
from calib_core.optics.laser_plane_joint import CameraUncertainty
from calib_core.optics.laser_plane_solve import (
    NO_LINE,
    PlaneSolution,
    PlaneView,
    ViewFigures,
    solve_plane,
)
from calib_core.records import Verdict
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import (
    LaserPlaneResidual,
    LaserPlaneResult,
    PlaneInCamera,
    RefinedCamera,
)

_FINDING_SHARE = 0.6
_FAIL_NORMAL_SIGMA_DEG = 2.0
_LEAST_DISTANCE_SIGMAS = 3.0


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
        first_name, first = next(iter(failed.items()), ("captures", None))
        if first is None:
            raise InputError(
                "frames of the board with the stripe on it", "none", "Capture some and add them.", "captures"
            )
        got = f"{first.got} (none of {len(failed)} captures shows both board and stripe)"
        raise MeasurementError(first.need, got, first.to_do, first_name)

    def tell(fraction: float, what: str) -> None:
        given.progress(_FINDING_SHARE + (1 - _FINDING_SHARE) * fraction, what.capitalize())

    try:
        solution = solve_plane(camera, views, _uncertainty(given, camera_result, boards.lent), tell)
    except MotionError as error:
        raise error.with_failures(failed) from None
    return _result(given, solution, failed, camera_result)


def _find_all(given: StageInput, boards: PlaneViews) -> tuple[list[PlaneView], dict[str, MeasurementError]]:
    captures = [c for c in given.captures if c.kind == "frame" and not c.excluded]
    views: list[PlaneView] = []
    failed: dict[str, MeasurementError] = {}
    for number, capture in enumerate(captures):
        given.progress(_FINDING_SHARE * number / len(captures), f"Finding board and stripe in {capture.id}")
        try:
            views.append(boards.of(capture))
        except MeasurementError as error:
            failed[capture.id] = error
    return views, failed


def _uncertainty(given: StageInput, result: CameraResult | None, lent: set[str]) -> CameraUncertainty | None:
    """Return how well the camera is known, with the boards that it was found from besides the plane's.

    Those that are `lent` to a stripe count with it already.
    """
    if result is None:
        return None
    from calib_core.optics.camera_layout import parameter_places

    own = [i for i, name in enumerate(result.parameters) if not name.startswith("board")]
    covariance = np.array(result.covariance)[np.ix_(own, own)]
    board = board_of(given.session.cell)
    if not board.flat:  # the refinement takes boards to be flat
        return CameraUncertainty(parameter_places(result.parameters), covariance)
    used = {row.capture for row in result.residuals if row.used} - lent
    others = [c for c in given.session.captures if c.step == "camera" and c.id in used]
    boards = tuple(board_in(capture, board, given.read) for capture in others)
    return CameraUncertainty(parameter_places(result.parameters), covariance, boards)


def _result(
    given: StageInput, solution: PlaneSolution, failed: dict[str, MeasurementError], camera: CameraResult | None
) -> LaserPlaneResult:
    normal, distance = solution.normal, solution.distance_mm
    covariance = _with_pitch(solution.covariance, distance, camera)
    sigma_deg = rotation_sigma_deg(covariance)
    rows = _rows(given, solution, failed)
    warnings = plane_warnings(solution.fit, solution.lines, sigma_deg)
    left_out = {
        row.capture: row.reason
        for row in rows
        if not row.used and row.reason and not row.reason.startswith("excluded")
    }
    verdict: Verdict = "warn" if warnings or sum(row.used for row in rows) < 0.5 * len(rows) else "pass"
    failures = plane_failures(solution, sigma_deg)
    if failures:
        verdict, warnings = "fail", [*failures, *warnings]
    return LaserPlaneResult(
        method="robust plane through the stripe's points on the boards, then plane and board poses together",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        verdict=verdict,
        notes=_notes(solution),
        warnings=[*warnings, *not_used(left_out, [row.capture for row in rows])],
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
        residuals=rows,
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


def plane_failures(solution: PlaneSolution, normal_sigma_deg: float) -> list[str]:
    """Return why the plane must not be used."""
    distance_sigma_mm = float(np.sqrt(solution.covariance[3, 3]))
    figures = [*solution.normal, solution.distance_mm, normal_sigma_deg, distance_sigma_mm, solution.rms_mm]
    if not np.isfinite(figures).all():
        return [
            "The plane is not determined: its figures are not finite. Capture more boards, near, far and tilted."
        ]
    failures: list[str] = []
    if normal_sigma_deg > _FAIL_NORMAL_SIGMA_DEG:
        failures.append(f"The plane's normal is known only to ±{2 * normal_sigma_deg:.1f}° (k = 2).")
    if solution.distance_mm < _LEAST_DISTANCE_SIGMAS * distance_sigma_mm:
        failures.append(
            f"The plane runs through the camera's centre within its uncertainty ({solution.distance_mm:.2f} ± "
            f"{2 * distance_sigma_mm:.2f} mm): such a laser gives no depth. Check board, pitch and camera."
        )
    measured = [view for view in solution.views if view.reason != NO_LINE]
    rejected = sum(view.reason is not None for view in measured)
    if rejected > len(measured) / 2:
        failures.append(
            f"{rejected} of {len(measured)} lines lie off the plane of the others: boards or camera moved, or the "
            "pitch is wrong."
        )
    return failures


def _notes(solution: PlaneSolution) -> list[str]:
    dropped = sum(view.without_ray for view in solution.views)
    found = [sentence_of(finding) for finding in lost_rays(dropped)]
    if not solution.camera_held:
        return found
    return [
        *found,
        f"The camera is the one that the boards' corners gave: {solution.camera_held}. Its uncertainty is in the "
        "plane's.",
    ]


def _refined(camera: CameraModel) -> RefinedCamera:
    return RefinedCamera(
        model=camera.model,
        image_size=camera.image_size,
        camera_matrix=camera.camera_matrix.tolist(),
        distortion=camera.distortion_by_name,
        segments=camera_segments(camera),
    )


def _rows(
    given: StageInput, solution: PlaneSolution, failed: dict[str, MeasurementError]
) -> list[LaserPlaneResidual]:
    seen = {view.name: view for view in solution.views}
    rows: list[LaserPlaneResidual] = []
    for capture in given.captures:
        if capture.id in seen:
            rows.append(_row(seen[capture.id]))
            continue
        if capture.kind != "frame":
            reason = f"a capture of kind '{capture.kind}', not a frame"
        elif capture.excluded:
            reason = "excluded by the user"
        else:
            reason = failed[capture.id].reason
        rows.append(LaserPlaneResidual(capture=capture.id, used=False, reason=reason))
    return rows


def _row(view: ViewFigures) -> LaserPlaneResidual:
    measured = view.points > 0
    return LaserPlaneResidual(
        capture=view.name,
        used=view.reason is None,
        reason=view.reason,
        points=view.points,
        line_rms_mm=view.line_rms_mm if measured else None,
        line_mean_mm=view.line_mean_mm if measured else None,
        stripe_sigma_px=view.stripe_sigma_px,
        board_sigma_px=view.board_sigma_px if np.isfinite(view.board_sigma_px) else None,
        board_distance_mm=view.board_distance_mm,
    )
