"""What one capture says about the sphere: measured when it arrives, shown, and given to the solvers."""

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.errors import InputError, MeasurementError
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Cell, Measured, Session
from calib_core.robot_pose import parse_pose
from calib_core.session.advice import advise
from calib_core.session.files import parse_cloud, parse_profile
from calib_core.sphere.arc import ArcFit, fit_arc
from calib_core.sphere.cloud import SphereFit, fit_sphere

ReadFile = Callable[[str], bytes]

CENTER_SIGMA_MM = 0.02
"""Taken for centres that a scanner reports without saying how exact they are."""

SPHERE_STEPS = ("tcp", "turntable", "verify")
BOARD_STEPS = ("camera", "laser-plane")
_PREVIEW_POINTS = 400


@dataclass(frozen=True, eq=False)
class _Seen:
    """The points of one capture, and the circle or sphere fitted to them."""

    points: FloatArray
    on_sphere: NDArray[np.bool_]
    fit: ArcFit | SphereFit


def measure_capture(session: Session, capture: Capture, read: ReadFile) -> Measured:
    """Return what is seen in a capture; where the sphere is not found, the verdict `fail`, why, and what to do.

    Parameters
    ----------
    session : Session
        Its cell says what to look for.
    capture : Capture
    read : callable
        Returns the bytes of a file by its name in the capture.

    Raises
    ------
    InputError
        If a file or the pose is of no use: missing, empty, not numbers, cut off.
    TooLargeError
        If a file is larger than the limits.
    """
    if capture.kind == "frame" and capture.step in BOARD_STEPS:
        from calib_core.session.measure_frame import measure_frame

        return measure_frame(session, capture, read)
    if capture.kind in ("frame", "sweep") and _waits_for_calibration(session, capture):
        from calib_core.session.measure_frame import measure_stripe

        return measure_stripe(session, capture, read)
    if capture.kind == "sweep":
        from calib_core.session.sweep_sphere import measure_sweep

        return measure_sweep(session, capture, read)
    if capture.pose is not None or capture.step in SPHERE_STEPS:
        pose_of(session.cell, capture)
    if capture.kind == "center":
        assert capture.center_mm is not None
        return Measured(capture=capture.id, kind="center", verdict="pass", center_mm=capture.center_mm)
    try:
        points = _points(session, capture, read)
    except MeasurementError as error:  # a frame without a stripe
        reason = f"Need {error.need}, got {error.got}."
        return Measured(capture=capture.id, kind=capture.kind, verdict="fail", reason=reason, to_do=error.to_do)
    if capture.step not in SPHERE_STEPS:
        return Measured(
            capture=capture.id, kind=capture.kind, verdict="pass", points=len(points), preview=thinned(points)
        )
    try:
        seen = _see(session.cell, capture, points)
    except MeasurementError as error:
        return Measured(
            capture=capture.id,
            kind=capture.kind,
            verdict="fail",
            reason=f"Need {error.need}, got {error.got}.",
            to_do=error.to_do,
            points=len(points),
            preview=thinned(points),
            preview_on_sphere=[False] * len(thinned(points)),
        )
    return _measured(session.cell, capture, seen)


def observe_capture(session: Session, capture: Capture, read: ReadFile) -> SphereObservation:
    """Return a capture of the sphere as the solvers take it.

    Raises
    ------
    InputError
        If a file or the pose is of no use.
    MeasurementError
        If the sphere is not found in it.
    """
    pose = pose_of(session.cell, capture)
    sigma_mm = session.cell.scanner.point_sigma_mm
    if capture.kind == "center":
        return SphereObservation(
            capture=capture.id,
            base_from_tool0=pose,
            kind="center",
            points_in_laser_mm=np.empty((0, 3)),
            center_in_laser_mm=np.array(capture.center_mm, dtype=float),
            center_covariance=np.eye(3) * (sigma_mm or CENTER_SIGMA_MM) ** 2,
            point_sigma_mm=sigma_mm or CENTER_SIGMA_MM,
        )
    with _named(capture):
        seen = _see(session.cell, capture, _points(session, capture, read))
    fit, points = seen.fit, seen.points[seen.on_sphere]
    if isinstance(fit, ArcFit):
        return arc_observation(session.cell, capture, pose, points, fit)
    return SphereObservation(
        capture=capture.id,
        base_from_tool0=pose,
        kind="cloud",
        points_in_laser_mm=points,
        center_in_laser_mm=fit.center_mm,
        center_covariance=fit.covariance * _scale(sigma_mm, fit),
        point_sigma_mm=sigma_mm or fit.point_sigma_mm,
    )


def arc_observation(
    cell: Cell, capture: Capture, pose: RigidTransform, points_mm: FloatArray, fit: ArcFit
) -> SphereObservation:
    """Return an arc, its points (N, 2) in L, and the pose it was seen from as the solvers take them."""
    x, z = fit.center_mm
    return SphereObservation(
        capture=capture.id,
        base_from_tool0=pose,
        kind="profile",
        points_in_laser_mm=np.insert(points_mm, 1, 0.0, axis=1),
        center_in_laser_mm=np.array([x, 0.0, z]),
        center_covariance=fit.covariance * _scale(cell.scanner.point_sigma_mm, fit),
        circle_radius_mm=fit.radius_mm,
        point_sigma_mm=fit.point_sigma_mm,
        side=capture.side,
    )


