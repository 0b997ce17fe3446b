"""The robot as a length standard: what its poses say of a camera and of the pitch, beside what the boards say.

Frames of a board look the same at any pitch, and focal length and distance imitate each other where boards tilt
little.  A robot that carries the camera past a fixed board tells both; where the two disagree, one of them errs as
its model does not know, and the camera's covariance has to hold that.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.errors import MotionError
from calib_core.estimation import chance_of
from calib_core.frames import FloatArray, RigidTransform, stack_matrices
from calib_core.optics.adjust import Adjustment, Corners, State, shared_vector
from calib_core.optics.board import BoardView
from calib_core.optics.camera_layout import Layout, parameter_places
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import CameraSolution, Fit, RobotLengths
from calib_core.optics.hand_eye import HandEye, solve_hand_eye
from calib_core.optics.hand_eye_frames import CameraDoubt
from calib_core.optics.laser_plane_solve import board_poses

_LEAST_VIEWS = 6
_NO_STANDARD_MM, _NO_STANDARD_RAD = 5.0, 0.02  # a robot that errs by more measures nothing
_TOLD = 0.01  # of what the boards leave open: where the robot tells less, it says nothing


@dataclass(frozen=True, eq=False)
class RobotPoses:
    """The robot's poses of a board's views.

    Attributes
    ----------
    poses : sequence of RigidTransform or None
        base_from_tool0, or its inverse where the flange holds the board, one a view.
    position_sigma_mm, orientation_sigma_rad : float or None
        As told.
    one_way_up : bool
        Whether the board looks different turned, so that no view can be read turned by accident.
    pitch_sigma : float or None
        Of the told pitch, relative.
    board_on_flange : bool
    """

    poses: Sequence[RigidTransform | None]
    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    one_way_up: bool = True
    pitch_sigma: float | None = None
    board_on_flange: bool = False


def with_robot(solution: CameraSolution, fit: Fit, layout: Layout, robot: RobotPoses) -> CameraSolution:
    """Return a camera with what the robot's poses say of it, and their disagreement in its covariance."""
    told = lengths_by_robot(solution, fit, layout, robot)
    if told is None:
        return solution
    return replace(solution, robot=told, covariance=solution.covariance + told.disagreement)


def lengths_by_robot(solution: CameraSolution, fit: Fit, layout: Layout, robot: RobotPoses) -> RobotLengths | None:
    """Return what the robot's poses say of a camera; None where they determine nothing.

    Parameters
    ----------
    solution, fit, layout
        The camera by the boards alone, and the adjustment that it comes from.
    robot : RobotPoses
    """
    posed = [(k, robot.poses[view]) for k, view in enumerate(fit.used)]
    chosen = [(k, pose) for k, pose in posed if pose is not None]
    if len(chosen) < _LEAST_VIEWS:
        return None
    places = [k for k, _ in chosen]
    at = layout.adjustment(fit.corners).equations(fit.adjusted.state)
    scale = (fit.sigma_px * float(fit.corners.weights.max())) ** 2 * solution.inflation
    own = np.asarray(np.linalg.inv(at.h_pp[places]), dtype=float) * scale
    doubt = CameraDoubt(solution.covariance, at.poses_by_shared[places], own)
    boards = fit.adjusted.state.poses()
    told = robot.position_sigma_mm, robot.orientation_sigma_rad, doubt, robot.pitch_sigma
    try:
        seen = [boards[k] for k in places]
        found = solve_hand_eye([pose for _, pose in chosen], seen, *told, board_on_flange=robot.board_on_flange)
    except MotionError:  # turns about one axis: no hand-eye, no lengths
        return None
    if _is_no_standard(found) or not (found.frames_agree or robot.one_way_up):
        return None
    return _beside(solution.covariance, found, len(places) - len(found.rejected))


def camera_doubt(
    camera: CameraModel,
    parameters: Sequence[str],
    covariance: FloatArray,
    inflation: float,
    views: Sequence[BoardView],
) -> CameraDoubt:
    """Return what a solved camera leaves open in the poses of boards.

    Parameters
    ----------
    camera : CameraModel
    parameters, covariance : sequence of C names, (C, C)
        As the camera's result has them; those of the board's shape are left out.
    inflation : float
        Of variances, for errors that a view's corners share.
    views : sequence of BoardView
    """
    poses, sigmas_px = board_poses(camera, views)
    corners = Corners.of([v.points_px for v in views], [v.points_in_board_mm for v in views])
    corners = corners.weighted(1.0 / sigmas_px[corners.view_of_each])
    bands, near, far = camera.bands
    matrices = stack_matrices(poses)
    state = State(shared_vector(camera.camera_matrix, bands), matrices[:, :3, :3], matrices[:, :3, 3])
    own = [k for k, name in enumerate(parameters) if not name.startswith("board")]
    at = Adjustment(corners, near, far, parameter_places(parameters)).equations(state)
    noise = np.asarray(np.linalg.inv(at.h_pp), dtype=float) * inflation
    return CameraDoubt(covariance[np.ix_(own, own)], at.poses_by_shared, noise)


def _is_no_standard(found: HandEye) -> bool:
    return found.position_sigma_mm > _NO_STANDARD_MM or found.orientation_sigma_rad > _NO_STANDARD_RAD


def _beside(covariance: FloatArray, found: HandEye, views: int) -> RobotLengths:
    """Compare the camera by boards and robot with the one by the boards, whose covariance (C, C) is given.

    Of two estimates of which the second knows all that the first does, the difference's covariance is that of the
    first less that of the second.
    """
    size = len(covariance)
    both = found.covariance[-size:, -size:]
    root = np.linalg.cholesky(covariance)
    inverse = np.linalg.inv(root)
    shares, directions = np.linalg.eigh(inverse @ (covariance - both) @ inverse.T)
    along = directions.T @ inverse @ found.camera_change
    told = shares > _TOLD
    squared, freedom = float(np.sum(along[told] ** 2 / shares[told])), int(told.sum())
    excess = max(0.0, 1.0 - freedom / squared) if squared > 0 else 0.0
    return RobotLengths(
        views=views,
        pitch_factor=found.pitch_factor,
        pitch_sigma=found.pitch_sigma,
        change=found.camera_change,
        sigmas=np.sqrt(np.diag(both)),
        chance=chance_of(squared, freedom) if freedom else 1.0,
        disagreement=excess * np.outer(found.camera_change, found.camera_change),
        position_sigma_mm=found.position_sigma_mm,
        orientation_sigma_rad=found.orientation_sigma_rad,
    )
