"""The robot as a length standard: the board's pitch is measured, the camera compared, a difference is covered."""

import numpy as np
import pytest
from bench_hand_eye import views
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from calib_core.frames import RigidTransform
from calib_core.optics.board import BoardView
from calib_core.optics.camera import CameraOptions, calibrate_camera
from calib_core.optics.camera_model import CameraModel
from calib_core.optics.camera_solution import CameraSolution
from calib_core.optics.hand_eye import solve_hand_eye
from calib_core.optics.robot_lengths import RobotLengths, RobotPoses

SIZE = (1280, 1024)
CAMERA = CameraModel.from_names(
    np.array([[2400.0, 0, 650], [0, 2390, 500], [0, 0, 1]]), {"k1": -0.2, "k2": 0.12}, SIZE
)
BOARD = np.array([[x, y, 0.0] for y in range(8) for x in range(11)]) * 8
TOOL0_FROM_CAMERA = RigidTransform.of([0.3, -0.2, 1.1], [40.0, -75.0, 60.0], "tool0", "camera")
BASE_FROM_BOARD = RigidTransform.of([0.1, 3.0, 0.2], [850.0, -120.0, 35.0], "base", "board")


def solved(seed: int, pitch_factor: float = 1.0, bow_mm: float = 0.0, **robot: float) -> CameraSolution:
    """A camera from twelve views of a fixed, bowed board whose true pitch is a factor of the told one."""
    rng = np.random.default_rng([seed, 12])
    bowed = pitch_factor * BOARD
    bowed[:, 2] = bow_mm * ((BOARD[:, 0] - 40) / 40) ** 2
    views: list[BoardView] = []
    poses: list[RigidTransform | None] = []
    while len(views) < 12:
        turn, z = Rotation.from_rotvec(rng.uniform(-0.6, 0.6, 3)).as_matrix(), rng.uniform(300, 600)
        place = np.array([rng.uniform(-0.15, 0.15) * z, rng.uniform(-0.12, 0.12) * z, z]) - turn @ BOARD.mean(0)
        pixels = CAMERA.project(bowed @ turn.T + place)
        if not ((pixels > 0).all() and (pixels < SIZE).all()):
            continue
        noisy = pixels + rng.normal(0, 0.05, pixels.shape)
        views.append(BoardView(noisy, BOARD, np.arange(len(BOARD)), SIZE, 0.05))
        board = RigidTransform.of(turn, place, "camera", "board")
        true = BASE_FROM_BOARD @ (TOOL0_FROM_CAMERA @ board).inverse()
        turning, position = robot.get("turning_rad", 2e-4), robot.get("position_mm", 0.05)
        poses.append(true.perturbed(np.concatenate([rng.normal(0, turning, 3), rng.normal(0, position, 3)])))
    return calibrate_camera(views, SIZE, CameraOptions(model="plain"), None, RobotPoses(poses))


def told(solution: CameraSolution) -> RobotLengths:
    assert solution.robot is not None
    return solution.robot


def test_a_pitch_that_is_told_wrongly_is_measured() -> None:
    found = told(solved(1, 0.98))
    assert found.pitch_sigma < 5e-4
    assert found.pitch_factor == pytest.approx(0.98, abs=4 * found.pitch_sigma)


@pytest.mark.thorough
def test_pitch_and_camera_err_as_stated_and_agree() -> None:
    runs, pitches, focals, alone = 12, [], [], []
    chances = []
    for seed in range(runs):
        solution = solved(seed)
        found = told(solution)
        pitches.append(((found.pitch_factor - 1) / found.pitch_sigma) ** 2)
        off = solution.camera.camera_matrix[0, 0] - 2400.0
        focals.append(((off + found.change[0]) / found.sigmas[0]) ** 2)
        alone.append(off**2 / solution.covariance[0, 0])
        chances.append(found.chance)
    low, high = chi2.ppf([0.002, 0.998], runs) / runs
    assert low < np.mean(pitches) < high
    assert low < np.mean(focals) < high
    assert low < np.mean(alone) < high
    assert min(chances) > 1e-3


def test_a_pitch_that_is_known_well_is_kept_and_helps() -> None:
    robots, boards = views(3, 15)
    unknown = solve_hand_eye(robots, boards, 0.05, 2e-4)
    known = solve_hand_eye(robots, boards, 0.05, 2e-4, pitch_sigma=1e-5)
    assert known.pitch_sigma < 1.01e-5 < unknown.pitch_sigma
    assert known.covariance[5, 5] < 0.3 * unknown.covariance[5, 5]


@pytest.mark.thorough
def test_where_robot_and_boards_disagree_the_covariance_holds_the_difference() -> None:
    for seed in (4, 5):
        solution = solved(seed, bow_mm=0.2, position_mm=0.02, turning_rad=5e-5)
        found = told(solution)
        assert found.chance < 0.05
        off = solution.camera.camera_matrix[0, 0] - 2400.0
        alone = np.sqrt((solution.covariance - found.disagreement)[0, 0])
        assert 2.5 * alone < abs(off) < 2.0 * np.sqrt(solution.covariance[0, 0])
        assert abs(off + found.change[0]) < 0.1 * abs(off)


def test_poses_of_another_board_measure_nothing() -> None:
    assert solved(5, position_mm=200.0, turning_rad=0.5).robot is None
