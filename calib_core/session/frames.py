"""Raw frames in a session: camera and plane of light that turn them into profiles, solved where not brought.

What was solved is remembered by what it was solved from, so that fourteen frames of a sphere calibrate once.
"""

import threading
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from calib_core.errors import InputError
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.stripe import StripeCenters, find_stripe
from calib_core.optics.triangulate import ProfileCalibration, profile_from_frame
from calib_core.records import (
    CameraResult,
    Capture,
    KnownCamera,
    KnownPlane,
    LaserPlaneResult,
    RefinedCamera,
    Session,
    Stage,
)
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
    frame, calibration = read_frame(capture, read), calibration_of(session, read)
    try:
        return profile_from_frame(frame, calibration)
    except InputError as error:
        raise error.at(capture.files[0]) from None


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


def can_be_calibrated(session: Session) -> bool:
    """Return whether camera and plane of light stand in the cell, or there are captures to solve them from."""
    known = session.cell.known
    steps = {capture.step for capture in session.captures if not capture.excluded}
    plane = known.laser_plane is not None or "laser-plane" in steps
    return plane and (known.camera is not None or not steps.isdisjoint({"camera", "laser-plane"}))


def with_solved_calibration(session: Session, results: Mapping[str, Mapping[str, Any]]) -> Session:
    """Return the session with camera and plane of light as they were solved, where the user brought none.

    Parameters
    ----------
    session : Session
    results : mapping
        Stored results by stage, as JSON data.
    """
    known, camera = session.cell.known, None
    if known.laser_plane is not None:
        plane = known.laser_plane
    elif "laser-plane" in results:
        solved = LaserPlaneResult.model_validate(results["laser-plane"])
        plane, camera = KnownPlane(**solved.plane_in_camera.model_dump()), solved.camera
    else:
        return session
    if known.camera is None and camera is None and "camera" in results:
        camera = CameraResult.model_validate(results["camera"])
    changes = {"laser_plane": plane, "camera": _known_camera(camera) if camera else known.camera}
    cell = session.cell.model_copy(update={"known": known.model_copy(update=changes)})
    return session.model_copy(update={"cell": cell})


def _known_camera(camera: CameraResult | RefinedCamera) -> KnownCamera:
    return KnownCamera.model_validate(
        {name: getattr(camera, name) for name in ("camera_matrix", "distortion", "image_size")}
        | {"segments": [band.model_dump() for band in camera.segments]}
    )


def recall(results: Mapping[str, Mapping[str, Any]]) -> None:
    """Take stored results of camera and plane of light, as JSON data, for those of a later stage's solve.

    They count only where they were solved from what the session holds then: what is stale is solved anew.
    """
    if "camera" in results:
        camera = CameraResult.model_validate(results["camera"])
        remembered("camera", camera.inputs_sha256, camera)
    if "laser-plane" in results:
        plane = LaserPlaneResult.model_validate(results["laser-plane"])
        remembered("laser-plane", plane.inputs_sha256, plane)


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
