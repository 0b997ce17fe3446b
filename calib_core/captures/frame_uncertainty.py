"""What uncertain camera and plane of light add to the answers that frames of the sphere give.

The error is common to all captures, so that no residual shows it.  Its covariance is carried through along its
principal directions, the camera's first, with the plane following it, then what that leaves open of the plane:
captures' points move by one standard deviation, and tool and table follow (`chain.moved`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.captures.raw_frames import of_frames
from calib_core.captures.stripe_frames import calibration_of, plane_of
from calib_core.chain.held import Held
from calib_core.chain.moved import OpticsError, OpticsSource, at_point_by, shift_by, spread_of
from calib_core.chain.table_frame import frame_covariance
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.whole import ChainSolution
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray
from calib_core.optics.camera_model import COEFFICIENTS, CameraModel
from calib_core.optics.triangulate import ProfileCalibration
from calib_core.records import ReadFile, Session

_LENS = ("fx", "fy", "cx", "cy")
_NEGLIGIBLE = 1e-8
_STEP_MM = 1.0


@dataclass(frozen=True, eq=False)
class MovedCalibration:
    """A calibration moved by one standard deviation along one direction, and whose error that is."""

    source: OpticsSource
    calibration: ProfileCalibration


def with_calibration_uncertainty(session: Session, read: ReadFile, solution: TcpSolution) -> TcpSolution:
    """Return the solution with the covariance that camera and plane of light add; unchanged if they were brought.

    Parameters
    ----------
    session : Session
    read : callable
    solution : TcpSolution
    """
    captures = solution.each.ids
    errors = _errors(session, read, solution.held, captures, solution.in_view.seen_mm)
    return with_optics(solution, errors) if errors else solution


def chain_with_calibration_uncertainty(session: Session, read: ReadFile, solution: ChainSolution) -> ChainSolution:
    """Return the same of the whole chain."""
    captures = [*solution.tcp.each.ids, *solution.turntable.captures]
    errors = _errors(session, read, solution.tcp.held, captures, solution.tcp.in_view.seen_mm)
    return chain_with_optics(solution, errors) if errors else solution


def _errors(
    session: Session, read: ReadFile, held: Held, captures: Sequence[str], seen_in_laser_mm: FloatArray
) -> list[OpticsError]:
    frames = {capture.id for capture in session.captures if of_frames(capture)}
    by_frames = np.array([capture in frames for capture in captures])
    if session.cell.known.laser_plane is not None or not by_frames.any():
        return []
    plane = plane_of(session, read)
    calibration = calibration_of(session, read)
    moved = moved_calibrations(calibration, plane.joint_parameters, np.array(plane.joint_covariance))
    return optics_errors(held, by_frames, calibration, moved, seen_in_laser_mm)


def optics_errors(
    held: Held,
    by_frames: np.ndarray,
    calibration: ProfileCalibration,
    moved: Sequence[MovedCalibration],
    seen_in_laser_mm: FloatArray,
) -> list[OpticsError]:
    """Return what each of some moved calibrations does to an answer.

    Parameters
    ----------
    held : Held
    by_frames : (K,) bool
        Which of its captures are frames.
    calibration : ProfileCalibration
        By which they were solved.
    moved : sequence of MovedCalibration
    seen_in_laser_mm : (3,)
        Where the scanner sees the workpiece.
    """
    points = held.data.points
    some = np.repeat(by_frames, np.diff(held.data.offsets))
    pixels = _pixels(calibration, points[some])
    about = _pixels(calibration, seen_in_laser_mm + np.array([[0, 0, 0], [_STEP_MM, 0, 0], [0, 0, _STEP_MM]]))
    at, beside_x, beside_z = calibration.points(about)
    found: list[OpticsError] = []
    for one in moved:
        there = points.copy()
        there[some] = one.calibration.points(pixels)
        middle, x, z = one.calibration.points(about) - [at, beside_x, beside_z]
        by_place = np.column_stack([(x - middle) / _STEP_MM, np.zeros(3), (z - middle) / _STEP_MM])
        found.append(OpticsError(one.source, shift_by(held, there), at, middle, by_place))
    return found


def _pixels(calibration: ProfileCalibration, points_in_laser_mm: FloatArray) -> FloatArray:
    return calibration.camera.project(calibration.camera_from_laser.apply(points_in_laser_mm))


def moved_calibrations(
    calibration: ProfileCalibration, names: Sequence[str], covariance: FloatArray
) -> list[MovedCalibration]:
    """Return the calibration moved by one standard deviation along independent directions of its covariance.

    Parameters
    ----------
    calibration : ProfileCalibration
    names : sequence of str
        The camera's parameters, none where it was brought.
    covariance : (n + 3, n + 3)
        Of these and of the plane's normal / distance.
    """
    count = len(names)
    steps: list[tuple[OpticsSource, FloatArray]] = []
    follows = np.zeros((3, count))
    if count:
        follows = covariance[count:, :count] @ covariance_of(covariance[:count, :count])
        some = _principal(covariance[:count, :count])
        steps.extend(("camera", np.concatenate([step, follows @ step])) for step in some)
    left = covariance[count:, count:] - follows @ covariance[:count, count:]
    steps.extend(("plane", np.concatenate([np.zeros(count), step])) for step in _principal(left))
    return [MovedCalibration(source, _moved(calibration, names, step)) for source, step in steps]


def _principal(covariance: FloatArray) -> list[FloatArray]:
    """Return one standard deviation along each principal direction, those that are known exactly left out."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 1e-300))  # units differ by many powers of ten
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return [np.sqrt(v) * vector * scale for v, vector in zip(values, vectors.T, strict=True) if v > _NEGLIGIBLE]


def _moved(calibration: ProfileCalibration, names: Sequence[str], step: FloatArray) -> ProfileCalibration:
    camera = _moved_camera(calibration.camera, names, step[:-3])
    plane = calibration.normal / calibration.distance_mm + step[-3:]
    length = float(np.linalg.norm(plane))
    return ProfileCalibration.of(camera, plane / length, 1.0 / length)


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


def with_optics(solution: TcpSolution, errors: Sequence[OpticsError]) -> TcpSolution:
    """Return a tool whose covariances have errors of camera and plane of light."""
    view, (held, more) = solution.in_view, (_wider(solution.held, errors), at_point_by(solution.held, errors))
    return replace(
        solution,
        covariance=held.covariance[:9, :9],
        held=held,
        in_view=replace(view, at_point=view.at_point + more, at_workpiece=view.at_workpiece + more),
        beside=replace(solution.beside, optics=tuple(errors)),
    )


def chain_with_optics(solution: ChainSolution, errors: Sequence[OpticsError]) -> ChainSolution:
    """Return a whole chain whose covariances have errors of camera and plane of light."""
    tcp, table = with_optics(solution.tcp, errors), solution.turntable
    size = table.state.walk.layout.axis_and_places(table.state.walk.layout.table)
    covariance = tcp.held.covariance
    frame = frame_covariance(table.state.table, covariance[np.ix_(size, size)], table.options.direction)
    by_unknowns = frame.pose_by_unknowns
    return replace(
        solution,
        tcp=tcp,
        turntable=replace(table, covariance=frame),
        cross_covariance=covariance[:6, size] @ by_unknowns.T,
        scanner_with_table=by_unknowns @ covariance[np.ix_(size, tcp.held.tool_and_scanner[6:])],
    )


def _wider(held: Held, errors: Sequence[OpticsError]) -> Held:
    return replace(held, covariance=held.covariance + spread_of(errors, len(held.covariance)))
