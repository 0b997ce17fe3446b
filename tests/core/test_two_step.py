"""The paper's two steps: exact data give the truth, translations are found, and what is missing is said."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.two_step import EQUAL_ORIENTATION_RAD, orientation_span, pure_translations, two_step
from calib_core.chain.two_step_covariance import _by_size, _own_covariance
from calib_core.frames import RigidTransform, rotation_from_vector
from tests.core.exact_sphere import ExactCell, exact_cell, turns

SEEDS = st.integers(0, 100_000)


def solve(cell: ExactCell):
    return two_step(cell.rotations, cell.translations, cell.seen_mm)


@settings(max_examples=40)
@given(SEEDS, st.integers(3, 5), st.integers(3, 10))
def test_exact_data_give_the_truth(seed: int, translations: int, orientations: int) -> None:
    cell = exact_cell(seed, turns(seed, translations, orientations))
    answer = solve(cell)
    assert answer.reason is None
    assert answer.rotation is not None
    assert answer.translation is not None
    tool = RigidTransform.of(answer.rotation, answer.translation, "tool0", "laser")
    np.testing.assert_allclose(cell.tool.difference(tool), 0, atol=1e-6)
    np.testing.assert_allclose(answer.center, cell.center_mm, atol=1e-6)
    assert answer.groups == (tuple(range(translations)),)


@settings(max_examples=30)
@given(SEEDS)
def test_translations_are_found_wherever_they_stand(seed: int) -> None:
    rng = np.random.default_rng(seed)
    order = rng.permutation(9)
    vectors = np.concatenate([np.zeros((3, 3)), np.full((2, 3), 0.3), turns(seed, 0, 4)])[order]
    noise = rng.normal(size=(9, 3))
    noise *= 0.2 * EQUAL_ORIENTATION_RAD / np.linalg.norm(noise, axis=1)[:, None]  # never exactly equal
    rotations = np.array(
        [rotation_from_vector(v) @ rotation_from_vector(n) for v, n in zip(vectors, noise, strict=True)]
    )
    found = {frozenset(group) for group in pure_translations(rotations)}
    place = np.argsort(order)
    assert found == {frozenset(place[:3].tolist()), frozenset(place[3:5].tolist())}


def test_orientations_that_differ_by_more_than_half_a_degree_are_no_translations() -> None:
    rotations = np.array(
        [rotation_from_vector([0, 0, angle]) for angle in EQUAL_ORIENTATION_RAD * np.array([0.0, 1.5, 3.0])]
    )
    assert pure_translations(rotations) == ()
    rotations = np.array(
        [rotation_from_vector([0, 0, angle]) for angle in EQUAL_ORIENTATION_RAD * np.array([0.0, 0.5, 3.0])]
    )
    assert pure_translations(rotations) == ((0, 1),)


def test_two_groups_of_one_translation_each_suffice() -> None:
    vectors = np.concatenate([np.zeros((2, 3)), np.tile([0.4, -0.3, 0.2], (2, 1)), turns(2, 0, 3)])
    cell = exact_cell(2, vectors)
    answer = solve(cell)
    assert answer.groups == ((0, 1), (2, 3))
    assert answer.translation is not None
    np.testing.assert_allclose(answer.translation, cell.tool.translation_mm, atol=1e-6)


def one_place(cell: ExactCell, indices: list[int], seen: Callable[[int], np.ndarray]) -> ExactCell:
    """Move captures so that they see the sphere at a given place of L."""
    poses, places = list(cell.poses), cell.seen_mm.copy()
    for k in indices:
        places[k] = seen(k)
        rotation = poses[k].rotation
        shift = cell.center_mm - rotation @ cell.tool.apply(places[k])
        poses[k] = RigidTransform.of(rotation, shift, "base", "tool0")
    return ExactCell(cell.tool, cell.center_mm, poses, places)


def test_what_is_missing_is_said() -> None:
    many = turns(5, 0, 8)
    cases = {
        "no pure translation": exact_cell(5, many),
        "one orientation only": exact_cell(5, np.zeros((6, 3))),
        "about one axis only": exact_cell(
            5, np.concatenate([np.zeros((4, 3)), np.outer(range(1, 5), [0.1, 0.2, 0])])
        ),
    }
    parallel = exact_cell(5, np.concatenate([np.zeros((3, 3)), many]))
    cases["all pure translations are parallel"] = one_place(
        parallel, [0, 1, 2], lambda k: np.array([5.0, 8.0, 160.0]) + 20.0 * k * np.array([0.6, 0, 0.8])
    )
    cases["30 to 80 mm apart"] = one_place(parallel, [0, 1, 2], lambda k: np.array([5.0, 8.0, 160.0 + 0.5 * k]))
    for said, cell in cases.items():
        answer = solve(cell)
        assert answer.reason is not None, said
        assert said in answer.reason
        assert (answer.rotation, answer.translation, answer.center) == (None, None, None)
        assert answer.reason.endswith("needed")


@pytest.mark.parametrize(
    ("vectors", "expected"),
    [
        (np.zeros((4, 3)), (0, 0, 0)),
        (np.outer([-0.2, 0.0, 0.2], [0, 0, 1.0]), (1, 0, 0)),
        (np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0]]), (1, 1, 0)),
        (np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.3]]), (1, 1, 1)),
    ],
)
def test_the_span_counts_the_axes_that_were_turned_about(vectors: np.ndarray, expected: tuple[int, ...]) -> None:
    first = rotation_from_vector([1.0, 2.0, -0.5])
    span = orientation_span(np.array([first @ rotation_from_vector(v) for v in vectors]))
    assert tuple((span > EQUAL_ORIENTATION_RAD).astype(int)) == expected


@settings(max_examples=20)
@given(st.floats(2.0, 38.0), st.sampled_from([-1.0, 1.0]), st.floats(0.001, 0.2))
def test_a_profiles_centre_moves_with_radius_and_circle_as_pythagoras_says(
    circle_mm: float, side: float, sigma_mm: float
) -> None:
    """The centre stands √(R² − r²) beside the profile's plane: differences of that foretell both."""

    def height(radius_mm: float, circle_mm: float) -> float:
        return float(np.sqrt(radius_mm**2 - circle_mm**2))

    size = SphereSize(80.0, sigma_mm)
    center = np.array([3.0, side * height(40.0, circle_mm), 250.0])
    covariance = np.diag([0.01, 0.02, 0.03]) + 0.002
    pose, none = RigidTransform.of(np.eye(3), np.zeros(3), "base", "tool0"), np.empty((0, 3))
    one = SphereObservation("p1", pose, "profile", none, center * [1, 0, 1], covariance, circle_mm)
    cloud = SphereObservation("c1", pose, "cloud", none, center, covariance)
    of_size = float(np.hypot(sigma_mm / 2, ScannerPriors().incidence_mm))
    by_radius = (height(40.0 + 1e-4, circle_mm) - height(40.0 - 1e-4, circle_mm)) / 2e-4
    moved = _by_size([one, cloud], size, np.array([center, center]))
    np.testing.assert_allclose(moved, [[0.0, side * by_radius * of_size, 0.0], [0.0, 0.0, 0.0]], rtol=1e-4)
    whole = SphereObservation("p2", pose, "profile", none, center * [1, 0, 1], covariance, 40.0)
    least = _by_size([whole], size, np.array([center]))[0, 1]  # of a great circle it is not without end
    assert least == pytest.approx(side * 10 * of_size)
    by_circle = (height(40.0, circle_mm + 1e-4) - height(40.0, circle_mm - 1e-4)) / 2e-4
    of_center = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, by_circle], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(_own_covariance(one, size), of_center @ covariance @ of_center.T, rtol=1e-4)
    np.testing.assert_allclose(_own_covariance(cloud, size), covariance)
