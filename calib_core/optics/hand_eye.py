"""The camera on the flange and a board that stands still in the base, from frames at several robot poses.

base_from_tool0(k) · tool0_from_camera · camera_from_board(k) = base_from_board for every frame k.  Two turns
about axes that are not parallel fix it: first in closed form, then all together, each frame weighed by the
robot's errors of position and orientation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.errors import MotionError
from calib_core.frames import FloatArray, RigidTransform, skew, stack_matrices
from calib_core.optics.hand_eye_closed import solve_ax_zb

USUAL_POSITION_SIGMA_MM = 0.05
USUAL_ORIENTATION_SIGMA_RAD = 2e-4
_LEAST_FRAMES = 4
_LEAST_TURN_RAD = np.deg2rad(3.0)
_LEAST_SECOND_AXIS = 0.1  # of the turns' vectors: their spread across the main axis over that along it
_REJECT_RATIO = 8.0  # what one frame adds to the squares, over what each of the others does


@dataclass(frozen=True, eq=False)
class PredictedPose:
    """camera_from_board as the robot's pose tells it.

    Attributes
    ----------
    camera_from_board : RigidTransform
    covariance : (6, 6)
        By this robot pose's own error, order rx ry rz tx ty tz, rad and mm.
    common : (6, 12)
        What one standard deviation of each principal direction of the hand-eye's error does to it: the same errors
        for all predictions.
    """

    camera_from_board: RigidTransform
    covariance: FloatArray
    common: FloatArray


@dataclass(frozen=True, eq=False)
class HandEye:
    """Where the camera sits on the flange, and the board in the base.

    Attributes
    ----------
    tool0_from_camera, base_from_board : RigidTransform
    covariance : (12, 12)
        Of both, in this order, each rx ry rz tx ty tz.
    position_sigma_mm, orientation_sigma_rad : float
        The robot's errors, as given, or grown to what the frames show.
    rejected : tuple of int
        Frames that contradict all others.
    """

    tool0_from_camera: RigidTransform
    base_from_board: RigidTransform
    covariance: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float
    rejected: tuple[int, ...] = ()

    def predict(self, base_from_tool0: RigidTransform) -> PredictedPose:
        """Return where the board stands before the camera at a robot pose."""
        pair = (self.tool0_from_camera, self.base_from_board)
        values, vectors = np.linalg.eigh(self.covariance)
        directions = vectors * np.sqrt(np.clip(values, 0.0, None))
        robot = _robot_covariance(base_from_tool0, pair, self.position_sigma_mm, self.orientation_sigma_rad)
        common = _by_unknowns(base_from_tool0, pair) @ directions
        return PredictedPose(_expected(base_from_tool0, pair), robot, common)


_Pair = tuple[RigidTransform, RigidTransform]


def solve_hand_eye(
    base_from_tool0: Sequence[RigidTransform],
    camera_from_board: Sequence[RigidTransform],
    position_sigma_mm: float | None = None,
    orientation_sigma_rad: float | None = None,
) -> HandEye:
    """Return the camera on the flange and the board in the base, from K frames of the board.

    Parameters
    ----------
    base_from_tool0, camera_from_board : sequences of K
    position_sigma_mm, orientation_sigma_rad : float, optional
        The robot's errors, per axis; left out, those of an ordinary robot.  Both grow where the frames show more.

    Raises
    ------
    MotionError
        If there are too few frames, or all turns are about one axis.
    """
    if len(base_from_tool0) < _LEAST_FRAMES:
        raise MotionError(
            f"frames of the lit, fixed board from at least {_LEAST_FRAMES} robot poses",
            f"{len(base_from_tool0)}",
            "Take the lit board from more robot poses, turned differently.",
        )
    position = USUAL_POSITION_SIGMA_MM if position_sigma_mm is None else max(position_sigma_mm, 1e-4)
    turning = USUAL_ORIENTATION_SIGMA_RAD if orientation_sigma_rad is None else max(orientation_sigma_rad, 1e-6)
    used = list(range(len(base_from_tool0)))

    def fitted(frames: list[int]) -> tuple[_Pair, FloatArray, FloatArray]:
        robots, boards = [base_from_tool0[k] for k in frames], [camera_from_board[k] for k in frames]
        return _fit(robots, boards, _start(robots, boards), position, turning)

    pair, covariance, squares = fitted(used)
    while len(used) > _LEAST_FRAMES + 1:
        without = [k for k in used if k != used[int(np.argmax(squares))]]
        again = fitted(without)
        usual = again[2].sum() / (6 * len(without) - 12)
        if (squares.sum() - again[2].sum()) / 6 < _REJECT_RATIO * max(usual, 1.0):
            break
        used, (pair, covariance, squares) = without, again
    growth = max(1.0, float(np.sqrt(squares.sum() / (6 * len(used) - 12))))
    rejected = tuple(sorted(set(range(len(base_from_tool0))) - set(used)))
    return HandEye(*pair, covariance * growth**2, position * growth, turning * growth, rejected)


def _start(robots: Sequence[RigidTransform], boards: Sequence[RigidTransform]) -> _Pair:
    require_two_axes(robots)
    tool0_from_camera, base_from_board = solve_ax_zb(
        stack_matrices(robots), stack_matrices([board.inverse() for board in boards])
    )
    return RigidTransform(tool0_from_camera, "tool0", "camera"), RigidTransform(base_from_board, "base", "board")


def require_two_axes(robots: Sequence[RigidTransform]) -> None:
    """Raise MotionError where poses of the flange turn about one axis, or hardly at all."""
    turns_rad = np.array([(robots[0].inverse() @ robot).rotation_vector_rad for robot in robots[1:]])
    spread = np.linalg.svd(turns_rad, compute_uv=False) / np.sqrt(len(turns_rad))
    if spread[0] < _LEAST_TURN_RAD or spread[1] < _LEAST_SECOND_AXIS * spread[0]:
        raise MotionError(
            "frames of the lit, fixed board at robot poses turned about axes that are not parallel",
            "turns about one axis, or none",
            "Take the lit board with the flange turned by 20° about different axes.",
        )


def _fit(
    robots: Sequence[RigidTransform],
    boards: Sequence[RigidTransform],
    start: _Pair,
    position_sigma_mm: float,
    orientation_sigma_rad: float,
) -> tuple[_Pair, FloatArray, FloatArray]:
    """Return both transforms, their covariance (12, 12), and each frame's squared normalised residual (K,)."""
    pair = start
    hessian, squares = np.eye(12), np.zeros(len(robots))
    for _ in range(20):
        hessian, gradient = np.zeros((12, 12)), np.zeros(12)
        for k, (robot, board) in enumerate(zip(robots, boards, strict=True)):
            weight = np.asarray(
                np.linalg.inv(_robot_covariance(robot, pair, position_sigma_mm, orientation_sigma_rad)),
                dtype=float,
            )
            residual = _expected(robot, pair).difference(board)
            slope = -_by_unknowns(robot, pair)
            hessian += slope.T @ weight @ slope
            gradient += slope.T @ weight @ residual
            squares[k] = float(residual @ weight @ residual)
        step = -np.asarray(np.linalg.solve(hessian, gradient), dtype=float)
        pair = _moved(pair, step)
        if float(step @ hessian @ step) < 1e-10:
            break
    return pair, np.asarray(np.linalg.inv(hessian), dtype=float), squares


