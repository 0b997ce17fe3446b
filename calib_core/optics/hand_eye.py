"""The camera on the flange and a board that stands still in the base, from frames at several robot poses.

base_from_tool0(k) · tool0_from_camera · camera_from_board(k) = base_from_board for every frame k.  Two turns
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
from calib_core.frames import FloatArray, RigidTransform, skew, stack_matrices, vector_from_rotation
from calib_core.optics.hand_eye_closed import solve_ax_zb

USUAL_POSITION_SIGMA_MM = 0.05
USUAL_ORIENTATION_SIGMA_RAD = 2e-4
USUAL_PITCH_SIGMA = 0.01  # relative: of a board's pitch that somebody printed and told
_LEAST_PITCH_SIGMA = 1e-6
_TRUSTED = np.log(1.5)  # by what factor told errors of a robot may be too small, one sigma
_UNKNOWN = np.log(3.0)
_MUCH_LARGER = np.log(10.0)
_LEAST_FRAMES = 4
_LEAST_TURN_RAD = np.deg2rad(3.0)
_LEAST_SECOND_AXIS = 0.1  # of the turns' vectors: their spread across the main axis over that along it
_REJECT_RATIO = 8.0  # what one frame adds to the squares, over what each of the others does
_READ_TURNED_RAD = 0.015  # no arm is so far off
_PAIR = 12  # unknowns of both transforms; the pitch is the next, the camera's come last


@dataclass(frozen=True, eq=False)
class PredictedPose:
    """camera_from_board as the robot's pose tells it.

    Attributes
    ----------
    camera_from_board : RigidTransform
        In lengths of the told pitch.
    covariance : (6, 6)
        By this robot pose's own error, order rx ry rz tx ty tz, rad and mm.
    common : (6, D)
        What one standard deviation of each principal direction of the hand-eye's error does to it: the same errors
        for all predictions.
    """

    camera_from_board: RigidTransform
    covariance: FloatArray
    common: FloatArray


@dataclass(frozen=True, eq=False)
class CameraDoubt:
    """What a camera leaves open in the poses of K boards.

    Attributes
    ----------
    covariance : (C, C)
        Of its parameters.
    follows : (K, 6, C)
        How camera_from_board moves with them.
    own : (K, 6, 6)
        Covariance of camera_from_board by the noise of its own corners.
    """

    covariance: FloatArray
    follows: FloatArray
    own: FloatArray

    def take(self, frames: Sequence[int]) -> "CameraDoubt":
        """Return that of some boards only."""
        return CameraDoubt(self.covariance, self.follows[list(frames)], self.own[list(frames)])


@dataclass(frozen=True, eq=False)
class HandEye:
    """Where the camera sits on the flange, and the board in the base.

    Attributes
    ----------
    tool0_from_camera, base_from_board : RigidTransform
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
    """

    tool0_from_camera: RigidTransform
    base_from_board: RigidTransform
    pitch_factor: float
    camera_change: FloatArray
    covariance: FloatArray
    position_sigma_mm: float
    orientation_sigma_rad: float
    rejected: tuple[int, ...] = ()

    @property
    def frames_agree(self) -> bool:
        """Whether no frame contradicts the others, as one of a board that was read turned would."""
        return not self.rejected and self.orientation_sigma_rad < _READ_TURNED_RAD

    @property
    def pitch_sigma(self) -> float:
        """Standard deviation of the pitch factor."""
        return float(np.sqrt(self.covariance[_PAIR, _PAIR]))

    def predict(self, base_from_tool0: RigidTransform) -> PredictedPose:
        """Return where the board stands before the camera at a robot pose."""
        state = _State(
            self.tool0_from_camera,
            self.base_from_board,
            self.pitch_factor - 1.0,
            np.zeros(len(self.camera_change)),
        )
        frames = _Frames.of([base_from_tool0], None, None)
        rotations, translations = frames.expected(state)
        told = np.repeat([1.0, 1.0 / self.pitch_factor], 3)
        slopes = np.zeros((6, _PAIR + 1))
        slopes[:, :_PAIR] = frames.by_pair(state)[0]
        slopes[3:, _PAIR] = -translations[0] / self.pitch_factor
        values, vectors = np.linalg.eigh(self.covariance[: _PAIR + 1, : _PAIR + 1])
        common = told[:, None] * slopes @ (vectors * np.sqrt(np.clip(values, 0.0, None)))
        by_position, by_turn = frames.by_robot(state)
        robot = self.position_sigma_mm**2 * by_position[0] + self.orientation_sigma_rad**2 * by_turn[0]
        pose = RigidTransform.of(rotations[0], translations[0] / self.pitch_factor, "camera", "board")
        return PredictedPose(pose, told[:, None] * robot * told, common)


def solve_hand_eye(
    base_from_tool0: Sequence[RigidTransform],
    camera_from_board: Sequence[RigidTransform],
    position_sigma_mm: float | None = None,
    orientation_sigma_rad: float | None = None,
    doubt: CameraDoubt | None = None,
    pitch_sigma: float | None = None,
) -> HandEye:
    """Return the camera on the flange, the board in the base and its pitch, from K frames of the board.

    Parameters
    ----------
    base_from_tool0, camera_from_board : sequences of K
        The boards in lengths of the told pitch.
    position_sigma_mm, orientation_sigma_rad : float, optional
        The robot's errors, per axis; left out, those of an ordinary robot.  Both follow what the frames show.
    doubt : CameraDoubt, optional
        What the camera leaves open; without it the boards' poses err by the robot alone.
    pitch_sigma : float, optional
        Of the told pitch, relative; left out, that of a board from a printer.

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
    usual = np.array([position, turning])
    used = list(range(len(base_from_tool0)))

    def fitted(chosen: list[int]) -> "_Fit":
        robots, boards = [base_from_tool0[k] for k in chosen], [camera_from_board[k] for k in chosen]
        frames = _Frames.of(robots, boards, None if doubt is None else doubt.take(chosen), pitch_sigma)
        return frames.fit(_start(robots, boards, frames.camera_size), usual)

    found = fitted(used)
    while len(used) > _LEAST_FRAMES + 1:
        without = [k for k in used if k != used[int(np.argmax(found.squares))]]
        again = fitted(without)
        typical = again.squares.sum() / (6 * len(without) - _PAIR - 1)
        if (found.squares.sum() - again.squares.sum()) / 6 < _REJECT_RATIO * max(typical, 1.0):
            break
        used, found = without, again
    told = np.array([position_sigma_mm is not None, orientation_sigma_rad is not None])
    sigmas, found = _with_sigmas(found, usual, told)
    rejected = tuple(sorted(set(range(len(base_from_tool0))) - set(used)))
    state = found.state
    return HandEye(
        state.tool0_from_camera, state.base_from_board, 1.0 + state.pitch, state.camera,
        np.asarray(np.linalg.inv(found.hessian), dtype=float), float(sigmas[0]), float(sigmas[1]), rejected,
    )  # fmt: skip


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


