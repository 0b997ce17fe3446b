"""A camera and a board, one of them on the flange and one in the base, from frames at several robot poses.

robot(k) · mount_from_camera · camera_from_board(k) = holder_from_board for every frame k; robot is base_from_tool0
where the camera is on the flange, and tool0_from_base where it stands still before a board there.  Two turns
about axes that are not parallel fix it: first in closed form, then all together, each frame weighed by the
robot's errors of position and orientation, and by what the camera leaves open where that is told.

The frames of a board look the same at any pitch, and all lengths follow from it; the robot moves in true ones.  So
the pitch is an unknown too, with a prior about what is told: a robot that moves far enough measures it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.errors import MotionError
from calib_core.estimation import maximum
from calib_core.frames import FloatArray, RigidTransform, stack_matrices
from calib_core.optics.hand_eye_closed import solve_ax_zb
from calib_core.optics.hand_eye_frames import PAIR, CameraDoubt, Fit, Frames, State

USUAL_POSITION_SIGMA_MM = 0.05
USUAL_ORIENTATION_SIGMA_RAD = 2e-4
_TRUSTED = np.log(1.5)  # by what factor told errors of a robot may be too small, one sigma
_UNKNOWN = np.log(3.0)
_MUCH_LARGER = np.log(10.0)
_LEAST_FRAMES = 4
_LEAST_TURN_RAD = np.deg2rad(3.0)
_LEAST_SECOND_AXIS = 0.1  # of the turns' vectors: their spread across the main axis over that along it
_REJECT_RATIO = 8.0  # what one frame adds to the squares, over what each of the others does
_READ_TURNED_RAD = 0.015  # no arm is so far off


@dataclass(frozen=True, eq=False)
class PredictedPose:
    """camera_from_board as the robot's pose tells it.

    Attributes
    ----------
    camera_from_board : RigidTransform
        In lengths of the told pitch.
    covariance : (6, 6)
        By this robot pose's own error, order rx ry rz tx ty tz, rad and mm.
    """

    camera_from_board: RigidTransform
    covariance: FloatArray


@dataclass(frozen=True, eq=False)
class HandEye:
    """Where camera and board are on what carries them, flange and base or base and flange.

    Attributes
    ----------
    mount_from_camera, holder_from_board : RigidTransform
    pitch_factor : float
        The board's pitch by the robot's lengths, over the told one.
    camera_change : (C,)
        What the robot's poses change in the camera's parameters.
    covariance : (13 + C, 13 + C)
        Of both transforms, in this order, each rx ry rz tx ty tz, of the pitch factor, and of the camera.
    position_sigma_mm, orientation_sigma_rad : float
        The robot's errors per axis, as the frames show them; never below those that were told.
    rejected : tuple of int
        Frames that contradict all others.
    board_on_flange : bool
        Before a camera that stands still.
    """

    mount_from_camera: RigidTransform
    holder_from_board: RigidTransform
    pitch_factor: float
    camera_change: FloatArray
    covariance: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float
    rejected: tuple[int, ...] = ()
    board_on_flange: bool = False

    @property
    def frames_agree(self) -> bool:
        """Whether no frame contradicts the others, as one of a board that was read turned would."""
        return not self.rejected and self.orientation_sigma_rad < _READ_TURNED_RAD

    @property
    def pitch_sigma(self) -> float:
        """Standard deviation of the pitch factor."""
        return float(np.sqrt(self.covariance[PAIR, PAIR]))

    def predict(self, robot_pose: RigidTransform) -> PredictedPose:
        """Return where the board is before the camera at a robot pose, told as those were that it is of."""
        state = State(
            self.mount_from_camera,
            self.holder_from_board,
            self.pitch_factor - 1.0,
            np.zeros(len(self.camera_change)),
        )
        frames = Frames.of([robot_pose], None, None, board_on_flange=self.board_on_flange)
        rotations, translations = frames.expected(state)
        told = np.repeat([1.0, 1.0 / self.pitch_factor], 3)
        by_position, by_turn = frames.by_robot(state)
        robot = self.position_sigma_mm**2 * by_position[0] + self.orientation_sigma_rad**2 * by_turn[0]
        pose = RigidTransform.of(rotations[0], translations[0] / self.pitch_factor, "camera", "board")
        return PredictedPose(pose, told[:, None] * robot * told)


def solve_hand_eye(
    robot_poses: Sequence[RigidTransform],
    camera_from_board: Sequence[RigidTransform],
    position_sigma_mm: float | None = None,
    orientation_sigma_rad: float | None = None,
    doubt: CameraDoubt | None = None,
    pitch_sigma: float | None = None,
    board_on_flange: bool = False,
) -> HandEye:
    """Return camera and board on what carries them and the board's pitch, from K frames of the board.

    Parameters
    ----------
    robot_poses : sequence of K
        base_from_tool0, or tool0_from_base where the flange holds the board.
    camera_from_board : sequence of K
        In lengths of the told pitch.
    position_sigma_mm, orientation_sigma_rad : float, optional
        The robot's errors, per axis; left out, those of an ordinary robot.  Both follow what the frames show.
    doubt : CameraDoubt, optional
        What the camera leaves open; without it the boards' poses err by the robot alone.
    pitch_sigma : float, optional
        Of the told pitch, relative; left out, that of a board from a printer.
    board_on_flange : bool
        Before a camera that stands still.

    Raises
    ------
    MotionError
        If there are too few frames, or all turns are about one axis.
    """
    if len(robot_poses) < _LEAST_FRAMES:
        need = "frames of the lit, fixed board from at least {least_frames} robot poses"
        to_do = "Take the lit board from more robot poses, turned differently."
        raise MotionError(need, f"{len(robot_poses)}", to_do, least_frames=_LEAST_FRAMES)
    position = USUAL_POSITION_SIGMA_MM if position_sigma_mm is None else max(position_sigma_mm, 1e-4)
    turning = USUAL_ORIENTATION_SIGMA_RAD if orientation_sigma_rad is None else max(orientation_sigma_rad, 1e-6)
    usual = np.array([position, turning])
    used = list(range(len(robot_poses)))

    def fitted(chosen: list[int]) -> Fit:
        robots, boards = [robot_poses[k] for k in chosen], [camera_from_board[k] for k in chosen]
        frames = Frames.of(
            robots, boards, None if doubt is None else doubt.take(chosen), pitch_sigma, board_on_flange
        )
        return frames.fit(_start(robots, boards, frames.camera_size), usual)

    found = fitted(used)
    while len(used) > _LEAST_FRAMES + 1:
        without = [k for k in used if k != used[int(np.argmax(found.squares))]]
        again = fitted(without)
        typical = again.squares.sum() / (6 * len(without) - PAIR - 1)
        if (found.squares.sum() - again.squares.sum()) / 6 < _REJECT_RATIO * max(typical, 1.0):
            break
        used, found = without, again
    told = np.array([position_sigma_mm is not None, orientation_sigma_rad is not None])
    sigmas, found = _with_sigmas(found, usual, told)
    rejected = tuple(sorted(set(range(len(robot_poses))) - set(used)))
    state = found.state
    return HandEye(
        state.mount_from_camera, state.holder_from_board, 1.0 + state.pitch, state.camera,
        np.asarray(np.linalg.inv(found.hessian), dtype=float), float(sigmas[0]), float(sigmas[1]),
        rejected, board_on_flange,
    )  # fmt: skip


def require_two_axes(robots: Sequence[RigidTransform]) -> None:
    """Raise MotionError where poses of the flange turn about one axis, or hardly at all."""
    turns_rad = np.array([(robots[0].inverse() @ robot).rotation_vector_rad for robot in robots[1:]])
    spread = np.linalg.svd(turns_rad, compute_uv=False) / np.sqrt(len(turns_rad))
    if spread[0] < _LEAST_TURN_RAD or spread[1] < _LEAST_SECOND_AXIS * spread[0]:
        need = "frames of the lit, fixed board at robot poses turned about axes that are not parallel"
        to_do = "Take the lit board with the flange turned by 20° about different axes."
        raise MotionError(need, "turns about one axis, or none", to_do)


def _start(robots: Sequence[RigidTransform], boards: Sequence[RigidTransform], camera_size: int) -> State:
    require_two_axes(robots)
    mount_from_camera, holder_from_board = solve_ax_zb(
        stack_matrices(robots), stack_matrices([board.inverse() for board in boards])
    )
    return State(
        RigidTransform(mount_from_camera, robots[0].outof, "camera"),
        RigidTransform(holder_from_board, robots[0].into, "board"),
        0.0,
        np.zeros(camera_size),
    )


def _with_sigmas(found: Fit, usual: FloatArray, told: np.ndarray) -> tuple[FloatArray, Fit]:
    """Return the robot's errors by restricted likelihood, with a prior by what is usual or told, and the fit.

    A robot that turns wrongly looks much like one that goes wrong, and each makes the fit that asks for it: both
    are tried, and the likelier one stays.
    """
    center = np.log(usual)
    widths = np.where(told, _TRUSTED, _UNKNOWN)
    low = np.where(told, center, np.log([2e-3, 2e-6]))
    high = np.maximum(np.log([50.0, 2e-2]), low + 1e-6)
    ends: list[tuple[float, FloatArray, Fit]] = []
    for larger in ([0.0, 0.0], [0.0, _MUCH_LARGER], [_MUCH_LARGER, 0.0]):
        logs = np.clip(center + larger, low, high)
        end = found.frames.fit(found.state, np.exp(logs)) if any(larger) else found
        for _ in range(6):
            before = logs
            logs = maximum(_density(end, center, widths), logs, widths, low, high)
            end = end.frames.fit(end.state, np.exp(logs))
            if np.abs(logs - before).max() < 0.05:
                break
        ends.append((_density(end, center, widths)(logs), logs, end))
    _, logs, end = max(ends, key=lambda one: one[0])
    return np.exp(logs), end


def _density(found: Fit, center: FloatArray, widths: FloatArray) -> Callable[[FloatArray], float]:
    """Return the log-density of the errors' logarithms, everything else linearised at a fit and integrated out."""
    frames = found.frames
    residuals, slopes = frames.residuals(found.state)
    position, turn = frames.by_robot(found.state)
    known_hessian, known_gradient = frames.known(found.state)

    def log_density(logs: FloatArray) -> float:
        variances = np.exp(2 * logs)
        covariances = variances[0] * position + variances[1] * turn + frames.own
        weights = np.linalg.inv(covariances)
        pulled = np.einsum("kij,kj->ki", weights, residuals)
        hessian = known_hessian + np.einsum("kia,kib->ab", slopes, weights @ slopes)
        gradient = known_gradient + np.einsum("kia,ki->a", slopes, pulled)
        explained = float(gradient @ np.linalg.solve(hessian, gradient))
        cost = float(np.sum(residuals * pulled)) - explained
        cost += float(np.linalg.slogdet(covariances)[1].sum() + np.linalg.slogdet(hessian)[1])
        off = (logs - center) / widths
        return -0.5 * (cost + float(off @ off))

    return log_density