def _expected(robot: RigidTransform, pair: _Pair) -> RigidTransform:
    """Return camera_from_board where the robot is at a pose without error."""
    return (robot @ pair[0]).inverse() @ pair[1]


def _moved(pair: _Pair, step: FloatArray) -> _Pair:
    return pair[0].perturbed(step[:6]), pair[1].perturbed(step[6:])


def _by_unknowns(robot: RigidTransform, pair: _Pair) -> FloatArray:
    """Return the derivative (6, 12) of camera_from_board by both transforms."""
    expected, camera_from_tool0 = _expected(robot, pair), pair[0].rotation.T
    slopes = np.zeros((6, 12))
    slopes[:3, :3], slopes[:3, 6:9] = -expected.rotation.T, np.eye(3)
    slopes[3:, :3], slopes[3:, 3:6] = skew(expected.translation_mm), -camera_from_tool0
    slopes[3:, 9:] = camera_from_tool0 @ robot.rotation.T
    return slopes


def _robot_covariance(robot: RigidTransform, pair: _Pair, position_mm: float, turning_rad: float) -> FloatArray:
    """Return the covariance (6, 6) of camera_from_board by the robot's own error at one pose."""
    camera_from_tool0 = pair[0].rotation.T
    board_in_tool0 = robot.inverse().apply(pair[1].translation_mm)
    by_pose = np.zeros((6, 6))
    by_pose[:3, :3] = -(robot.rotation.T @ pair[1].rotation).T
    by_pose[3:, :3] = camera_from_tool0 @ skew(board_in_tool0)
    by_pose[3:, 3:] = -camera_from_tool0 @ robot.rotation.T
    by_pose *= np.repeat([turning_rad, position_mm], 3)
    return by_pose @ by_pose.T
