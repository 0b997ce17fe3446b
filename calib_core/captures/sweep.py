"""Sweeps: many profiles, or raw frames of the stripe, each with the robot's pose at its time."""

from pathlib import PurePosixPath

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.content import read_as
from calib_core.captures.lost_rays import SeenPoints
from calib_core.captures.raw_frames import IMAGES
from calib_core.captures.stripe_frames import calibration_of
from calib_core.errors import InputError, MeasurementError
from calib_core.formats.points import known_points
from calib_core.formats.shared.images import decode_image
from calib_core.frames import RigidTransform
from calib_core.optics.triangulate import stripe_in_frame
from calib_core.pose_track import interpolate_poses
from calib_core.poses.numbers import parse_pose
from calib_core.records import Capture, Cell, ReadFile, Session


def sweep_poses(cell: Cell, capture: Capture) -> list[RigidTransform]:
    """Return base_from_tool0 of each of a sweep's files: as given, or interpolated in the pose track by time.

    Raises
    ------
    InputError
        If neither poses nor times with a track are there, their number is not the files', or a pose is wrong.
    """
    count = len(capture.files)
    if capture.poses is not None:
        _require_count(len(capture.poses), count, "poses", capture)
        return [
            parse_pose(cell.pose_convention, numbers, f"{capture.id}: poses[{place}]")
            for place, numbers in enumerate(capture.poses)
        ]
    if capture.timestamps_s is None or capture.pose_track is None:
        to_do = "Add the robot's pose for each file, or the times and the track to interpolate in."
        raise InputError("'poses', or 'timestamps_s' with 'pose_track', in a sweep", "neither", to_do, capture.id)
    _require_count(len(capture.timestamps_s), count, "timestamps_s", capture)
    track = [
        parse_pose(cell.pose_convention, sample.pose, f"{capture.id}: pose_track[{place}]")
        for place, sample in enumerate(capture.pose_track)
    ]
    times = [sample.t_s for sample in capture.pose_track]
    return interpolate_poses(times, track, capture.timestamps_s, capture.id)


def read_sweep(
    session: Session, capture: Capture, read: ReadFile, may_be_blank: bool = False
) -> list[tuple[RigidTransform, NDArray[np.float64]]]:
    """Return base_from_tool0 and the profile (N, 2), x and z in L, mm, of each of a sweep's files, in their order.

    Raises
    ------
    InputError
        If a file or a pose is of no use, or frames come without a calibrated camera and plane of light.
    MeasurementError
        If a frame shows no stripe, unless they may be blank: then its profile has no points.
    """
    poses = sweep_poses(session.cell, capture)
    names = zip(poses, capture.files, strict=True)
    return [(pose, sweep_profile(session, capture, name, read, may_be_blank).points) for pose, name in names]


def sweep_profile(
    session: Session, capture: Capture, name: str, read: ReadFile, may_be_blank: bool = False
) -> SeenPoints:
    """Return the profile (N, 2), x and z in L, mm, of one of a sweep's files; raises as `read_sweep` does.

    It is read in the format and with the settings that the capture names.
    """
    if PurePosixPath(name).suffix.lower() in IMAGES:
        frame, calibration = decode_image(read(name), name), calibration_of(session, read)
        try:
            found = stripe_in_frame(frame, calibration)
            return SeenPoints(found.profile_mm, found.without_ray)
        except InputError as error:
            raise error.at(name) from None
        except MeasurementError:
            if not may_be_blank:
                raise
            return SeenPoints(np.empty((0, 2)))
    reading = read_as(capture, name, read, "profile")
    is_blank = may_be_blank and not reading.known.any()
    return SeenPoints(np.empty((0, 2)) if is_blank else known_points(reading, name))


def _require_count(got: int, files: int, field: str, capture: Capture) -> None:
    if got != files:
        need = "as many {field} as files, {files}"
        to_do = "Give one for each, in their order."
        raise InputError(need, f"{got}", to_do, capture.id, field=field, files=files)