@dataclass(frozen=True, eq=False)
class _State:
    """Where the adjustment stands: both transforms, the pitch factor less one, the camera's change (C,)."""

    tool0_from_camera: RigidTransform
    base_from_board: RigidTransform
    pitch: float
    camera: FloatArray

    def moved(self, step: FloatArray) -> "_State":
        return _State(
            self.tool0_from_camera.perturbed(step[:6]),
            self.base_from_board.perturbed(step[6:_PAIR]),
            self.pitch + float(step[_PAIR]),
            self.camera + step[_PAIR + 1 :],
        )


@dataclass(frozen=True, eq=False)
class _Fit:
    """An adjustment for given errors of the robot, and each frame's squared normalised residual (K,)."""

    frames: "_Frames"
    state: _State
    hessian: FloatArray
    squares: FloatArray


@dataclass(frozen=True, eq=False)
class _Frames:
    """The frames as arrays, and what the camera leaves open in them."""

    robot_rotations: FloatArray
    robot_translations: FloatArray
    board_rotations: FloatArray
    board_translations: FloatArray
    own: FloatArray
    follows: FloatArray
    camera_information: FloatArray
    pitch_information: float

    @classmethod
    def of(
        cls,
        robots: Sequence[RigidTransform],
        boards: Sequence[RigidTransform] | None,
        doubt: CameraDoubt | None,
        pitch_sigma: float | None = None,
    ) -> "_Frames":
        count = len(robots)
        nothing = CameraDoubt(np.zeros((0, 0)), np.zeros((count, 6, 0)), np.zeros((count, 6, 6)))
        doubt = nothing if doubt is None else doubt
        a = stack_matrices(robots)
        b = np.tile(np.eye(4), (count, 1, 1)) if boards is None else stack_matrices(boards)
        information = (
            np.linalg.pinv(doubt.covariance, hermitian=True) if doubt.covariance.size else doubt.covariance
        )
        relative = USUAL_PITCH_SIGMA if pitch_sigma is None else pitch_sigma
        return cls(
            a[:, :3, :3], a[:, :3, 3], b[:, :3, :3], b[:, :3, 3], doubt.own, doubt.follows,
            np.asarray(information, dtype=float), max(relative, _LEAST_PITCH_SIGMA) ** -2,
        )  # fmt: skip

    @property
    def camera_size(self) -> int:
        return len(self.camera_information)

    def expected(self, state: _State) -> tuple[FloatArray, FloatArray]:
        """Return rotations (K, 3, 3) and translations (K, 3), true mm, of camera_from_board at exact poses."""
        camera_from_base = np.swapaxes(self.robot_rotations @ state.tool0_from_camera.rotation, 1, 2)
        places = self.robot_rotations @ state.tool0_from_camera.translation_mm + self.robot_translations
        off = state.base_from_board.translation_mm - places
        return camera_from_base @ state.base_from_board.rotation, np.einsum("kij,kj->ki", camera_from_base, off)

    def by_pair(self, state: _State) -> FloatArray:
        """Return the derivative (K, 6, 12) of the expected pose by both transforms."""
        rotations, translations = self.expected(state)
        camera_from_tool0 = state.tool0_from_camera.rotation.T
        slopes = np.zeros((len(rotations), 6, _PAIR))
        slopes[:, :3, :3], slopes[:, :3, 6:9] = -np.swapaxes(rotations, 1, 2), np.eye(3)
        slopes[:, 3:, :3], slopes[:, 3:, 3:6] = skew(translations), -camera_from_tool0
        slopes[:, 3:, 9:] = camera_from_tool0 @ np.swapaxes(self.robot_rotations, 1, 2)
        return slopes

    def by_robot(self, state: _State) -> tuple[FloatArray, FloatArray]:
        """Return the covariances (K, 6, 6) of the expected pose by an error of the robot of 1 mm, and of 1 rad."""
        camera_from_tool0 = state.tool0_from_camera.rotation.T
        tool0_from_base = np.swapaxes(self.robot_rotations, 1, 2)
        off = state.base_from_board.translation_mm - self.robot_translations
        turn = np.zeros((len(off), 6, 3))
        turn[:, :3] = -np.swapaxes(tool0_from_base @ state.base_from_board.rotation, 1, 2)
        turn[:, 3:] = camera_from_tool0 @ skew(np.einsum("kij,kj->ki", tool0_from_base, off))
        position = np.zeros((len(off), 6, 6))
        position[:, 3:, 3:] = np.eye(3)
        return position, turn @ np.swapaxes(turn, 1, 2)

    def residuals(self, state: _State) -> tuple[FloatArray, FloatArray]:
        """Return seen minus expected, (K, 6), and its derivative (K, 6, 13 + C) by all unknowns."""
        rotations, translations = self.expected(state)
        moved = self.follows @ state.camera
        bent = np.swapaxes(rotations, 1, 2) @ self.board_rotations
        seen = self.board_translations + moved[:, 3:]
        residuals = np.empty((len(seen), 6))
        residuals[:, :3] = vector_from_rotation(bent) + moved[:, :3]
        residuals[:, 3:] = seen * (1 + state.pitch) - translations
        slopes = np.zeros((len(seen), 6, _PAIR + 1 + self.camera_size))
        slopes[:, :, :_PAIR] = -self.by_pair(state)
        slopes[:, 3:, _PAIR] = seen
        slopes[:, :, _PAIR + 1 :] = self.follows
        slopes[:, 3:, _PAIR + 1 :] *= 1 + state.pitch
        return residuals, slopes

    def known(self, state: _State) -> tuple[FloatArray, FloatArray]:
        """Return Hessian and gradient of what is known of pitch and camera beforehand."""
        size = _PAIR + 1 + self.camera_size
        hessian, gradient = np.zeros((size, size)), np.zeros(size)
        hessian[_PAIR, _PAIR] = self.pitch_information
        hessian[_PAIR + 1 :, _PAIR + 1 :] = self.camera_information
        gradient[_PAIR] = state.pitch * self.pitch_information
        gradient[_PAIR + 1 :] = self.camera_information @ state.camera
        return hessian, gradient

    def fit(self, start: _State, sigmas: FloatArray) -> _Fit:
        """Return the most likely unknowns for given errors of the robot, position (mm) and turn (rad)."""
        state, squares = start, np.zeros(len(self.own))
        hessian, _ = self.known(state)
        for _ in range(20):
            residuals, slopes = self.residuals(state)
            position, turn = self.by_robot(state)
            weights = np.linalg.inv(sigmas[0] ** 2 * position + sigmas[1] ** 2 * turn + self.own)
            pulled = np.einsum("kij,kj->ki", weights, residuals)
            squares = np.einsum("ki,ki->k", residuals, pulled)
            hessian, gradient = self.known(state)
            hessian = hessian + np.einsum("kia,kib->ab", slopes, weights @ slopes)
            gradient = gradient + np.einsum("kia,ki->a", slopes, pulled)
            step = -np.asarray(np.linalg.solve(hessian, gradient), dtype=float)
            state = state.moved(step)
            if float(step @ hessian @ step) < 1e-10:
                break
        return _Fit(self, state, hessian, squares)


