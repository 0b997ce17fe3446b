"""The way from a scanner to its ball: whatever carries them, the robot's errors move what the geometry says."""

import numpy as np
import pytest

from calib_core.cell.walk import Carrier, Carriers, Walk
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector

EVERY: list[tuple[Carrier, Carrier]] = [("tool0", "base"), ("base", "tool0"), ("base", "base"), ("tool0", "tool0")]


def pose(seed: int) -> RigidTransform:
    rng = np.random.default_rng(seed)
    return RigidTransform.of(rng.uniform(-1, 1, 3), rng.uniform(-500, 500, 3), "base", "tool0")


def seen(carriers: Carriers, at: RigidTransform, mounted: RigidTransform, ball: FloatArray) -> FloatArray:
    return (carriers.ball_from_scanner(at) @ mounted).inverse().apply(ball)


@pytest.mark.parametrize(("scanner", "ball"), EVERY)
def test_a_pose_that_is_off_moves_the_ball_as_levers_and_axes_say(scanner: Carrier, ball: Carrier) -> None:
    carriers = Carriers(scanner, ball)
    reported = [pose(seed) for seed in range(5)]
    mounted = RigidTransform.of([0.3, -0.2, 1.0], [40.0, -90.0, 130.0], scanner, "laser")
    center = np.array([210.0, -70.0, 330.0])
    walk = Walk.of(reported, [carriers] * 5)
    expected = np.array([seen(carriers, one, mounted, center) for one in reported])
    axes = walk.laser_from_base(mounted.rotation)
    levers = walk.levers(mounted.rotation, mounted.translation_mm, expected)
    shift, turn = np.array([0.02, -0.03, 0.01]), np.array([1e-5, -2e-5, 3e-5])
    moves = walk.moves(axes, levers)
    for k, one in enumerate(reported):
        turned = rotation_from_vector(turn) @ one.rotation
        true = RigidTransform.of(turned, one.translation_mm - shift, "base", "tool0")
        moved = seen(carriers, true, mounted, center) - expected[k]
        told = moves[k] @ [*shift, *turn]
        assert np.allclose(moved, told, atol=2e-6)
        assert (carriers.over_robot != 0) == bool(np.abs(moved).max() > 1e-3)
