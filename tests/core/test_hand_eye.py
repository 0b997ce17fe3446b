"""Board hand-eye in closed form: exact without noise, as exact as pairs of motions with it, refused where open."""

import bench_hand_eye
import numpy as np
import pytest

from calib_core.errors import MotionError
from calib_core.frames import RigidTransform, rotation_from_vector, stack_matrices
from calib_core.optics.hand_eye_closed import solve_ax_zb

TRUTH = RigidTransform.of([0.3, -0.2, 1.1], [40.0, -75.0, 60.0], "tool0", "camera")
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


def test_it_is_no_less_exact_than_park_and_errs_as_stated() -> None:
    rows = bench_hand_eye.exactness(range(12))
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []
