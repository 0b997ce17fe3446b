"""The arm as its errors make it: its URDF goes where poses corrected by the same errors are."""

import numpy as np
import pytest

from calib_core.arms.corrected import corrected_arm
from calib_core.arms.errors import arm_moves, arm_terms, corrected_pose
from calib_core.arms.kinematics import NAMED_ARMS, flange_of_joints
from calib_core.arms.ur_calibration import calibration_frames
from calib_core.arms.urdf import arm_from_urdf
from calib_core.errors import ConflictError
from calib_core.exports.export import export
from calib_core.records import ArmJoint, ArmTable
from tests.arm_cell import simulate_arm
from tests.benchmarks.bench_arm import solved


def some_joints(count: int = 20) -> list[list[float]]:
    return np.random.default_rng(4).uniform(-120, 120, (count, 6)).tolist()


def farthest_mm(arm: ArmTable, table: ArmTable, errors: dict[str, float]) -> float:
    """How far the table's flange is from where the errors move the arm's, at most."""
    terms, names = [term.name for term in arm_terms(arm)], list(errors)
    apart: list[float] = []
    for joints in some_joints():
        at = flange_of_joints(arm, joints, joints)
        moves = arm_moves(arm, [joints])[0][:, [terms.index(name) for name in names]]
        rotation, place = corrected_pose(at.rotation, at.translation_mm, moves, np.array(list(errors.values())))
        found = flange_of_joints(table, joints, joints)
        apart += [float(np.linalg.norm(found.translation_mm - place))]
        apart += [300.0 * float(np.linalg.norm(found.rotation - rotation))]
    return max(apart)


@pytest.mark.parametrize("name", ["ur10e", "irb2600-12/1.65", "kr6-r900-sixx"])
def test_zeros_and_links_stand_in_the_joints_frames(name: str) -> None:
    arm, rng = NAMED_ARMS[name], np.random.default_rng(1)
    terms = [term for term in arm_terms(arm) if term.member in ("offsets", "links")]
    assert farthest_mm(arm, corrected_arm(arm, {})[0], {}) < 1e-6
    for term in terms:  # each alone, so that none hides behind another
        errors = {term.name: 0.05}
        table, left_out = corrected_arm(arm, errors)
        assert farthest_mm(arm, table, errors) < 2e-3, term.name
        assert left_out == ()
    errors = {term.name: float(rng.normal(0, term.sigma)) for term in terms}
    assert farthest_mm(arm, corrected_arm(arm, errors)[0], errors) < 0.02  # errors of errors


@pytest.mark.thorough
def test_the_urdf_of_an_answer_is_the_arm_of_its_errors() -> None:
    cell = simulate_arm("cobot", 3, 30, errors="apply")
    result = solved(cell.session)
    content, _ = export(cell.session, {"tcp": result.to_json()}, "urdf-arm", settings={"flange": "flange"})
    model, arm = result.arm_model, cell.session.cell.robot.arm
    assert model is not None
    assert isinstance(arm, ArmTable)
    errors = dict(zip(model.names, model.values, strict=True))
    beyond = {name for name in errors if "_by_" in name or "_sag_" in name}
    assert all(name in content.decode() for name in beyond)
    read = arm_from_urdf(content, "arm.urdf")
    assert farthest_mm(arm, read, {name: value for name, value in errors.items() if name not in beyond}) < 0.05


def test_a_calibration_of_a_ur_with_its_errors_is_that_arm() -> None:
    rng = np.random.default_rng(7)
    for name in ("ur10e", "ur3e"):
        arm = NAMED_ARMS[name]
        terms = [term for term in arm_terms(arm) if term.member in ("offsets", "links")]
        none, _ = calibration_frames(arm, {})
        assert np.allclose(none[0][:3, 3], [0, 0, arm.joints[0].d_mm], atol=1e-6)
        assert np.allclose(none[2][:3, 3], [arm.joints[1].a_mm, 0, 0], atol=1e-6)
        errors = {term.name: float(rng.normal(0, term.sigma)) for term in terms}
        frames, left_out = calibration_frames(arm, errors)
        joints = [ArmJoint(previous_from_joint=frame.tolist()) for frame in frames]
        assert farthest_mm(arm, ArmTable(joints=joints), errors) < 0.02  # errors of errors
        assert left_out == ()
    with pytest.raises(ConflictError, match="an arm of Universal Robots"):
        calibration_frames(NAMED_ARMS["irb120"], {})


@pytest.mark.thorough
def test_the_calibration_of_an_answer_is_read_as_the_arm_of_its_errors() -> None:
    cell = simulate_arm("cobot", 3, 30, errors="apply")
    result = solved(cell.session)
    content, _ = export(cell.session, {"tcp": result.to_json()}, "ur-calibration")
    model, arm = result.arm_model, cell.session.cell.robot.arm
    assert model is not None
    assert isinstance(arm, ArmTable)
    assert b"the controller does not take it" in content
    errors = dict(zip(model.names, model.values, strict=True))
    within = {name: value for name, value in errors.items() if "_by_" not in name and "_sag_" not in name}
    assert farthest_mm(arm, arm_from_urdf(content, "ur.yaml"), within) < 0.05


def test_an_arm_that_is_not_known_or_whose_joints_move_together_has_none() -> None:
    cell = simulate_arm("cobot", 3, 15)
    with pytest.raises(ConflictError, match="one without them"):
        export(
            cell.session,
            {"tcp": solved(cell.session).model_copy(update={"arm_model": None}).to_json()},
            "urdf-arm",
        )
    arm = NAMED_ARMS["kr6-r900-sixx"].model_copy(update={"couples": {2: 1}})
    with pytest.raises(ConflictError, match="moves along with another"):
        corrected_arm(arm, {})
