"""Raw frames in a session: camera and plane of light that turn them into profiles, solved where not brought.

What was solved is remembered by what it was solved from, so that fourteen frames of a sphere calibrate once.
"""

import threading
from collections.abc import Callable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.stripe import StripeCenters, find_stripe
from calib_core.optics.triangulate import ProfileCalibration, profile_from_frame
from calib_core.records import CameraResult, Capture, LaserPlaneResult, Session, Stage
from calib_core.session.boards import read_frame
from calib_core.session.measure import ReadFile

FloatArray = NDArray[np.float64]
_Solved = TypeVar("_Solved", CameraResult, LaserPlaneResult)

_REMEMBERED = 8
_lock = threading.Lock()
_solved: dict[tuple[Stage, str], CameraResult | LaserPlaneResult] = {}


def read_profile_frame(session: Session, capture: Capture, read: ReadFile) -> FloatArray:
    """Return the profile (N, 2), x and z in L, mm, of a capture that is one raw frame of the stripe.

    Raises
    ------
    InputError
        If the capture has not exactly one file, the file is no image of the camera's size, or neither the cell nor
        the session's captures tell of camera and plane of light.
    MeasurementError
        If no stripe is seen.
    """
    if len(capture.files) != 1:
        raise InputError(
            "one frame in a capture of the sphere",
            f"{len(capture.files)} files",
            "Give each its own capture.",
            capture.id,
        )
    return profile_from_frame(read_frame(capture, read), calibration_of(session, read))


def calibration_of(session: Session, read: ReadFile) -> ProfileCalibration:
    """Return what turns the session's frames into profiles: as brought in cell.known, else solved from captures.

    Raises
    ------
    InputError
        If neither is there.
    CalibrationError
        What the camera's or the plane's solver says.
    """
    known = session.cell.known.laser_plane
    if known is not None:
        camera, _ = camera_of(session, read)
        return ProfileCalibration.of(camera, known.normal, known.distance_mm)
    from calib_core.session.stage_camera import camera_from_result

    result = plane_of(session, read)
    camera = camera_from_result(result.camera) if result.camera else camera_of(session, read)[0]
    return ProfileCalibration.of(camera, result.plane_in_camera.normal, result.plane_in_camera.distance_mm)


def plane_of(session: Session, read: ReadFile) -> LaserPlaneResult:
    """Return the plane of light solved from the session's captures; raises as `calibration_of`."""
    from calib_core.session.stage_laser_plane import solve_laser_plane_stage

    _require(session, "laser-plane", "the plane of light", "cell.known.laser_plane")
    return _solve_once(session, read, "laser-plane", LaserPlaneResult, solve_laser_plane_stage)


def camera_of(session: Session, read: ReadFile) -> tuple[CameraModel, CameraResult | None]:
    """Return the session's camera, and the result it comes from if it was solved; raises as `calibration_of`."""
    known = session.cell.known.camera
    if known is not None:
        return CameraModel.from_known(known), None
    from calib_core.session.stage_camera import camera_from_result, solve_camera_stage

    _require(session, "camera", "the camera", "cell.known.camera")
    result = _solve_once(session, read, "camera", CameraResult, solve_camera_stage)
    return camera_from_result(result), result


def stripe_of(capture: Capture, read: ReadFile) -> StripeCenters:
    """Return the stripe in a laser-plane capture: in its second frame where it has two, the lit board first.

    Where the stripe's frame is as bright as the board's own, the board's is taken off.

    Raises
    ------
    InputError
        If there are more than two files or one is of no use.
    MeasurementError
        If there is no stripe.
    """
    if len(capture.files) > 2:
        raise InputError(
            "one or two frames in a laser-plane capture, the board lit and the stripe on it",
            f"{len(capture.files)} files",
            "Give each pose of the board its own capture.",
            capture.id,
        )
    frame = read_frame(capture, read, -1)
    if len(capture.files) == 1:
        return find_stripe(frame)
    lit = read_frame(capture, read, 0)
    if lit.shape == frame.shape and float(np.median(frame[::4, ::4])) > 0.5 * float(np.median(lit[::4, ::4])) > 5:
        return find_stripe(frame, dark=lit)
    return find_stripe(frame)


def _require(session: Session, stage: Stage, what: str, known: str) -> None:
    from calib_core.session.pipeline import stage_captures

    if not any(not capture.excluded for capture in stage_captures(session, stage)):
        raise InputError(
            f"{what} to turn frames into points",
            f"neither {known} nor captures with step '{stage}'",
            f"Capture the board for '{stage}', or bring {known}.",
            "session.json",
        )


def _solve_once(
    session: Session, read: ReadFile, stage: Stage, kind: type[_Solved], solve: Callable[..., _Solved]
) -> _Solved:
    """Return a stage's result, from memory where cell, captures and files are the same."""
    from calib_core.session.pipeline import inputs_sha256, stage_captures
    from calib_core.session.stage_tcp import StageInput

    inputs = inputs_sha256(session, stage, read)
    with _lock:
        found = _solved.get((stage, inputs))
    if isinstance(found, kind):
        return found
    return solve(StageInput(session, stage_captures(session, stage), read, inputs, lambda _fraction, _what: None))


def remembered(stage: Stage, inputs_sha256: str, result: _Solved) -> _Solved:
    """Return a stage's result, kept in memory for the later stages that rest on it."""
    with _lock:
        while len(_solved) >= _REMEMBERED:
            _solved.pop(next(iter(_solved)))
        _solved[stage, inputs_sha256] = result
    return result
