"""The start: exact captures give tool, sphere and sides, whatever the tool, the motions and a few gross errors."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.chain.start import Start, centers_of, find_start
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
    rng = np.random.default_rng([seed, 2])
    bad = rng.permutation(14)[:2]
    profiles = cell.profiles()
    for k in bad:
        pose = profiles[k].base_from_tool0
        away = rng.normal(size=3)
        shifted = pose.perturbed([0, 0, 0, *(off_mm * away / np.linalg.norm(away))])
        profiles[k] = replace(profiles[k], base_from_tool0=cell.poses[(k + 1) % 14] if wrong_pose else shifted)
    good = np.isin(np.arange(14), bad, invert=True)
    assert_found(find_start(centers_of(profiles, SPHERE)), cell, good)


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
