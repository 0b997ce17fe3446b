"""The session's camera: brought by the user, or solved from the session's own captures."""

from calib_core.captures.solved_optics import camera_from_result, solve_once
from calib_core.errors import InputError
from calib_core.graph.keys import stage_captures
from calib_core.optics.camera_model import CameraModel
from calib_core.records import Session, StageName
from calib_core.records.callbacks import ReadFile
from calib_core.records.camera_result import CameraResult


def camera_of(session: Session, read: ReadFile) -> tuple[CameraModel, CameraResult | None]:
    """Return the session's camera, and the result it comes from if it was solved; raises as `calibration_of`."""
    known = session.cell.known.camera
    if known is not None:
        return CameraModel.from_known(known), None
    require_captures_of(session, "camera", "the camera", "cell.known.camera")
    result = solve_once(session, read, CameraResult)
    return camera_from_result(result), result


def require_captures_of(session: Session, stage: StageName, what: str, known: str) -> None:
    """Raise InputError where a session has no captures that a stage takes, of which frames need the result."""
    if not any(not capture.excluded for capture in stage_captures(session, stage)):
        got = "neither {known} nor captures with step '{stage}'"
        to_do = "Capture the board for '{stage}', or bring {known}."
        need = "{what} to turn frames into points"
        raise InputError(need, got, to_do, "session.json", what=what, known=known, stage=stage)
