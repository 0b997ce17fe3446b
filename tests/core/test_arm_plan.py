"""From how many captures on an arm's own errors are worth solving, and whether it still is the arm."""

import numpy as np
import pytest

from calib_core.arms.corrected import corrected_arm
from calib_core.arms.errors import arm_terms, reach_of
from calib_core.arms.inverse import joints_of_poses
from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.errors import InputError
from calib_core.frames import FloatArray
from calib_core.guidance.arm_plan import _home, arm_worth
from calib_core.guidance.cell_plan import CellToPlan, plan_cell
from calib_core.records import ArmJoint, ArmTable
from calib_core.records.planning import FieldOfView
from calib_core.review.arm_changes import zero_changes
from calib_core.review.between_sessions import SolvedSession
from calib_core.review.drift import cell_drift
from server.cli import main
from tests.arm_cell import simulate_arm
from tests.benchmarks.bench_arm import solved

FIELD = FieldOfView(near_mm=130, far_mm=250, near_width_mm=80)


@pytest.mark.parametrize("name", ["irb120", "ur10e", "kr16-2", "m-20ia"])
def test_more_captures_make_the_arm_better_and_more_lean_does(name: str) -> None:
    worth = arm_worth(NAMED_ARMS[name], 0.03)
    assert all(one.worth_it and one.with_mm < one.without_mm for one in worth)
    assert worth[-1].with_mm < 0.85 * worth[0].with_mm
    assert 0.3 < worth[-1].without_mm < 1.6  # what trackers publish, after base and tool are fitted
    little = arm_worth(NAMED_ARMS[name], 0.03, tilt_deg=6.0)
    assert little[-1].with_mm > worth[-1].with_mm
    assert not any(one.worth_it for one in arm_worth(NAMED_ARMS[name], 8.0))  # an arm that never comes back


@pytest.mark.parametrize("name", ["irb120", "ur10e", "kr16-2", "m-20ia"])
def test_the_arm_is_tried_where_it_holds_the_flange_downwards_in_front_of_it(name: str) -> None:
    arm = NAMED_ARMS[name]
    flange = flange_of_joints(arm, _home(arm, np.random.default_rng(1)))
    assert flange.rotation[2, 2] < -0.7
    assert 0.3 < np.hypot(*flange.translation_mm[:2]) / reach_of(arm) < 0.75


def test_what_is_promised_without_the_errors_is_what_arms_that_are_off_do() -> None:
    """Arms drawn with such errors, by their own forward kinematics: tool fitted to a ball, points elsewhere."""
    arm, rng = NAMED_ARMS["irb120"], np.random.default_rng(5)
    terms = [term for term in arm_terms(arm) if term.member in ("offsets", "links")]
    home, off = np.array([10.0, 30.0, 10.0, 20.0, 50.0, 30.0]), []
    joints = home + rng.uniform(-1, 1, (80, 6)) * [50, 30, 30, 60, 40, 60]
    for _ in range(12):
        errors = {term.name: float(rng.normal(0, term.sigma)) for term in terms}
        table = corrected_arm(arm, errors)[0]
        pairs = [[flange_of_joints(one, row).translation_mm for row in joints.tolist()] for one in (arm, table)]
        off.append(_after_base(*map(np.array, pairs)))
    found = arm_worth(arm, 0.03)[-1].without_mm
    assert 0.4 < found / float(np.sqrt(np.mean(np.square(off)))) < 2.5


def _after_base(nominal: FloatArray, true: FloatArray) -> float:
    a, b = nominal - nominal.mean(axis=0), true - true.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    return float(np.sqrt(np.mean(np.sum((a @ u @ vt - b) ** 2, axis=1))))


