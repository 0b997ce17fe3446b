"""The hand-eye stage: the lit boards of posed frames, A X = Z B, and the tool that follows beside the sphere's."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from calib_core.captures.boards import board_first, frames_not_used
from calib_core.captures.plane_views import PlaneViews
from calib_core.captures.solved_optics import camera_of
from calib_core.cell.found import known_scanner
from calib_core.errors import InputError, MeasurementError
from calib_core.estimation import chance_of
from calib_core.findings import Finding, judgement, reasons_of
from calib_core.findings.codes import camera as camera_codes
from calib_core.findings.codes import recheck as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.optics.hand_eye import HandEye
from calib_core.records import Session
from calib_core.records.laser_plane_result import LaserPlaneResult
from calib_core.stages.hand_eye.record import Agreement, HandEyeResidual, HandEyeResult, by_board, by_name

_RARE = 0.01
_STEP = 1e-5  # rad and mm, of the numerical derivative
_WELL_SIGMA_MM, _WELL_SIGMA_DEG = 1.0, 0.5


def solve(given: StageInput) -> HandEyeResult:
    """Return the camera on the flange and the board in the base, and how the tool agrees with the sphere's.

    Raises
    ------
    InputError
        If the board is not fixed, or a file or a pose is of no use.
    MotionError
        If too few frames show the board, or all turns are about one axis.
    """
    board = given.session.cell.board
    if board is None or not board.fixed:
        need = "a board that stands still in the base (cell.board.fixed)"
        to_do = "Fix it, set cell.board.fixed, and take its frames with the robot's poses."
        raise InputError(need, "none" if board is None else "one that is moved by hand", to_do, "cell.board.fixed")
    camera, solved = camera_of(given.session, given.read)
    given.progress(0.3, "Finding the board in the frames")
    views = PlaneViews(given.session, camera, given.read)
    found = views.hand_eye if solved is None else views.hand_eye_within(solved)
    frames = views.frames
    given.progress(0.8, "Comparing with the sphere's answer")
    unused = not_used(found, list(frames), views.without_board)
    tool, covariance = _with_plane(given, found)
    agreement = None if tool is None or covariance is None else _agreement(given, tool, covariance)
    return HandEyeResult(
        method="A X = Z B in closed form, then by maximum likelihood of the robot's pose errors",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(board_first([*hand_eye_findings(found, agreement), *unused])),
        **by_name(found.mount_from_camera, found.holder_from_board),
        covariance=found.covariance[:6, :6].tolist(),
        board_covariance=found.covariance[6:12, 6:12].tolist(),
        pitch_factor=found.pitch_factor,
        pitch_sigma=found.pitch_sigma,
        position_sigma_mm=found.position_sigma_mm,
        orientation_sigma_deg=float(np.rad2deg(found.orientation_sigma_rad)),
        **by_board(tool),
        laser_covariance=None if covariance is None else covariance.tolist(),
        agreement=agreement,
        residuals=_residuals(given.session, found, frames, reasons_of(unused)),
    )


def not_used(found: HandEye, names: Sequence[str], without_board: Mapping[str, MeasurementError]) -> list[Finding]:
    """Return which frames do not count: those without the board, and those that contradict all others.

    Parameters
    ----------
    found : HandEye
    names : sequence of str
        The captures that it was solved from.
    without_board : mapping
        Why other captures show no board.
    """
    off = [names[number] for number in sorted(found.rejected)]
    told = frames_not_used(without_board, len(names))
    return [*told, camera_codes.VIEW_NOT_USED(off, each={name: {"off": "robot"} for name in off})] if off else told


def _residuals(
    session: Session,
    found: HandEye,
    frames: Mapping[str, tuple[RigidTransform, RigidTransform]],
    reasons: Mapping[str, str],
) -> list[HandEyeResidual]:
    rows: list[HandEyeResidual] = []
    for name in (c.id for c in session.captures if c.id in frames or c.id in reasons):
        off = {} if name not in frames else _apart(found, *frames[name])
        rows.append(HandEyeResidual(capture=name, used=name not in reasons, reason=reasons.get(name), **off))
    return rows


def _apart(found: HandEye, robot: RigidTransform, board: RigidTransform) -> dict[str, float]:
    """Return how far a frame's board is from where the robot's pose puts it."""
    predicted = found.predict(robot)
    off = predicted.camera_from_board.difference(board)
    return {
        "angle_deg": float(np.rad2deg(np.linalg.norm(off[:3]))),
        "shift_mm": float(np.linalg.norm(off[3:])),
        "mahalanobis": float(np.sqrt(off @ np.linalg.solve(predicted.covariance, off))),
    }


def _with_plane(given: StageInput, found: HandEye) -> tuple[RigidTransform | None, FloatArray | None]:
    """Return the scanner on the flange by the board and the plane of light, with its covariance (6, 6)."""
    steps = {capture.step for capture in given.session.captures if not capture.excluded}
    if given.session.cell.known.laser_plane is not None or "laser-plane" not in steps:
        return None, None
    plane = given.solve_other("laser-plane", lambda _fraction, _what: None)
    assert isinstance(plane, LaserPlaneResult)
    camera_from_laser = RigidTransform.from_rounded(plane.camera_from_laser, "camera", "laser")
    covariances = found.covariance[:6, :6], np.array(plane.covariance, dtype=float)
    return composed(found.mount_from_camera, camera_from_laser, *covariances)


def composed(
    first: RigidTransform, second: RigidTransform, of_first: FloatArray, of_second: FloatArray
) -> tuple[RigidTransform, FloatArray]:
    """Return the product of two poses that err independently, and its covariance (6, 6)."""
    whole = first @ second
    by_first, by_second = np.empty((6, 6)), np.empty((6, 6))
    for k in range(6):
        step = np.zeros(6)
        step[k] = _STEP
        by_first[:, k] = whole.difference(first.perturbed(step) @ second) / _STEP
        by_second[:, k] = whole.difference(first @ second.perturbed(step)) / _STEP
    return whole, by_first @ of_first @ by_first.T + by_second @ of_second @ by_second.T


def _agreement(given: StageInput, tool: RigidTransform, covariance: FloatArray) -> Agreement | None:
    """Return how far the board's tool is from the sphere's, None where there is no answer by the sphere."""
    cell = given.session.cell
    steps = {capture.step for capture in given.session.captures if not capture.excluded}
    if (brought := known_scanner(cell)) is not None:
        return agreement_of("known", tool, covariance, brought, np.zeros((6, 6)))
    if "tcp" not in steps:
        return None
    table = "turntable" in steps and cell.known.base_from_turntable is None
    stage = "chain" if table else "tcp"
    answer: Any = given.solve_other(stage, lambda _fraction, _what: None)
    return agreement_of(stage, tool, covariance, answer.mount_from_laser, np.array(answer.covariance, dtype=float))


def agreement_of(
    stage: str, board: RigidTransform, of_board: FloatArray, sphere: RigidTransform, of_sphere: FloatArray
) -> Agreement:
    """Return how far two tools lie apart, in units of both uncertainties (6, 6)."""
    off, both = sphere.difference(board), of_board + of_sphere
    squared = float(off @ np.linalg.solve(both, off))
    return Agreement(
        with_stage=stage,
        angle_deg=float(np.rad2deg(np.linalg.norm(off[:3]))),
        shift_mm=float(np.linalg.norm(off[3:])),
        sigmas=(off / np.sqrt(np.diag(both))).tolist(),
        distance=float(np.sqrt(squared)),
        chance=chance_of(squared, 6),
    )


def hand_eye_findings(found: HandEye, agreement: Agreement | None) -> list[Finding]:
    """Return what makes the board's second opinion weak, or that the sphere's answer is another."""
    sigmas = np.sqrt(np.diag(found.covariance)[:6])
    if float(np.rad2deg(sigmas[:3].max())) > _WELL_SIGMA_DEG or float(sigmas[3:].max()) > _WELL_SIGMA_MM:
        return [codes.CAMERA_WEAK()]
    if agreement is not None and agreement.chance < _RARE:
        return [
            codes.BOARD_AND_SPHERE_DIFFER(
                shift_mm=agreement.shift_mm, turn_deg=agreement.angle_deg, times=agreement.distance
            )
        ]
    return []
