"""The start: exact captures give tool, sphere and sides, whatever the tool, the motions and a few gross errors."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.chain.observations import SphereObservation
from calib_core.chain.start import Start, centers_of, find_start, heights
from calib_core.frames import RigidTransform
from tests.core.exact_sphere import SPHERE, ExactCell, exact_cell, turns

SEEDS = st.integers(0, 100_000)
# Damped Gauss–Newton ends within a micrometre or so of an exact answer; a wrong side is millimetres away.
NEAR_MM, NEAR_RAD = 0.02, 2e-4


def assert_found(start: Start, cell: ExactCell, good: np.ndarray | slice = slice(None)) -> None:
    tool = RigidTransform.of(start.rotation, start.translation, "tool0", "laser")
    error = cell.tool.difference(tool)
    assert np.linalg.norm(error[:3]) < NEAR_RAD
    assert np.linalg.norm(error[3:]) < NEAR_MM
    assert np.linalg.norm(start.center - cell.center_mm) < NEAR_MM
    assert start.misfit_mm[good].max() < NEAR_MM
    np.testing.assert_array_equal(start.sides[good], np.sign(cell.seen_mm[:, 1])[good])


@settings(max_examples=10)
@given(SEEDS)
def test_translations_and_orientations(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 4, 10))
    assert_found(find_start(centers_of(cell.profiles(), SPHERE)), cell)


@settings(max_examples=10)
@given(SEEDS)
def test_no_pure_translation_at_all(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 0, 12))
    assert_found(find_start(centers_of(cell.profiles(), SPHERE)), cell)


@settings(max_examples=10)
@given(SEEDS, st.floats(3, 60), st.booleans())
def test_two_gross_errors_among_fourteen_do_not_matter(seed: int, off_mm: float, wrong_pose: bool) -> None:
    cell = exact_cell(seed, turns(seed, 4, 10))
    profiles, good = with_two_wrong(cell, seed, off_mm, wrong_pose)
    assert_found(find_start(centers_of(profiles, SPHERE)), cell, good)


@pytest.mark.parametrize("seed", range(12))
def test_two_gross_errors_among_eight_do_not_matter(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 2, 6))
    profiles, good = with_two_wrong(cell, seed, 50.0, wrong_pose=False)
    assert_found(find_start(centers_of(profiles, SPHERE)), cell, good)


def with_two_wrong(
    cell: ExactCell, seed: int, off_mm: float, wrong_pose: bool
) -> tuple[list[SphereObservation], np.ndarray]:
    """Return a cell's profiles, two of them shifted or with the pose of the next, and which are good."""
    count = len(cell.poses)
    rng = np.random.default_rng([seed, 2])
    bad = rng.permutation(count)[:2]
    profiles = cell.profiles()
    for k in bad:
        pose = profiles[k].base_from_tool0
        away = rng.normal(size=3)
        shifted = pose.perturbed([0, 0, 0, *(off_mm * away / np.linalg.norm(away))])
        next_pose = cell.poses[(k + 1) % count]
        profiles[k] = replace(profiles[k], base_from_tool0=next_pose if wrong_pose else shifted)
    return profiles, np.isin(np.arange(count), bad, invert=True)


@pytest.mark.parametrize("seed", [11, 42, 69, 104])  # where others fit x and z alone nearly as well
def test_the_fewest_captures_are_enough(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 2, 3))
    rng = np.random.default_rng([seed, 3])
    noise = np.concatenate([rng.normal(0, 2e-4, (5, 3)), rng.normal(0, 0.05, (5, 3))], axis=1)
    profiles = [
        replace(o, base_from_tool0=o.base_from_tool0.perturbed(off))
        for o, off in zip(cell.profiles(), noise, strict=True)
    ]
    # Poses off by 0.05 mm and, on an arm of 0.5 m, 0.1 mm: 0.2 mm in all; wrong answers leave 0.7.
    assert find_start(centers_of(profiles, SPHERE)).scatter_mm < 0.4


@settings(max_examples=4)
@given(SEEDS)
def test_clouds_and_centres_have_no_side_to_choose(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 2, 8))
    start = find_start(centers_of(cell.centers(), SPHERE))
    assert (start.sides == 0).all()
    tool = RigidTransform.of(start.rotation, start.translation, "tool0", "laser")
    assert np.linalg.norm(cell.tool.difference(tool)[3:]) < NEAR_MM


@settings(max_examples=4)
@given(SEEDS)
def test_a_mixture_of_profiles_and_centres(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 3, 9))
    mixed = [p if k % 2 else c for k, (p, c) in enumerate(zip(cell.profiles(), cell.centers(), strict=True))]
    start = find_start(centers_of(mixed, SPHERE))
    np.testing.assert_array_equal(start.sides, np.where(np.arange(12) % 2, np.sign(cell.seen_mm[:, 1]), 0))
    assert np.linalg.norm(start.center - cell.center_mm) < NEAR_MM


def test_a_side_that_the_user_fixed_is_kept() -> None:
    cell = exact_cell(3, turns(3, 4, 10))
    fixed = [replace(p, side=int(np.sign(y))) for p, y in zip(cell.profiles(), cell.seen_mm[:, 1], strict=True)]
    centers = centers_of(fixed, SPHERE)
    assert not centers.open_side.any()
    np.testing.assert_allclose(centers.measured, cell.seen_mm, atol=1e-9)


def test_a_great_circle_weighs_little_in_y() -> None:
    cell = exact_cell(3, turns(3, 4, 10))
    profiles = cell.profiles()
    profiles[0] = replace(profiles[0], circle_radius_mm=19.999)
    weights = centers_of(profiles, SPHERE).height_weight
    assert weights[0] < 0.05
    assert weights[0] < weights[1:].min()


def test_more_captures_than_are_searched() -> None:
    cell = exact_cell(9, turns(9, 10, 70))
    assert_found(find_start(centers_of(cell.profiles(), SPHERE)), cell)


@pytest.mark.parametrize("seed", range(4))
def test_the_rival_has_other_sides_and_fits_worse(seed: int) -> None:
    cell = exact_cell(seed, turns(seed, 4, 10))
    start = find_start(centers_of(cell.profiles(), SPHERE))
    assert start.rival_scatter_mm is None or start.rival_scatter_mm > 10 * start.scatter_mm


def test_heights_that_are_tried_begin_with_the_right_one_and_lie_apart() -> None:
    cell = exact_cell(3, turns(3, 4, 10))
    sought = centers_of(cell.profiles(), SPHERE)
    found = heights(sought, cell.tool.rotation, cell.center_mm, 0.0)
    right = cell.tool.rotation[:, 1] @ cell.tool.translation_mm
    assert found[0] == pytest.approx(right, abs=1e-6)
    assert len(found) == 3
    assert min(abs(a - b) for a, b in combinations(found, 2)) > 2.0
