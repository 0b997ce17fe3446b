"""Rigid transforms: the group axioms as properties, frames that must meet, and matrices that are none."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib_core.errors import InputError
from calib_core.frames import (
    FRAMES,
    RigidTransform,
    nearest_rotation,
    rotation_from_vector,
    skew,
    stack_matrices,
    vector_from_rotation,
)

PLACES_MM = st.lists(st.floats(-3000, 3000), min_size=3, max_size=3)
TURNS_RAD = st.one_of(
    st.lists(st.floats(-3.1, 3.1), min_size=3, max_size=3),
    st.lists(st.floats(-1e-5, 1e-5), min_size=3, max_size=3),  # where the series takes over
)
ROUNDING_MM = 1e-8  # of products of numbers up to some 1e4


@st.composite
def transforms(draw: st.DrawFn, into: str = "base", outof: str = "tool0") -> RigidTransform:
    return RigidTransform.of(draw(TURNS_RAD), draw(PLACES_MM), into, outof)  # pyright: ignore[reportArgumentType]


def assert_same(a: RigidTransform, b: RigidTransform) -> None:
    assert (a.into, a.outof) == (b.into, b.outof)
    np.testing.assert_allclose(a.rotation, b.rotation, atol=1e-12)
    np.testing.assert_allclose(a.translation_mm, b.translation_mm, atol=ROUNDING_MM)


@given(transforms("turntable", "base"), transforms("base", "tool0"), transforms("tool0", "laser"))
def test_composition_is_associative(a: RigidTransform, b: RigidTransform, c: RigidTransform) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))


@given(transforms())
def test_identity_and_inverse(a: RigidTransform) -> None:
    assert_same(RigidTransform.identity("base", "base") @ a, a)
    assert_same(a @ RigidTransform.identity("tool0", "tool0"), a)
    assert_same(a @ a.inverse(), RigidTransform.identity("base", "base"))
    assert_same(a.inverse() @ a, RigidTransform.identity("tool0", "tool0"))
    assert_same(a.inverse().inverse(), a)


@given(transforms("turntable", "base"), transforms("base", "laser"))
def test_an_inverse_of_a_product_reverses_it(a: RigidTransform, b: RigidTransform) -> None:
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(transforms("base", "tool0"), transforms("tool0", "laser"), PLACES_MM)
def test_points_go_the_way_the_names_say(a: RigidTransform, b: RigidTransform, point: list[float]) -> None:
    np.testing.assert_allclose((a @ b).apply(point), a.apply(b.apply(point)), atol=ROUNDING_MM)
    np.testing.assert_allclose((a @ b).rotate(point), a.rotate(b.rotate(point)), atol=ROUNDING_MM)
    np.testing.assert_allclose(a.inverse().apply(a.apply(point)), point, atol=ROUNDING_MM)
    many = np.array([point, [0.0, 0.0, 0.0]])
    np.testing.assert_allclose(a.apply(many)[1], a.translation_mm)
    np.testing.assert_allclose(a.apply(many)[0] - a.apply(many)[1], a.rotate(point), atol=ROUNDING_MM)


@given(st.sampled_from(list(product(FRAMES, repeat=4))))
def test_frames_cancel_or_are_refused(names: tuple[str, ...]) -> None:
    into, left, right, outof = names
    a = RigidTransform.of([0.1, 0, 0], [1, 2, 3], into, left)  # pyright: ignore[reportArgumentType]
    b = RigidTransform.of([0, 0.1, 0], [4, 5, 6], right, outof)  # pyright: ignore[reportArgumentType]
    if left == right:
        assert ((a @ b).into, (a @ b).outof) == (into, outof)
        assert (a.inverse().into, a.inverse().outof) == (left, into)
        return
    with pytest.raises(InputError) as caught:
        a @ b
    said = str(caught.value)
    assert f"{into}_from_{left}" in said
    assert f"{right}_from_{outof}" in said
    assert said.endswith("Invert one of the two or change their order.")


def test_rotations_of_a_vector_are_right_handed() -> None:
    quarter = rotation_from_vector([0, 0, np.pi / 2])
    np.testing.assert_allclose(quarter @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(skew([1, 2, 3]) @ [-4, 5, 6], np.cross([1, 2, 3], [-4, 5, 6]))


@given(TURNS_RAD)
def test_a_rotation_vector_agrees_with_scipys(vector: list[float]) -> None:
    expected = Rotation.from_rotvec(vector)
    np.testing.assert_allclose(rotation_from_vector(vector), expected.as_matrix(), atol=1e-14)
    # Near half a turn ±v are the same rotation: compare what they do.
    matrix = rotation_from_vector(vector)
    back = vector_from_rotation(matrix)
    np.testing.assert_allclose(back, Rotation.from_matrix(matrix).as_rotvec(), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(rotation_from_vector(back), expected.as_matrix(), atol=1e-12)


def test_the_rotation_vector_of_what_is_no_rotation_yet_is_the_nearest_ones() -> None:
    rotation = rotation_from_vector([0.3, -0.2, 0.5]) + 1e-4 * np.arange(9).reshape(3, 3)
    expected = vector_from_rotation(nearest_rotation(rotation))
    np.testing.assert_allclose(vector_from_rotation(rotation), expected, atol=1e-12)


@given(transforms(), st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3), PLACES_MM)
def test_perturbed_and_difference_undo_each_other(
    a: RigidTransform, turn: list[float], shift_mm: list[float]
) -> None:
    xi = np.array([*turn, *shift_mm])
    moved = a.perturbed(xi)
    np.testing.assert_allclose(a.difference(moved), xi, atol=1e-9)
    np.testing.assert_allclose(moved.rotation, a.rotation @ Rotation.from_rotvec(turn).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(moved.translation_mm, a.translation_mm + shift_mm)
    np.testing.assert_array_equal(a.difference(a.perturbed(np.zeros(6))).round(12), 0)


@given(transforms(), transforms())
def test_a_difference_leads_from_one_to_the_other(a: RigidTransform, b: RigidTransform) -> None:
    assert_same(a.perturbed(a.difference(b)), b)


def test_a_difference_needs_the_same_frames() -> None:
    with pytest.raises(InputError, match=r"base_from_tool0.*tool0_from_base"):
        RigidTransform.identity("base", "tool0").difference(RigidTransform.identity("tool0", "base"))


@given(transforms())
def test_a_printed_matrix_is_taken_as_the_rotation_that_it_means(a: RigidTransform) -> None:
    printed = np.round(a.matrix, 3)
    back = RigidTransform.from_rounded(printed, "base", "tool0")
    # An entry is off by at most half a thousandth, so the nearest rotation by at most 3 · 0.0005 (Frobenius) more.
    np.testing.assert_allclose(back.rotation, a.rotation, atol=3e-3)
    np.testing.assert_allclose(back.rotation @ back.rotation.T, np.eye(3), atol=1e-14)
    np.testing.assert_array_equal(back.translation_mm, printed[:3, 3])


def test_a_printed_matrix_is_not_taken_as_exact() -> None:
    printed = np.round(RigidTransform.of([0.4, -0.2, 1.3], [1, 2, 3], "base", "tool0").matrix, 3)
    with pytest.raises(InputError, match="orthonormal"):
        RigidTransform(printed, "base", "tool0")


@given(st.lists(st.floats(-1, 1), min_size=9, max_size=9))
def test_the_nearest_rotation_is_a_rotation_and_none_is_nearer(numbers: list[float]) -> None:
    matrix = np.array(numbers).reshape(3, 3) + 2 * np.eye(3)
    best = nearest_rotation(matrix)
    np.testing.assert_allclose(best @ best.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(best) == pytest.approx(1)
    for vector in (0.05 * np.eye(3)).tolist() + (-0.05 * np.eye(3)).tolist():
        other = best @ rotation_from_vector(vector)
        assert np.linalg.norm(matrix - best) <= np.linalg.norm(matrix - other) + 1e-12


def test_long_products_stay_rotations() -> None:
    step = RigidTransform.of([0.3, -0.5, 0.7], [10, -20, 30], "base", "base")
    total = RigidTransform.identity("base", "base")
    for _ in range(5000):
        total = step @ total
    assert np.abs(total.rotation @ total.rotation.T - np.eye(3)).max() < 1e-11


GOOD = RigidTransform.of([0.3, -0.2, 0.5], [100, 200, 300], "base", "tool0").matrix


def broken(change: str) -> np.ndarray:
    matrix = GOOD.copy()
    if change == "nan":
        matrix[1, 3] = np.nan
    elif change == "infinite":
        matrix[0, 0] = np.inf
    elif change == "mirrored":
        matrix[:, 0] *= -1
    elif change == "scaled":
        matrix[:3, :3] *= 1.01
    elif change == "sheared":
        matrix[0, 1] += 0.02
    elif change == "by columns":
        matrix = matrix.T
    elif change == "three rows":
        matrix = matrix[:3]
    elif change == "zeros":
        matrix = np.zeros((4, 4))
    return matrix


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("nan", "NaN or infinity"),
        ("infinite", "NaN or infinity"),
        ("mirrored", "mirrored"),
        ("scaled", "nothing was scaled"),
        ("sheared", "orthonormal"),
        ("by columns", "transpose it"),
        ("three rows", "16 numbers, row by row"),
        ("zeros", "orthonormal"),
    ],
)
@pytest.mark.parametrize("maker", [RigidTransform, RigidTransform.from_rounded])
def test_what_is_no_rigid_transform_is_refused_with_the_reason(maker, change: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        maker(broken(change), "base", "tool0")
    assert caught.value.to_do.endswith(".")


def test_an_unknown_frame_is_refused_and_all_are_listed() -> None:
    with pytest.raises(InputError, match="turntable") as caught:
        RigidTransform(np.eye(4), "base", "flange")  # pyright: ignore[reportArgumentType]
    assert all(name in str(caught.value) for name in FRAMES)
    assert "'flange'" in str(caught.value)


def test_a_transform_cannot_be_changed_afterwards_nor_through_its_source() -> None:
    source = GOOD.copy()
    transform = RigidTransform(source, "base", "tool0")
    source[0, 3] = -1
    assert transform.translation_mm[0] == 100
    with pytest.raises(ValueError, match="read-only"):
        transform.matrix[0, 3] = 5.0
    with pytest.raises(ValueError, match="read-only"):
        transform.translation_mm[0] = 5.0


def test_rows_and_stacks_hold_the_same_numbers() -> None:
    transform = RigidTransform(GOOD, "base", "tool0")
    assert transform.to_rows() == GOOD.tolist()
    assert stack_matrices([transform, transform]).shape == (2, 4, 4)
    assert stack_matrices([]).shape == (0, 4, 4)
