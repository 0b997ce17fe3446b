"""Raw frames in a session: camera and plane of light that turn them into profiles, solved where not brought.

What was solved is remembered by what it was solved from, so that fourteen frames of a sphere calibrate once.
"""

from calib_core.captures.boards import read_frame
from calib_core.captures.lost_rays import SeenPoints
from calib_core.captures.solved_optics import camera_from_result, camera_of, require_captures_of, solve_once
from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.messages import plural
from calib_core.optics.triangulate import ProfileCalibration, stripe_in_frame
from calib_core.records import Capture, KnownCamera, KnownPlane, ReadFile, ResultsData, Session
from calib_core.records.camera_result import CameraResult
from calib_core.records.laser_plane_result import LaserPlaneResult, RefinedCamera
from calib_core.steps import steps_that_show


def read_profile_frame(session: Session, capture: Capture, read: ReadFile) -> FloatArray:
    """Return the profile (N, 2), x and z in L, mm, of such a capture; raises as `see_profile_frame`."""
    return see_profile_frame(session, capture, read).points


def see_profile_frame(session: Session, capture: Capture, read: ReadFile) -> SeenPoints:
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
        got = plural("{count} file", "{count} files", by="count", count=len(capture.files))
        to_do = "Give each its own capture."
        raise InputError("one frame in a capture of the sphere", got, to_do, capture.id)
    frame, calibration = read_frame(capture, read), calibration_of(session, read)
    try:
        found = stripe_in_frame(frame, calibration)
    except InputError as error:
        raise error.at(capture.files[0]) from None
    return SeenPoints(found.profile_mm, found.without_ray)


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
    result = plane_of(session, read)
    camera = camera_from_result(result.camera) if result.camera else camera_of(session, read)[0]
    return ProfileCalibration.of(camera, result.plane_in_camera.normal, result.plane_in_camera.distance_mm)


def can_be_calibrated(session: Session) -> bool:
    """Return whether camera and plane of light stand in the cell, or there are captures to solve them from."""
    known = session.cell.known
    steps = {capture.step for capture in session.captures if not capture.excluded}
    plane = known.laser_plane is not None or "laser-plane" in steps
    return plane and (known.camera is not None or not steps.isdisjoint(steps_that_show("board")))


def with_solved_calibration(session: Session, results: ResultsData) -> Session:
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


def plane_of(session: Session, read: ReadFile) -> LaserPlaneResult:
    """Return the plane of light solved from the session's captures; raises as `calibration_of`."""
    require_captures_of(session, "laser-plane", "the plane of light", "cell.known.laser_plane")
    return solve_once(session, read, LaserPlaneResult)
