"""Pose conventions: published examples, round trips, gimbal lock, and what is refused."""

import json
import math
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import InputError
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.records import PoseConvention
from calib_core.robots import CONVENTIONS, parse_pose, to_pose

GOLDEN = json.loads((Path(__file__).parents[1] / "golden" / "robot_poses.json").read_text(encoding="utf-8"))
EULER = [name for name, c in CONVENTIONS.items() if c.form in ("ZYX", "XYZ", "ZYZ")]

angle = st.floats(-math.pi, math.pi)
position = st.floats(-5000, 5000)


def test_the_page_on_conventions_has_every_name_formula_unit_and_source() -> None:
    page = (Path(__file__).parents[2] / "docs" / "pose-conventions.md").read_text(encoding="utf-8")
    for c in CONVENTIONS.values():
        assert f"| `{c.name}` | {c.numbers} | {c.units} | {c.formula} | {c.brands} | {c.source} |" in page


def test_the_contracts_conventions_are_all_here() -> None:
    assert set(CONVENTIONS) == set(get_args(PoseConvention))
    assert {c["convention"] for c in GOLDEN} == set(CONVENTIONS)


@pytest.mark.parametrize("case", GOLDEN, ids=lambda c: f"{c['convention']}: {c['source'][:40]}")
def test_published_examples(case: dict[str, Any]) -> None:
    pose = parse_pose(case["convention"], case["numbers"])
    assert (pose.into, pose.outof) == ("base", "tool0")
    # Published quaternions have six digits.
    np.testing.assert_allclose(
        pose.rotation, case["rotation"], atol=2e-6 if case["convention"] == "abb" else 1e-11
    )
    np.testing.assert_allclose(pose.translation_mm, case["position_mm"], atol=1e-9)


@pytest.mark.parametrize("name", CONVENTIONS)
@settings(deadline=None)
@given(turn=st.tuples(angle, angle, angle), place=st.tuples(position, position, position))
def test_any_pose_survives_the_round_trip(
    name: str, turn: tuple[float, float, float], place: tuple[float, float, float]
) -> None:
    pose = RigidTransform.of(rotation_from_vector(turn), place, "base", "tool0")
    numbers = to_pose(name, pose)
    assert len(numbers) == CONVENTIONS[name].count
    again = parse_pose(name, numbers)
    np.testing.assert_allclose(again.matrix, pose.matrix, atol=1e-9, rtol=0)
    np.testing.assert_allclose(to_pose(name, again)[:3], numbers[:3], atol=1e-9)


@pytest.mark.parametrize("name", EULER)
@settings(deadline=None)
@given(first=angle, last=angle, middle=st.sampled_from([-90.0, 90.0, 0.0, 180.0]), off=st.floats(-1e-7, 1e-7))
def test_gimbal_lock_survives_the_round_trip(
    name: str, first: float, last: float, middle: float, off: float
) -> None:
    numbers = [0.0, 0.0, 0.0, math.degrees(first), middle + off, math.degrees(last)]
    pose = parse_pose(name, numbers)
    again = parse_pose(name, to_pose(name, pose))
    np.testing.assert_allclose(again.rotation, pose.rotation, atol=1e-9)


@pytest.mark.parametrize("name", EULER)
@settings(deadline=None)
@given(angles=st.tuples(st.floats(-179, 179), st.floats(1, 89), st.floats(-179, 179)))
def test_angles_away_from_lock_come_back_as_they_were(name: str, angles: tuple[float, float, float]) -> None:
    numbers = [1.0, 2.0, 3.0, *angles]
    np.testing.assert_allclose(to_pose(name, parse_pose(name, numbers)), numbers, atol=1e-7)


def test_quaternions_come_back_normalised_with_positive_scalar() -> None:
    numbers = to_pose("abb", parse_pose("abb", [1, 2, 3, -0.7071, 0.0, -0.7071, 0.0]))
    np.testing.assert_allclose(numbers, [1, 2, 3, math.sqrt(0.5), 0, math.sqrt(0.5), 0], atol=1e-12)


def test_metres_become_millimetres_for_ur_and_ros_alone() -> None:
    for name, convention in CONVENTIONS.items():
        pose = RigidTransform.of(np.eye(3), [100.0, 200.0, 300.0], "base", "tool0")
        x = to_pose(name, pose)[3 if name == "matrix" else 0]
        assert x == pytest.approx(0.1 if name in ("ur", "ros") else 100.0)
        assert convention.units.split(",")[0] == ("m" if name in ("ur", "ros") else "mm")


@pytest.mark.parametrize(
    ("convention", "numbers", "sentence"),
    [
        ("fanuc", [1, 2, 3, 4, 5], "need a pose of 6 numbers (x y z W P R), got 5 numbers"),
        ("abb", [1, 2, 3, 0, 0, 0], "need a pose of 7 numbers (x y z q1 q2 q3 q4), got 6 numbers"),
        ("kuka", [1], "got 1 number."),
        ("kuka", [1, 2, math.nan, 4, 5, 6], "got Z = nan"),
        ("ur", [1, 2, 3, math.inf, 5, 6], "got rx = inf"),
        ("kuka", [1, 2, 1e300, 4, 5, 6], "within 10 km of the base, got one 1e+294 km away"),
        ("ur", [1e5, 2, 3, 0, 0, 0], "got one 100 km away"),
        ("matrix", [1, 0, 0, 5, 0, 1, 0, -2e8, 0, 0, 1, 7, 0, 0, 0, 1], "got one 200 km away"),
        ("abb", [1, 2, 3, 0.9, 0.1, 0, 0], "one of length 0.9055"),
        ("ros", [1, 2, 3, 0, 0, 0, 0], "one of length 0"),
        ("matrix", [1, 0, 0, 5, 0, 1, 0, 6, 0, 0, -1, 7, 0, 0, 0, 1], "mirrored"),
        ("matrix", [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1], "transpose"),
        ("fanuk", [1, 2, 3, 4, 5, 6], "matrix, quaternion-xyzw, quaternion-wxyz, abb, kuka, fanuc, ur, staubli"),
    ],
)
def test_what_is_no_pose_is_refused_with_the_reason(convention: str, numbers: list[float], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_pose(convention, numbers, "p05")
    assert sentence in str(caught.value)
    assert "p05" in str(caught.value) or convention == "fanuk"
