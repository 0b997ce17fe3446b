"""Standstill: exposures at one commanded pose, still and moved, of the simulated sphere."""

import json

import numpy as np
import pytest
from scipy.stats import binom

from calib_core.captures.measure import measure_capture
from calib_core.records import parse_session
from calib_core.simulation import TcpScenario
from calib_core.simulation.profile_cell import build_world, measure, pose_numbers
from calib_core.simulation.writing import profile_csv, session_record
from calib_core.sphere.arc import ArcFit, fit_arc
from calib_core.sphere.standstill import LEAST_CHANCE, standstill

OPTIONS = TcpScenario()
EXPOSURES = 6
SESSIONS = 120


def profiles(seed: int, movement_mm: float, axis: int = 0, exposures: int = EXPOSURES) -> list[np.ndarray]:
    """Return profiles (N, 3) of one pose; the sphere is off its place by a normal deviate along an axis of L."""
    rng = np.random.default_rng([seed, 31])
    world = build_world(OPTIONS, rng)
    pose = world.shots[0].commanded
    along = (pose @ world.tool0_from_laser)[:3, axis]
    centers = [
        world.sphere_center_in_base_mm + along * movement_mm * rng.standard_normal() for _ in range(exposures)
    ]
    return [measure("profile", world, pose, center, rng)[2] for center in centers]


def arcs(*case: float) -> list[ArcFit]:
    return [fit_arc(points[:, [0, 2]], OPTIONS.sphere_diameter_mm) for points in profiles(*case)]


@pytest.mark.thorough
def test_what_stands_still_is_said_to_stand_still_as_often_as_chance_lets():
    chances = np.array([standstill([arcs(seed, 0.0)]).chance for seed in range(SESSIONS)])
    # Were noise overstated, small chances would lack; were it understated, they would abound.
    for share in (0.05, 0.3, 0.7):
        low, high = binom.interval(0.999, SESSIONS, share)
        assert low <= np.sum(chances < share) <= high, share
    assert np.sum(chances < LEAST_CHANCE) <= binom.ppf(0.999, SESSIONS, LEAST_CHANCE)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("axis", [0, 2])
def test_movement_in_the_plane_of_light_is_measured(axis: int):
    moved_mm = 0.1
    found = [standstill([arcs(seed, moved_mm, axis)]) for seed in range(40)]
    assert not any(one.stands_still for one in found)
    # The sum of 40 × 5 squared deviates has a relative sigma of √(2 / 200); noise adds little to 0.1 mm.
    squares = np.mean([one.movement_mm**2 for one in found])
    assert squares == pytest.approx(moved_mm**2, rel=4 * np.sqrt(2 / 200))


def test_movement_across_the_plane_of_light_is_seen_in_the_radius():
    found = [standstill([arcs(seed, 0.3, 1)]) for seed in range(20)]
    assert not any(one.stands_still for one in found)


def test_one_exposure_a_pose_cannot_be_told():
    one, other = arcs(1, 0.0), arcs(2, 0.0)
    assert standstill([one[:1], other[:1]]) is None
    assert standstill([one, other]).exposures == 2 * EXPOSURES  # far apart, but of two poses


def measured(movement_mm: float, poses_apart_mm: float = 0.0):
    rng = np.random.default_rng([4, 31])
    world = build_world(OPTIONS, rng)
    numbers = pose_numbers(world.shots[0].commanded)
    shots = profiles(4, movement_mm)
    names = [f"captures/{k}.csv" for k in range(len(shots))]
    files = {name: profile_csv(points, 1.0) for name, points in zip(names, shots, strict=True)}
    record = session_record(world, "exposures").to_json()
    poses = [[numbers[0] + k * poses_apart_mm, *numbers[1:]] for k in range(len(shots))]
    record["captures"] = [{"id": "s", "step": "tcp", "kind": "sweep", "files": names, "poses": poses}]
    session = parse_session(json.loads(json.dumps(record)))
    return measure_capture(session, session.captures[0], files.__getitem__)


def test_a_capture_of_several_exposures_says_whether_something_moved():
    still = measured(0.0)
    assert still.verdict == "pass"
    assert still.still is not None
    assert (still.still.exposures, still.still.stands_still) == (EXPOSURES, True)
    moved = measured(0.2)
    assert moved.verdict == "warn"
    assert moved.still is not None
    assert not moved.still.stands_still
    assert f"{moved.still.movement_mm:.3f} mm" in str(moved.reason)
    assert "settle" in str(moved.to_do)


def test_a_sweep_that_moves_on_is_no_standstill():
    assert measured(0.0, poses_apart_mm=0.05).still is None
