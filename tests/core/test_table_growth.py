"""A long session's table is searched with few of its captures, and found as with all."""

import tracemalloc
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from calib_core.chain.observations import SphereObservation, SphereSize, TableObservation
from calib_core.chain.spread import SEARCHED_OF_A_MOUNTING, most_agreed, spread_captures
from calib_core.chain.table_angles import with_found_angles
from calib_core.chain.table_start import find_table_start
from calib_core.frames import RigidTransform, rotation_from_vector

SPHERE = SphereSize(40.0)
TOOL = RigidTransform(np.eye(4), "tool0", "laser")
PLACE = np.array([90.0, 0.0, 30.0])  # of the sphere on a table whose frame is base's


@lru_cache
def captures(count: int, wrong: float) -> list[TableObservation]:
    """Profiles of a sphere on a table all around, scattered by 0.1 mm; of some the sphere was elsewhere."""
    rng = np.random.default_rng(count)
    found: list[TableObservation] = []
    for k in range(count):
        angle, height = rng.uniform(0, 2 * np.pi), rng.uniform(4, 14) * rng.choice([-1, 1])
        turn = rotation_from_vector(np.array([0.0, 0.0, angle]))
        shift = rng.uniform(-60, 60, 3) if rng.random() < wrong else 0.1 * rng.standard_normal(3)
        rotation = rotation_from_vector(rng.uniform(-0.3, 0.3, 3))
        in_laser = np.array([rng.uniform(-9, 9), height, 200.0])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = rotation, turn @ PLACE + shift - rotation @ in_laser
        pose = RigidTransform(matrix, "base", "tool0")
        sphere = SphereObservation(
            f"t{k}",
            pose,
            "profile",
            np.zeros((0, 3)),
            in_laser * [1, 0, 1],
            np.eye(3),
            float(np.sqrt(SPHERE.radius_mm**2 - height**2)),
        )
        found.append(TableObservation(sphere, float(angle), ""))
    return found


def peak_bytes(search: Callable[..., object], of: list[TableObservation]) -> int:
    tracemalloc.start()
    try:
        search(of, SPHERE, TOOL)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("search", [find_table_start, with_found_angles])
def test_the_search_grows_with_the_captures_and_not_with_their_square(search: Callable[..., object]) -> None:
    few, many = (peak_bytes(search, captures(count, 0.1)) for count in (100, 300))
    assert many < 4.5 * few  # all places beside all captures: 9 times


def test_many_captures_of_which_a_third_is_wrong_start_at_the_table() -> None:
    of = captures(600, 0.33)
    start = find_table_start(of, SPHERE, TOOL)
    assert abs(start.state.rotation[2, 2] - 1) < 1e-4
    assert np.median(start.misfit_mm) < 1.0
    right = start.misfit_mm < 2.0
    true = np.array(
        [
            np.sign((o.sphere.base_from_tool0.inverse().apply(_center(o)) - o.sphere.center_in_laser_mm)[1])
            for o in of
        ]
    )
    assert right.mean() > 0.6
    assert (start.sides[right] == true[right]).all()


def _center(o: TableObservation) -> np.ndarray:
    return rotation_from_vector(np.array([0.0, 0.0, o.angle_rad])) @ PLACE


@pytest.mark.parametrize("wrong", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_the_place_found_with_few_is_the_best_of_all(seed: int, wrong: float) -> None:
    rng = np.random.default_rng(seed)
    places = 0.4 * rng.standard_normal((500, 2, 3)) + 3.0
    places[:, 1] += rng.uniform(-30, 30, (500, 3))
    places[rng.random(500) < wrong] += 15.0
    few = np.zeros(500, dtype=bool)
    few[spread_captures(np.zeros(500, dtype=int), rng.uniform(0, 7, 500))] = True
    best = most_agreed(places, np.ones(500, dtype=bool), exact=True)
    assert (most_agreed(places, few, exact=True) == best).all()


def test_rare_mountings_and_rare_directions_are_searched() -> None:
    mounts = np.array([0] * 1000 + [1] * 5 + [-1] * 20)
    angles = np.zeros(len(mounts))
    angles[[17, 530]] = np.deg2rad([1.5, 200.0])
    few = spread_captures(mounts, angles)
    assert {17, 530, *range(1000, 1005)} <= set(few.tolist())
    assert len(few) == SEARCHED_OF_A_MOUNTING + 5
    assert (np.diff(few) > 0).all()
    assert spread_captures(mounts[940:], angles[940:]).tolist() == list(range(65))  # short sessions: all