def _scale(sigma_mm: float | None, fit: ArcFit | SphereFit) -> float:
    """Return what a fit's covariance is multiplied with where the points' noise is given."""
    return (sigma_mm / fit.point_sigma_mm) ** 2 if sigma_mm and fit.point_sigma_mm else 1.0


def read_points(capture: Capture, read: ReadFile) -> FloatArray:
    """Return the points of a profile or cloud capture, (N, 2) or (N, 3), in L.

    Raises
    ------
    InputError
        If the file is of no use, or the capture has not exactly one.
    """
    if len(capture.files) != 1:
        got = f"{len(capture.files)} files"
        raise InputError(f"one file in a {capture.kind} capture", got, "Give each its own capture.", capture.id)
    name = capture.files[0]
    if capture.kind == "profile":
        return parse_profile(read(name), name)
    if capture.kind == "cloud":
        return parse_cloud(read(name), name)
    raise InputError(
        "a capture of kind profile, cloud or center",
        f"kind '{capture.kind}', which this version cannot turn into points",
        "Export the scanner's calibrated profiles or clouds.",
        capture.id,
    )


def _waits_for_calibration(session: Session, capture: Capture) -> bool:
    """Return whether a capture is raw frames that nothing tells yet how to make points of."""
    from calib_core.session.frames import can_be_calibrated
    from calib_core.session.sweep import of_frames

    return of_frames(capture) and not can_be_calibrated(session)


def _points(session: Session, capture: Capture, read: ReadFile) -> FloatArray:
    """Return the points of a capture in L; a raw frame's by the session's camera and plane of light."""
    if capture.kind != "frame":
        return read_points(capture, read)
    from calib_core.session.frames import read_profile_frame

    return read_profile_frame(session, capture, read)


def pose_of(cell: Cell, capture: Capture) -> RigidTransform:
    """Return base_from_tool0 of a capture; raises InputError where its pose is missing or wrong."""
    if capture.pose is None:
        raise InputError(
            f"the robot's pose in the capture's field 'pose' ({cell.pose_convention})",
            "none",
            "Read the pose of the flange from the controller and add it.",
            capture.id,
        )
    return parse_pose(cell.pose_convention, capture.pose, capture.id)


def sphere_of(cell: Cell, captures: Sequence[Capture]) -> SphereSize:
    """Return the sphere's size; raises InputError where it is missing and a capture needs it."""
    diameter_mm = cell.sphere_diameter_mm
    if diameter_mm is None:
        if any(capture.kind in ("profile", "frame", "sweep") for capture in captures):
            raise InputError(
                "the sphere's diameter in cell.sphere_diameter_mm",
                "none",
                "Add it from the sphere's certificate: profiles cannot be understood without it.",
                "session.json",
            )
        diameter_mm = 1.0  # measured centres do not depend on it
    return SphereSize(diameter_mm, cell.sphere_diameter_sigma_mm or 0.0)


def _see(cell: Cell, capture: Capture, points: FloatArray) -> _Seen:
    diameter_mm = cell.sphere_diameter_mm
    if capture.kind in ("profile", "frame"):
        sphere_of(cell, [capture])
        arc = fit_arc(points, diameter_mm, cell.scanner.z_axis)
        return _Seen(points, arc.inliers, arc)
    sphere = fit_sphere(points, diameter_mm)
    return _Seen(points, sphere.inliers, sphere)


def _measured(cell: Cell, capture: Capture, seen: _Seen) -> Measured:
    fit = seen.fit
    zone = extent_deg = None
    if isinstance(fit, ArcFit):
        assert cell.sphere_diameter_mm is not None
        zone = 2 * fit.radius_mm / cell.sphere_diameter_mm
        extent_deg = float(np.rad2deg(fit.extent_rad))
        advice = advise(fit, seen.points, cell.sphere_diameter_mm)
    else:
        advice = None
    chosen = thinning(len(seen.points))
    return Measured(
        capture=capture.id,
        kind=capture.kind,
        verdict="warn" if advice else "pass",
        reason=advice[0] if advice else None,
        to_do=advice[1] if advice else None,
        points=len(seen.points),
        on_sphere=int(seen.on_sphere.sum()),
        center_mm=fit.center_mm.tolist(),
        radius_mm=fit.radius_mm,
        rms_mm=fit.rms_mm,
        point_sigma_mm=fit.point_sigma_mm,
        covariance=fit.covariance.tolist(),
        zone=zone,
        extent_deg=extent_deg,
        preview=thinned(seen.points),
        preview_on_sphere=seen.on_sphere[chosen].tolist(),
    )


def thinning(count: int) -> NDArray[np.intp]:
    """Return the indices of at most `_PREVIEW_POINTS` points, evenly spread over the capture."""
    return np.unique(np.linspace(0, count - 1, min(count, _PREVIEW_POINTS)).astype(np.intp))


def thinned(points: FloatArray) -> list[list[float]]:
    """Return at most so many of the points (N, 2 or 3) as rows, for drawing."""
    return np.round(points[thinning(len(points))], 4).tolist()


@contextmanager
def _named(capture: Capture) -> Generator[None]:
    """Let a measurement's error say which file it is about."""
    try:
        yield
    except MeasurementError as error:
        raise error.at(capture.files[0]) from None
