"""What an uncertain camera and plane of light add to the TCP that frames of the sphere give.

The error is common to all captures, so that no residual shows it.  Its covariance is carried through by moving
camera and plane together along each of its principal directions, by one standard deviation, and fitting again.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib_core.captures.raw_frames import of_frames
from calib_core.captures.stripe_frames import calibration_of, plane_of
from calib_core.chain.moved import shift_by
from calib_core.chain.observations import SphereObservation
from calib_core.chain.tcp import TcpSolution
from calib_core.optics.camera_model import COEFFICIENTS, CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import Session
from calib_core.stages.laser_plane.record import LaserPlaneResult
from calib_core.stages.stage import ReadFile

FloatArray = NDArray[np.float64]

_LENS = ("fx", "fy", "cx", "cy")
_NEGLIGIBLE = 1e-8


def with_calibration_uncertainty(
    session: Session,
    read: ReadFile,
    observations: Sequence[SphereObservation],
    solution: TcpSolution,
) -> TcpSolution:
    """Return the solution with the covariance that camera and plane of light add; unchanged if they were brought.

    Parameters
    ----------
    session : Session
    read : callable
    observations : sequence of SphereObservation
        Those that the solution was found from.
    solution : TcpSolution
    """
    frames = {capture.id for capture in session.captures if of_frames(capture)}
    if session.cell.known.laser_plane is not None or not any(o.capture in frames for o in observations):
        return solution
    calibration = calibration_of(session, read)
    added = np.zeros((9, 9))
    for moved in _moved_calibrations(calibration, plane_of(session, read)):
        seen = [_moved(o, calibration, moved) if o.capture in frames else o for o in observations]
        shift = shift_by(solution, seen)
        added += np.outer(shift, shift)
    whole = solution.held.covariance.copy()
    whole[:9, :9] += added
    return replace(solution, covariance=solution.covariance + added, held=replace(solution.held, covariance=whole))


def _moved_calibrations(calibration: ProfileCalibration, plane: LaserPlaneResult) -> list[ProfileCalibration]:
    """Return the calibration moved by one standard deviation along each principal direction of its covariance."""
    covariance = np.array(plane.joint_covariance)
    scale = np.sqrt(np.diag(covariance))  # the parameters' units differ by many powers of ten
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    q = calibration.normal / calibration.distance_mm
    moved: list[ProfileCalibration] = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value < _NEGLIGIBLE:
            continue
        step = np.sqrt(value) * vector * scale
        camera = _moved_camera(calibration.camera, plane.joint_parameters, step[:-3])
        length = float(np.linalg.norm(q + step[-3:]))
        moved.append(ProfileCalibration.of(camera, (q + step[-3:]) / length, 1.0 / length))
    return moved


def _moved_camera(camera: CameraModel, names: Sequence[str], step: FloatArray) -> CameraModel:
    if camera.segments:  # a band's own coefficients move it far less than the lens, which all bands share
        pairs = [(name, change) for name, change in zip(names, step.tolist(), strict=True) if name in _LENS]
    else:
        pairs = list(zip(names, step.tolist(), strict=True))
    matrix, distortion = camera.camera_matrix.copy(), camera.distortion.copy()
    for name, change in pairs:
        if name in _LENS:
            row = _LENS.index(name)
            matrix[row % 2, row % 2 if row < 2 else 2] += change
        else:
            distortion[COEFFICIENTS.index(name)] += change
    return replace(camera, camera_matrix=matrix, distortion=distortion)


def _moved(
    observation: SphereObservation, calibration: ProfileCalibration, moved: ProfileCalibration
) -> SphereObservation:
    """Return what the same pixels would have shown with the moved calibration."""
    seen = calibration.camera_from_laser.apply(observation.points_in_laser_mm)
    points = moved.points(calibration.camera.project(seen))
    shift = (points - observation.points_in_laser_mm).mean(axis=0)
    return replace(
        observation, points_in_laser_mm=points, center_in_laser_mm=observation.center_in_laser_mm + shift
    )
