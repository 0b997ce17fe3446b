"""The frames of a board that one thing holds as arrays: residuals and normal equations of the hand-eye's unknowns.

The unknowns are both transforms (12), the pitch factor less one, and the change of the camera's parameters (C).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, RigidTransform, skew, stack_matrices, vector_from_rotation

USUAL_PITCH_SIGMA = 0.01  # relative: of a board's pitch that somebody printed and told
_LEAST_PITCH_SIGMA = 1e-6
PAIR = 12  # unknowns of both transforms; the pitch is the next, the camera's come last


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
class State:
    """Where the adjustment stands: both transforms, the pitch factor less one, the camera's change (C,)."""

    mount_from_camera: RigidTransform
    holder_from_board: RigidTransform
    pitch: float
    camera: FloatArray

    def moved(self, step: FloatArray) -> "State":
        """Return the state after a step (13 + C,) of all unknowns, rad, mm, 1 and the camera's units."""
        return State(
            self.mount_from_camera.perturbed(step[:6]),
            self.holder_from_board.perturbed(step[6:PAIR]),
            self.pitch + float(step[PAIR]),
            self.camera + step[PAIR + 1 :],
        )


@dataclass(frozen=True, eq=False)
class Fit:
    """An adjustment for given errors of the robot, and each frame's squared normalised residual (K,)."""

    frames: "Frames"
    state: State
    hessian: FloatArray
    squares: FloatArray


@dataclass(frozen=True, eq=False)
class Frames:
    """The frames as arrays, and what the camera leaves open in them."""

    robot_rotations: FloatArray
    robot_translations: FloatArray
    board_rotations: FloatArray
    board_translations: FloatArray
    own: FloatArray
    follows: FloatArray
    camera_information: FloatArray
    pitch_information: float
    board_on_flange: bool = False

    @classmethod
    def of(
        cls,
        robots: Sequence[RigidTransform],
        boards: Sequence[RigidTransform] | None,
        doubt: CameraDoubt | None,
        pitch_sigma: float | None = None,
        board_on_flange: bool = False,
    ) -> "Frames":
        """Return K frames as arrays; `boards` in lengths of the told pitch, `pitch_sigma` relative.

        Robots are base_from_tool0, or its inverse where the flange holds the board before a standing camera.
        """
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
            board_on_flange,
        )  # fmt: skip

    @property
    def camera_size(self) -> int:
        """How many of the camera's parameters are open."""
        return len(self.camera_information)

    def expected(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return rotations (K, 3, 3) and translations (K, 3), true mm, of camera_from_board at exact poses."""
        camera_from_holder = np.swapaxes(self.robot_rotations @ state.mount_from_camera.rotation, 1, 2)
        places = self.robot_rotations @ state.mount_from_camera.translation_mm + self.robot_translations
        off = state.holder_from_board.translation_mm - places
        return camera_from_holder @ state.holder_from_board.rotation, np.einsum(
            "kij,kj->ki", camera_from_holder, off
        )

    def by_pair(self, state: State) -> FloatArray:
        """Return the derivative (K, 6, 12) of the expected pose by both transforms."""
        rotations, translations = self.expected(state)
        camera_from_mount = state.mount_from_camera.rotation.T
        slopes = np.zeros((len(rotations), 6, PAIR))
        slopes[:, :3, :3], slopes[:, :3, 6:9] = -np.swapaxes(rotations, 1, 2), np.eye(3)
        slopes[:, 3:, :3], slopes[:, 3:, 3:6] = skew(translations), -camera_from_mount
        slopes[:, 3:, 9:] = camera_from_mount @ np.swapaxes(self.robot_rotations, 1, 2)
        return slopes

    def by_robot(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return the covariances (K, 6, 6) of the expected pose by an error of the robot of 1 mm, and of 1 rad."""
        camera_from_mount = state.mount_from_camera.rotation.T
        across = np.swapaxes(self.robot_rotations, 1, 2)
        off = state.holder_from_board.translation_mm - self.robot_translations
        turn = np.zeros((len(off), 6, 3))
        if self.board_on_flange:  # the lever is from the flange to the board
            turn[:, :3] = state.holder_from_board.rotation.T
            turn[:, 3:] = -camera_from_mount @ across @ skew(state.holder_from_board.translation_mm)
        else:
            turn[:, :3] = -np.swapaxes(across @ state.holder_from_board.rotation, 1, 2)
            turn[:, 3:] = camera_from_mount @ skew(np.einsum("kij,kj->ki", across, off))
        position = np.zeros((len(off), 6, 6))
        position[:, 3:, 3:] = np.eye(3)
        return position, turn @ np.swapaxes(turn, 1, 2)

    def residuals(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return seen minus expected, (K, 6), and its derivative (K, 6, 13 + C) by all unknowns."""
        rotations, translations = self.expected(state)
        moved = self.follows @ state.camera
        bent = np.swapaxes(rotations, 1, 2) @ self.board_rotations
        seen = self.board_translations + moved[:, 3:]
        residuals = np.empty((len(seen), 6))
        residuals[:, :3] = vector_from_rotation(bent) + moved[:, :3]
        residuals[:, 3:] = seen * (1 + state.pitch) - translations
        slopes = np.zeros((len(seen), 6, PAIR + 1 + self.camera_size))
        slopes[:, :, :PAIR] = -self.by_pair(state)
        slopes[:, 3:, PAIR] = seen
        slopes[:, :, PAIR + 1 :] = self.follows
        slopes[:, 3:, PAIR + 1 :] *= 1 + state.pitch
        return residuals, slopes

    def known(self, state: State) -> tuple[FloatArray, FloatArray]:
        """Return Hessian and gradient of what is known of pitch and camera beforehand."""
        size = PAIR + 1 + self.camera_size
        hessian, gradient = np.zeros((size, size)), np.zeros(size)
        hessian[PAIR, PAIR] = self.pitch_information
        hessian[PAIR + 1 :, PAIR + 1 :] = self.camera_information
        gradient[PAIR] = state.pitch * self.pitch_information
        gradient[PAIR + 1 :] = self.camera_information @ state.camera
        return hessian, gradient

    def fit(self, start: State, sigmas: FloatArray) -> Fit:
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
        return Fit(self, state, hessian, squares)
