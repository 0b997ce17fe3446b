"""One capture of the sphere as the solvers take it."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Literal

import numpy as np

from calib_core.captures.capture_observation import Doubts, Seen
from calib_core.captures.content import diameter_in_sight_mm, open_sizes, own_size, pose_of, reading_of, sphere_of
from calib_core.captures.lost_rays import SeenPoints
from calib_core.captures.observation_cache import seen_once
from calib_core.captures.raw_frames import of_frames
from calib_core.cell.axes import read_axes
from calib_core.cell.carriers import carriers_of, scanner_name, scanner_names, scanner_place, scanner_told
from calib_core.chain.observations import SphereObservation
from calib_core.errors import CalibrationError, MeasurementError
from calib_core.formats.format import Reading
from calib_core.formats.points import known_points
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Cell, ReadFile, Session
from calib_core.sphere.arc import ArcFit, fit_arc, without_rim
from calib_core.sphere.cloud import SphereFit, fit_sphere
from calib_core.steps import steps_that_show

_ENOUGH, _MOST_READ = 5, 12
_CLEAR = 0.2  # of the radius: how far before its centre the middle of the seen part must lie

CENTER_SIGMA_MM = 0.02
"""Taken for centres that a scanner reports without saying how exact they are."""


def observe_capture(session: Session, capture: Capture, read: ReadFile) -> SphereObservation:
    """Return a capture of the sphere as the solvers take it.

    Raises
    ------
    InputError
        If a file or the pose is of no use.
    MeasurementError
        If the sphere is not found in it.
    """
    pose, carriers = pose_of(session.cell, capture), carriers_of(session.cell, capture)
    sigma_mm = scanner_told(session.cell, capture).point_sigma_mm
    if capture.kind == "center":
        return SphereObservation(
            capture=capture.id,
            base_from_tool0=pose,
            kind="center",
            points_in_laser_mm=np.empty((0, 3)),
            center_in_laser_mm=np.array(capture.center_mm, dtype=float),
            center_covariance=np.eye(3) * (sigma_mm or CENTER_SIGMA_MM) ** 2,
            point_sigma_mm=sigma_mm or CENTER_SIGMA_MM,
            carriers=carriers,
            scanner=scanner_name(session.cell, capture),
            listed=scanner_place(session.cell, capture),
            readings=read_axes(session.cell, capture),
        )
    with _named(capture):
        seen = see_sphere(session, capture, read)
    fit, points = seen.fit, seen.points[seen.on_sphere]
    if isinstance(fit, ArcFit):
        return arc_observation(session.cell, capture, pose, points, fit, seen.without_ray)
    return SphereObservation(
        capture=capture.id,
        base_from_tool0=pose,
        kind="cloud",
        points_in_laser_mm=points,
        center_in_laser_mm=fit.center_mm,
        center_covariance=fit.covariance * _scale(sigma_mm, fit),
        point_sigma_mm=sigma_mm or fit.point_sigma_mm,
        carriers=carriers,
        scanner=scanner_name(session.cell, capture),
        listed=scanner_place(session.cell, capture),
        readings=read_axes(session.cell, capture),
        sphere=own_size(session.cell, capture),
    )


def arc_observation(
    cell: Cell, capture: Capture, pose: RigidTransform, points_mm: FloatArray, fit: ArcFit, without_ray: int = 0
) -> SphereObservation:
    """Return an arc, its points (N, 2) in L, and the pose it was seen from as the solvers take them.

    `without_ray`: how many stripe centres of its frame were dropped.
    """
    x, z = fit.center_mm
    told = scanner_told(cell, capture)
    return SphereObservation(
        capture=capture.id,
        base_from_tool0=pose,
        kind="profile",
        points_in_laser_mm=np.insert(points_mm, 1, 0.0, axis=1),
        center_in_laser_mm=np.array([x, 0.0, z]),
        center_covariance=fit.covariance * _scale(told.point_sigma_mm, fit),
        circle_radius_mm=fit.radius_mm,
        point_sigma_mm=fit.point_sigma_mm,
        side=capture.side,
        without_ray=without_ray,
        carriers=carriers_of(cell, capture),
        scanner=scanner_name(cell, capture),
        listed=scanner_place(cell, capture),
        readings=read_axes(cell, capture),
        common_sigma_mm=told.point_sigma_mm if scanner_names(cell) else None,
        sphere=own_size(cell, capture),
        sizes=open_sizes(cell, capture),
    )


def _scale(sigma_mm: float | None, fit: ArcFit | SphereFit) -> float:
    """Return what a fit's covariance is multiplied with where the points' noise is given."""
    return (sigma_mm / fit.point_sigma_mm) ** 2 if sigma_mm and fit.point_sigma_mm else 1.0


def points_of(session: Session, capture: Capture, read: ReadFile) -> SeenPoints:
    """Return the points of a capture in L; a raw frame's by the session's camera and plane of light."""
    if capture.kind != "frame":
        reading = reading_of(capture, read)
        _doubts(capture, read, reading)  # asked for next, as a rule: so the file is read once
        return SeenPoints(known_points(reading, capture.files[0]))
    from calib_core.captures.stripe_frames import see_profile_frame

    return see_profile_frame(session, capture, read)


def doubts_of(capture: Capture, read: ReadFile) -> list[str]:
    """Return what the reader of a profile or cloud capture's file doubts; raises as `reading_of`."""
    return _doubts(capture, read, None).sentences


