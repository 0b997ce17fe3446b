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


def off_mm(now, simulated) -> float:
    """Return how far the sphere leaves its place in the scanner's view where the guide's turn is carried out."""
    truth = simulated.truth
    tool0_from_laser = np.array(truth["tool0_from_laser"])
    center = np.append(truth["sphere_center_in_base_mm"], 1.0)
    home = np.array(simulated.world.shots[0].commanded)
    seen = [(np.linalg.inv(pose @ tool0_from_laser) @ center)[:3] for pose in (home, np.array(now.suggested_pose))]
    return float(np.linalg.norm(seen[1] - seen[0]))


def angle_rad(now, simulated) -> float:
    home = RigidTransform(np.array(simulated.world.shots[0].commanded), "base", "tool0")
    difference = home.difference(RigidTransform(np.array(now.suggested_pose), "base", "tool0"))
    return float(np.linalg.norm(difference[:3]))


@pytest.mark.parametrize("scenario", ["tcp", "tcp-clouds"])
@pytest.mark.parametrize("seed", SEEDS)
def test_after_the_shifts_alone_only_the_scanners_place_is_assumed(scenario: str, seed: int) -> None:
    now, simulated = told(scenario, seed, SHIFTS)
    assert "assumes that the scanner sits at the flange" in str(now.suggested_note)
    place = np.array(simulated.truth["tool0_from_laser"])[:3, 3]
    # All that is wrong is the scanner's distance from the flange, and a turn moves that by its chord.
    chord = 2 * np.sin(angle_rad(now, simulated) / 2)
    assert off_mm(now, simulated) < np.linalg.norm(place) * chord + 5.0
    blind_mm = np.linalg.norm(place) * chord
    assert blind_mm > 30.0


@pytest.mark.parametrize("seed", SEEDS)
def test_with_turns_the_sphere_stays_in_view(seed: int) -> None:
    before, simulated = told("tcp", seed, SHIFTS)
    now, _ = told("tcp", seed, SHIFTS + 4)
    assert "where the captures so far put the sphere" in str(now.suggested_note)
    assert off_mm(now, simulated) < 15.0, now.suggested_note
    assert off_mm(now, simulated) < off_mm(before, simulated) / 2


def test_shifts_in_one_plane_tell_too_little() -> None:
    simulated = simulate("tcp", 1)
    now, _ = told("tcp", 1, 3)
    assert now.suggested_pose is not None  # still shifting
    assert "view" in str(now.suggested_note)
    assert len(simulated.session.captures) > SHIFTS