def _start(robots: Sequence[RigidTransform], boards: Sequence[RigidTransform], camera_size: int) -> _State:
    require_two_axes(robots)
    tool0_from_camera, base_from_board = solve_ax_zb(
        stack_matrices(robots), stack_matrices([board.inverse() for board in boards])
    )
    return _State(
        RigidTransform(tool0_from_camera, "tool0", "camera"),
        RigidTransform(base_from_board, "base", "board"),
        0.0,
        np.zeros(camera_size),
    )


def _with_sigmas(found: _Fit, usual: FloatArray, told: np.ndarray) -> tuple[FloatArray, _Fit]:
    """Return the robot's errors by restricted likelihood, with a prior by what is usual or told, and the fit.

    A robot that turns wrongly looks much like one that goes wrong, and each makes the fit that asks for it: both
    are tried, and the likelier one stays.
    """
    center = np.log(usual)
    widths = np.where(told, _TRUSTED, _UNKNOWN)
    low = np.where(told, center, np.log([2e-3, 2e-6]))
    high = np.maximum(np.log([50.0, 2e-2]), low + 1e-6)
    ends: list[tuple[float, FloatArray, _Fit]] = []
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


def _density(found: _Fit, center: FloatArray, widths: FloatArray) -> Callable[[FloatArray], float]:
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
