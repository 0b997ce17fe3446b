"""The pose that is proposed before the first solve: it turns the flange about where the sphere probably is."""

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.frames import RigidTransform
from calib_core.simulation import simulate
from calib_core.stages.guide import guide

SHIFTS = 4
SEEDS = range(6)


def told(scenario: str, seed: int, count: int):
    """Return the guide's word after so many captures, and the simulated session."""
    simulated = simulate(scenario, seed)
    captures = simulated.session.captures[:count]
    session = simulated.session.model_copy(update={"captures": captures})
    measured = [measure_capture(session, capture, simulated.files.__getitem__) for capture in captures]
    return guide(session, measured, {}).current, simulated


def angle_rad(now, simulated) -> float:
    home = RigidTransform(np.array(simulated.world.shots[0].commanded), "base", "tool0")
    difference = home.difference(RigidTransform(np.array(now.suggested_pose), "base", "tool0"))
    return float(np.linalg.norm(difference[:3]))


def sees_the_sphere(now, simulated) -> bool:
    """Whether the light still cuts the sphere, inside the scanner's window, from the pose that is proposed."""
    world = simulated.world
    laser_from_base = np.linalg.inv(np.array(now.suggested_pose) @ np.array(simulated.truth["tool0_from_laser"]))
    seen = (laser_from_base @ np.append(world.sphere_center_in_base_mm, 1.0))[:3]
    options = world.options
    inside = abs(seen[0]) < options.window_x_mm and options.window_near_mm < seen[2] < options.window_far_mm
    return bool(inside and abs(seen[1]) < 0.98 * world.sphere_radius_mm)


@pytest.mark.parametrize("scenario", ["tcp", "tcp-clouds"])
@pytest.mark.parametrize("seed", SEEDS)
def test_after_the_shifts_alone_the_proposed_turn_is_one_that_keeps_the_sphere_in_view(
    scenario: str, seed: int
) -> None:
    # Where the scanner sits on the flange is not known yet: 190 mm from it, and the guess is none.
    now, simulated = told(scenario, seed, SHIFTS)
    assert now.meter is not None
    assert now.meter.uncertainty_mm is None  # no turn has told it
    assert sees_the_sphere(now, simulated), now.suggested_note
    assert angle_rad(now, simulated) > np.deg2rad(0.9)


@pytest.mark.parametrize("seed", SEEDS)
def test_with_turns_poses_are_bold_and_the_sphere_stays_in_view(seed: int) -> None:
    now, simulated = told("tcp", seed, SHIFTS + 4)
    assert sees_the_sphere(now, simulated), now.suggested_note
    assert angle_rad(now, simulated) > np.deg2rad(10.0)
    assert now.meter is not None
    assert now.meter.after_next_mm < now.meter.uncertainty_mm


def test_shifts_in_one_plane_tell_too_little() -> None:
    simulated = simulate("tcp", 1)
    now, _ = told("tcp", 1, 3)
    assert now.suggested_pose is not None  # still shifting
    assert "view" in str(now.suggested_note)
    assert len(simulated.session.captures) > SHIFTS
