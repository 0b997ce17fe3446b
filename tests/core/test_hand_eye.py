"""Board hand-eye in closed form: exact without noise, as exact as pairs of motions with it, refused where open."""

import bench_hand_eye
import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.frames import RigidTransform, rotation_from_vector, stack_matrices
from calib_core.optics.hand_eye import solve_hand_eye
from calib_core.optics.hand_eye_closed import solve_ax_zb

TRUTH = RigidTransform.of([0.3, -0.2, 1.1], [40.0, -75.0, 60.0], "tool0", "camera")
STANDING = RigidTransform.of([2.6, 0.3, -0.4], [1400.0, -200.0, 900.0], "base", "camera")
HELD = RigidTransform.of([0.2, -0.3, 0.5], [30.0, -60.0, 120.0], "tool0", "board")
BOARD = RigidTransform.of([0.1, 3.0, 0.2], [850.0, -120.0, 35.0], "base", "board")


def exact(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    turns = [rotation_from_vector(rng.uniform(-0.5, 0.5, 3)) for _ in range(count)]
    robots = [RigidTransform.of(turn, rng.uniform(-300, 900, 3), "base", "tool0") for turn in turns]
    return stack_matrices(robots), stack_matrices([BOARD.inverse() @ robot @ TRUTH for robot in robots])


@pytest.mark.parametrize("count", [3, 40])
def test_the_equation_is_solved_exactly_without_noise(count: int) -> None:
    a, b = exact(count)
    x, z = solve_ax_zb(a, b)
    np.testing.assert_allclose(x, TRUTH.matrix, atol=1e-8)
    np.testing.assert_allclose(z, BOARD.matrix, atol=1e-8)


def test_turns_that_do_not_tell_are_refused() -> None:
    a, b = exact(8)
    flat = a.copy()
    flat[:, :3, :3] = a[0, :3, :3]
    seen = np.linalg.inv(BOARD.matrix) @ flat @ TRUTH.matrix
    with pytest.raises(MotionError, match="axes that are not parallel"):
        solve_ax_zb(flat, seen)
    with pytest.raises(MotionError, match="at least three"):
        solve_ax_zb(a[:2], b[:2])


@pytest.mark.thorough
def test_it_is_no_less_exact_than_park_and_errs_as_stated() -> None:
    rows = bench_hand_eye.exactness(range(12))
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []


def frames(
    seed: int, count: int, position_mm: float = 0.0, turning_rad: float = 0.0
) -> tuple[list[RigidTransform], list[RigidTransform]]:
    """Robot poses as reported, and the boards as the camera has them at poses that err."""
    rng = np.random.default_rng(seed)
    robots, boards = [], []
    for _ in range(count):
        board = RigidTransform.of(rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-20, 20, 2), 250], "camera", "board")
        robot = BOARD @ (TRUTH @ board).inverse()
        error = np.concatenate([rng.normal(0, turning_rad, 3), rng.normal(0, position_mm, 3)])
        robots.append(robot)
        boards.append((robot.perturbed(error) @ TRUTH).inverse() @ BOARD)
    return robots, boards


def test_hand_and_eye_are_exact_without_noise() -> None:
    found = solve_hand_eye(*frames(1, 6))
    np.testing.assert_allclose(found.mount_from_camera.difference(TRUTH), 0, atol=1e-8)
    np.testing.assert_allclose(found.holder_from_board.difference(BOARD), 0, atol=1e-8)


@pytest.mark.thorough
def test_hand_and_eye_err_as_stated() -> None:
    whole = []
    for seed in range(60):
        robots, boards = frames(seed, 10, 0.05, 2e-4)
        found = solve_hand_eye(robots, boards, 0.05, 2e-4)
        error = np.concatenate(
            [
                found.mount_from_camera.difference(TRUTH),
                found.holder_from_board.difference(BOARD),
            ]
        )
        whole.append(error @ np.linalg.solve(found.covariance[:12, :12], error))
    # Mean of 60 χ² of 12 degrees; the sigmas only ever grow, which makes it a little smaller.
    assert 10.0 < np.mean(whole) < 13.3


def test_a_board_on_the_flange_before_a_camera_that_stands_still_errs_as_stated() -> None:
    whole = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        robots, boards = [], []
        for _ in range(12):
            board = RigidTransform.of(
                rng.uniform(-0.4, 0.4, 3), [*rng.uniform(-40, 40, 2), 260], "camera", "board"
            )
            error = np.concatenate([rng.normal(0, 4e-4, 3), rng.normal(0, 0.05, 3)])
            robots.append((STANDING @ board @ HELD.inverse()).perturbed(error).inverse())
            boards.append(board)
        found = solve_hand_eye(robots, boards, 0.05, 4e-4, board_on_flange=True)
        off = found.mount_from_camera.difference(STANDING), found.holder_from_board.difference(HELD)
        whole.append(np.concatenate(off) @ np.linalg.solve(found.covariance[:12, :12], np.concatenate(off)))
    assert 7.5 < np.mean(whole) < 15.0  # of 12, as of a camera on the flange


def test_a_frame_with_a_wrong_robot_pose_is_left_out() -> None:
    robots, boards = frames(3, 12, 0.05, 2e-4)
    robots[4] = robots[4].perturbed([0, 0, 0, 0, 3.0, 0])
    found = solve_hand_eye(robots, boards, 0.05, 2e-4)
    assert found.rejected == (4,)
    off = found.mount_from_camera.difference(TRUTH)
    assert off @ np.linalg.solve(found.covariance[:6, :6], off) < 22.5  # χ² of six, 99.9 %
    assert np.sqrt(np.diag(found.covariance)[3:6]).max() < 0.5


def test_turns_about_one_axis_do_not_tell() -> None:
    robots, boards = frames(4, 8)
    about_z = [RigidTransform.of([0, 0, 0.2 * k], robots[0].translation_mm, "base", "tool0") for k in range(8)]
    seen = [(r @ TRUTH).inverse() @ BOARD for r in about_z]
    with pytest.raises(MotionError, match="axes that are not parallel"):
        solve_hand_eye(about_z, seen)
    with pytest.raises(MotionError, match="at least 4 robot poses"):
        solve_hand_eye(robots[:3], boards[:3])