def test_many_poses_are_solved_at_once() -> None:
    for name in ("irb120", "gp8", "lrmate-200id"):
        rng = np.random.default_rng(1)
        joints = np.array([10.0, 20.0, -20.0, 40.0, 60.0, 60.0]) + rng.uniform(-30, 30, (40, 6))
        poses = [flange_of_joints(NAMED_ARMS[name], row) for row in joints.tolist()]
        rotations, translations = (
            np.array([p.rotation for p in poses]),
            np.array([p.translation_mm for p in poses]),
        )
        near = joints + rng.uniform(-3, 3, joints.shape)
        found, reached = joints_of_poses(NAMED_ARMS[name], rotations, translations, near)
        assert reached.all()
        assert np.abs(found - joints).max() < 1e-3
        _, reached = joints_of_poses(NAMED_ARMS[name], rotations, translations + 9000.0, near)
        assert not reached.any()


@pytest.mark.thorough
def test_a_plan_says_from_how_many_captures_on_the_arm_is_worth_it(capsys: pytest.CaptureFixture[str]) -> None:
    plan = plan_cell(CellToPlan(scanner=FIELD, sphere_diameter_mm=30, arm_name="irb120", most_captures=5))
    assert [one.captures for one in plan.arm_errors] == [8, 12, 15, 20, 30, 45, 60]
    assert "worth solving from 8 captures on" in plan.arm_sentence
    measured = CellToPlan(
        scanner=FIELD, sphere_diameter_mm=30, arm="calibrated", arm_name="irb120", most_captures=5
    )
    assert plan_cell(measured).arm_errors == []
    field = ["--near-mm", "130", "--far-mm", "250", "--near-width-mm", "80", "--sphere-mm", "30"]
    assert main(["plan", *field, "--arm-name", "kr16-2"]) == 0
    assert "worth solving from" in capsys.readouterr().out
    assert main(["plan", *field, "--arm-name", "kr99"]) == 2
    gantry = ArmTable(joints=[ArmJoint(kind="prismatic")] * 3)
    with pytest.raises(InputError, match="six turning joints"):
        arm_worth(gantry, 0.03)


@pytest.mark.thorough
def test_a_joint_that_was_bumped_is_named_by_a_later_session_of_other_poses() -> None:
    first, same, bumped = (
        solved(simulate_arm("small", 1, 30, errors="apply", held=0, bumped_deg=by).session).to_json()
        for by in (None, [0.0] * 6, [0.0, 0.0, 0.0, 0.0, 0.15, 0.0])
    )
    nights = [("1", first), ("2", same), ("3", bumped)]
    drift = cell_drift([SolvedSession(session=n, name=n, date=n, results={"tcp": one}) for n, one in nights])
    zeros = {one.title: one.points for one in drift.series if one.figure == "arm-zero"}
    assert list(zeros) == [f"Zero of joint {n}" for n in (2, 3, 4, 5)]
    assert [[point.flagged for point in points] for points in zeros.values()] == [
        [False] * 3, [False] * 3, [False] * 3, [False, False, True],
    ]  # fmt: skip
    change = zeros["Zero of joint 5"][-1]
    assert abs(change.change - 0.15) < change.uncertainty < 0.05
    assert any(flag.startswith("Zero of joint 5 changed by") for flag in drift.flags)
    before = [{**one, "arm_model": {**one["arm_model"], "told": None}} for one in (first, bumped)]
    assert zero_changes(before, 4e-4) == {}  # results of before are held against each other by their ± alone


@pytest.mark.thorough
def test_two_joints_that_moved_are_named_and_a_third_session_is_held_against_the_second() -> None:
    bumps = (None, [0.0, 0.2, 0.0, -0.2, 0.0, 0.0], [0.0, 0.2, 0.0, -0.2, 0.0, 0.0])
    cells = [simulate_arm("medium", 3, 30, errors="apply", held=0, bumped_deg=by) for by in bumps]
    found = zero_changes([solved(one.session).to_json() for one in cells], 4e-4)
    assert {number: [one.moved for one in rows] for number, rows in found.items()} == {
        2: [False, True, False], 3: [False] * 3, 4: [False, True, False], 5: [False] * 3,
    }  # fmt: skip
    assert [found[number][1].change_deg for number in (2, 4)] == pytest.approx([0.2, 0.2], abs=0.03)