def _doubts(capture: Capture, read: ReadFile, reading: Reading | None) -> Doubts:
    told = [capture.kind, capture.format, capture.format_settings]
    return seen_once(
        Doubts, capture.files, read, told, lambda: Doubts(list((reading or reading_of(capture, read)).doubts))
    )


def see_sphere(session: Session, capture: Capture, read: ReadFile) -> Seen:
    """Return the circle or sphere in a capture's points; raises as `observe_capture`."""
    cell = session.cell
    sphere_of(cell, [capture])
    told = point_settings(session, capture, read)
    return seen_once(
        Seen, capture.files, read, told, lambda: _look(session, capture, points_of(session, capture, read), read)
    )


def point_settings(session: Session, capture: Capture, read: ReadFile) -> list[object]:
    """Return all but its files' bytes that the sphere in a capture's points depends on, as JSON data."""
    cell = session.cell
    diameter_mm, z_axis = diameter_in_sight_mm(cell, capture), scanner_told(cell, capture).z_axis
    told: list[object] = [capture.kind, capture.format, capture.format_settings, diameter_mm, z_axis]
    if of_frames(capture):
        from calib_core.captures.stripe_frames import calibration_of

        told.append(calibration_of(session, read).digest)
    return told


def _look(session: Session, capture: Capture, seen: SeenPoints, read: ReadFile) -> Seen:
    cell = session.cell
    points, diameter_mm = seen.points, diameter_in_sight_mm(cell, capture)
    if capture.kind in ("profile", "frame"):
        arc = fit_arc(points, diameter_mm, scanner_told(cell, capture).z_axis)
        if diameter_mm is not None and of_frames(capture):
            from calib_core.captures.stripe_frames import calibration_of

            eye_mm = calibration_of(session, read).camera_from_laser.inverse().translation_mm
            arc = without_rim(points, arc, diameter_mm / 2, eye_mm)
        return Seen(points, arc.inliers, arc, seen.without_ray)
    sphere = fit_sphere(points, diameter_mm)
    return Seen(points, sphere.inliers, sphere)


@contextmanager
def _named(capture: Capture) -> Generator[None]:
    """Let a measurement's error say which file it is about."""
    try:
        yield
    except MeasurementError as error:
        raise error.at(capture.files[0]) from None


def side_of_ball(session: Session, read: ReadFile) -> Literal[1, -1] | None:
    """Return 1 where captures of the ball show z growing away from the scanner, −1 where toward it.

    None where there are none, where they do not agree, or where `z_axis` was told of every scanner.
    """
    steps = steps_that_show("sphere", "sphere-on-table")
    every = [c for c in session.captures if c.step in steps and c.kind != "center" and not c.excluded]
    captures = [c for c in every if scanner_told(session.cell, c).z_axis is None]
    sides: list[int] = []
    for capture in captures[:_MOST_READ]:
        try:
            seen = see_sphere(session, capture, read)
        except CalibrationError:
            continue  # its own stage says what is wrong with it
        fit = seen.fit
        if isinstance(fit, ArcFit):
            sides.append(fit.visible_side)
        else:
            before = float(fit.center_mm[2] - np.mean(seen.points[seen.on_sphere, 2]))
            if abs(before) > _CLEAR * fit.radius_mm:
                sides.append(1 if before > 0 else -1)
        if len(sides) == _ENOUGH:
            break
    if not sides or len(set(sides)) > 1:
        return None
    return 1 if sides[0] > 0 else -1
