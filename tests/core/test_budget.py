"""The error budget at the workpiece: what is stated of measured points holds, and its parts are told apart."""

import numpy as np
import pytest

from calib_core.archive.folder import result_data
from calib_core.errors import ConflictError, InputError
from calib_core.exports.workpiece import at_workpiece
from calib_core.guidance.budget import BudgetPart, budget, covariances, stated, together, within_95
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.cell_plan import CellToPlan, plan_cell
from calib_core.guidance.part_budget import BudgetAtPart, budget_at
from calib_core.records.planning import FieldOfView
from calib_core.records.policy import Environment
from calib_core.robots import parse_pose
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage
from tests.benchmarks.bench_budget import as_believed, one

FIELD = FieldOfView(near_mm=130, far_mm=230, near_width_mm=60, far_width_mm=90)


@pytest.fixture(scope="module")
def solved():
    made = simulate("turntable", 2)
    return made.session, result_data(solve_stage(made.session, "chain", made.files.__getitem__))


@pytest.mark.thorough
def test_measured_points_lie_off_by_what_is_stated() -> None:
    found = [one(seed) for seed in range(2)]
    errors = np.concatenate([points.errors_mm for points in found])
    variances = np.diagonal(np.concatenate([points.covariances for points in found]), axis1=1, axis2=2)
    assert 0.4 < np.mean(errors**2 / variances) < 2.0  # two cells: their shared errors are few
    assert np.mean(np.abs(errors) <= 1.96 * np.sqrt(variances)) > 0.85


@pytest.mark.thorough
def test_cells_that_err_as_believed_err_as_stated() -> None:
    found = [as_believed(seed) for seed in (1, 2)]
    errors = np.concatenate([points.errors_mm for points in found])
    variances = np.diagonal(np.concatenate([points.covariances for points in found]), axis1=1, axis2=2)
    assert 0.2 < np.mean(errors**2 / variances) < 2.5  # two cells: their shared errors are few
    half = np.concatenate([points.within_mm for points in found])
    assert (half < 1.961 * np.sqrt(variances)).all()  # what is known to be off is not taken for chance
    assert np.mean(np.abs(errors) <= half) > 0.8


@pytest.mark.thorough
def test_the_scanners_errors_cancel_between_tool_and_point(solved) -> None:
    _, result = solved
    known = Calibrated.of(result)
    view = View(np.eye(3), 0.3)
    place = np.array([40.0, -20.0, 80.0])
    parts = covariances(known, view, place)
    apart = parts["tool"] + parts["table"] + parts["scanner"]
    assert np.trace(together(known, view, place)) < np.trace(apart)
    whole = stated(known, view, place)
    assert np.linalg.eigvalsh(whole)[0] > 0
    assert np.trace(whole) > np.trace(together(known, view, place))


def test_both_counts_what_the_scanner_did_to_tool_and_table(solved) -> None:
    session, result = solved
    both = [row for row in at_workpiece(session, result) if row.of == "both"]
    older = {**result, "scanner": {**result["scanner"], "covariance_with_table": None}}
    without = [row for row in at_workpiece(session, older) if row.of == "both"]
    assert len(both) == len(without) == 2
    for new, old in zip(both, without, strict=True):
        assert new.worst_sigma_mm != pytest.approx(old.worst_sigma_mm, rel=1e-3)
        # What is unknown of the arm's lengths and the scanner's scale is in the tool, and back out at the point.
        assert new.worst_sigma_mm < 1.1 * old.worst_sigma_mm


def test_the_arms_shared_errors_cancel_between_calibration_and_point(solved) -> None:
    session, result = solved
    known = Calibrated.of(result)
    pose = parse_pose(session.cell.pose_convention, session.captures[-1].pose or [])
    view, place = View(pose.rotation, 0.3), np.array([40.0, -20.0, 80.0])
    older = Calibrated.of({**result, "arm_errors": None})  # as results were before they told it
    both, apart = stated(known, view, place), stated(older, view, place)
    assert np.trace(both) < 0.9 * np.trace(apart)
    assert np.linalg.eigvalsh(both)[0] > 0
    # An arm that stands quite elsewhere errs there by something else: nothing cancels but its lengths.
    away = view.places(known, place[None])[0] + [5e3, 0.0, 0.0]
    assert known.arm is not None
    together = known.arm.with_answer(view.rotation, away[None], np.zeros(3))[0]
    assert together == pytest.approx(np.outer(known.arm.with_lengths, away - known.arm.middle_mm))


def test_an_offset_that_is_known_makes_the_interval_no_wider_than_it_must_be() -> None:
    covariance = np.diag([1.0, 1.0, 1.0])[None]
    none, some, all_of_it = within_95(np.array([[0.0, 0.8, 1.0]]), covariance)
    assert none == pytest.approx(1.95996, abs=1e-4)
    assert all_of_it == pytest.approx(1.0, abs=2e-3)
    rng = np.random.default_rng(5)
    drawn = np.abs(0.8 + 0.6 * rng.standard_normal(200_000)) <= some
    assert drawn.mean() == pytest.approx(0.95, abs=2e-3)
    spread = within_95(np.array([[0.0] * 3, [0.9] * 3]), np.repeat(covariance, 2, axis=0))
    assert all_of_it < spread[0] < none  # views that see it differently: what holds over all of them


def test_what_stays_in_the_files_is_told_as_an_offset(solved) -> None:
    session, result = solved
    assert result["scanner"]["left_in_files"] is None  # nothing was found of this scanner
    values = [0.0] * len(result["scanner"]["names"])
    values[result["scanner"]["names"].index("scale_z")] = 2e-4
    left = {"tool": [0.0] * 6, "scanner": values, "turntable": [0.0, 0.0, 0.0, 0.0, 0.0, 0.03]}
    known = {**result, "scanner": {**result["scanner"], "left_in_files": left}}
    plain = budget_at(session, {"chain": result}, [30.0, 10.0, 60.0])
    found = budget_at(session, {"chain": known}, [30.0, 10.0, 60.0])
    assert plain.known_offset_mm == [0.0, 0.0, 0.0]
    assert plain.within_95_mm == pytest.approx((1.95996 * np.array(plain.sigmas_mm)).tolist(), rel=0.02)
    # The stripe's z points down, tilted by up to 0.3 rad a component, and the table's origin counts the other way.
    along_z_mm = 2e-4 * result["workpiece"]["point_in_laser_mm"][2]
    assert 0.8 * along_z_mm < -0.03 - found.known_offset_mm[2] < along_z_mm
    assert found.sigmas_mm == plain.sigmas_mm
    assert found.within_95_mm[2] < plain.within_95_mm[2]


def test_a_budget_tells_shared_from_averaging_parts_and_what_helps(solved) -> None:
    session, result = solved
    found = budget_at(session, {"chain": result}, [30.0, 10.0, 60.0], with_field=True)
    assert found.frame == "turntable"
    assert {part.name for part in found.parts} == {
        "tool", "table", "scanner", "arm", "arm_alike", "angle", "points",
    }  # fmt: skip
    assert {part.name for part in found.parts if not part.shared} == {"arm", "angle", "points"}
    assert found.shared_uncertainty_mm < found.uncertainty_mm
    assert found.helps_most.startswith("What would help most")
    assert found.field is not None
    for point in found.field[::29]:  # all at once are what each is alone
        alone = budget_at(session, {"chain": result}, point.point_mm)
        assert point.uncertainty_mm == pytest.approx(alone.uncertainty_mm, rel=1e-9)
        assert point.shared_uncertainty_mm == pytest.approx(alone.shared_uncertainty_mm, rel=1e-9)
    middle = min(found.field, key=lambda point: np.hypot(*point.point_mm[:2]))
    edge = max(found.field, key=lambda point: np.hypot(*point.point_mm[:2]))
    assert middle.uncertainty_mm > 0
    assert edge.uncertainty_mm > 0.9 * middle.uncertainty_mm


def test_the_arm_s_temperature_is_a_part_of_the_budget_where_it_is_told(solved) -> None:
    """Aluminium: 23 µm a metre and kelvin; the flange of this cell stands about a metre from its base."""
    session, result = solved
    plain = budget_at(session, {"chain": result}, [30.0, 10.0, 60.0])

    def told(**temperatures: float) -> BudgetAtPart:
        warm = session.model_copy(update={"environment": Environment(**temperatures)})
        return budget_at(warm, {"chain": result}, [30.0, 10.0, 60.0], with_field=True)

    def part(found: BudgetAtPart) -> BudgetPart:
        return next(one for one in found.parts if one.name == "temperature")

    by_arm, by_air = told(arm_c=27.0, air_c=22.0), told(air_c=22.0)
    assert 0.5 * 23e-3 * 0.5 < part(by_arm).worst_sigma_mm < 1.5 * 23e-3 * 0.5
    assert part(by_air).worst_sigma_mm == pytest.approx(4 * part(by_arm).worst_sigma_mm)
    assert part(by_arm).shared
    assert plain.uncertainty_mm < by_arm.uncertainty_mm < by_air.uncertainty_mm
    assert told(ball_c=22.0).uncertainty_mm == plain.uncertainty_mm
    assert by_air.cancelled_mm == pytest.approx(plain.cancelled_mm)
    assert by_air.field is not None
    for point in by_air.field[::29]:
        alone = budget_at(
            session.model_copy(update={"environment": Environment(air_c=22.0)}), {"chain": result}, point.point_mm
        )
        assert point.shared_uncertainty_mm == pytest.approx(alone.shared_uncertainty_mm, rel=1e-9)


def test_without_a_table_the_budget_is_the_tools(solved) -> None:
    session, result = solved
    alone = {k: v for k, v in result.items() if k != "base_from_turntable"} | {"stage": "tcp"}
    found = budget_at(session, {"tcp": alone})
    assert found.frame == "laser"
    assert "table" not in {part.name for part in found.parts}
    with pytest.raises(ConflictError, match="Solve the session"):
        budget_at(session, {})
    with pytest.raises(InputError, match="workpiece"):
        Calibrated.of({**alone, "workpiece": None})


def test_many_views_are_averaged(solved) -> None:
    _, result = solved
    known = Calibrated.of(result)
    views = [View(np.eye(3), angle) for angle in (0.0, 2.0, 4.0)]
    mean = np.mean([budget(known, [view], [50.0, 0.0, 50.0]).sigmas_mm[2] ** 2 for view in views])
    assert budget(known, views, [50.0, 0.0, 50.0]).sigmas_mm[2] ** 2 == pytest.approx(mean)


def test_a_plan_says_what_is_reachable_and_what_limits() -> None:
    plan = plan_cell(CellToPlan(scanner=FIELD, sphere_diameter_mm=30, wanted_mm=0.3, most_captures=15))
    assert plan.reachable
    assert plan.sphere.captures is not None
    assert plan.sphere.captures <= 15
    assert plan.sphere.after_mm[plan.sphere.captures - 1] <= 0.3
    assert "30 mm" in plan.sentence
    worse = plan_cell(
        CellToPlan(scanner=FIELD, sphere_diameter_mm=30, wanted_mm=0.05, arm="nominal", most_captures=15)
    )
    assert worse.reachable is False
    assert worse.sphere.uncertainty_mm > plan.sphere.uncertainty_mm
    assert "kinematics" in worse.limited_by
    with pytest.raises(InputError, match="larger field"):
        plan_cell(CellToPlan(scanner=FieldOfView(near_mm=130, far_mm=131, near_width_mm=4)))


@pytest.mark.parametrize("wanted_mm", [0.05, 0.5])
def test_the_sphere_that_is_proposed_needs_the_fewest_captures_or_errs_least(wanted_mm: float) -> None:
    plan = plan_cell(CellToPlan(scanner=FIELD, wanted_mm=wanted_mm, most_captures=12))
    counts = [one.captures for one in plan.spheres if one.captures is not None]
    assert plan.reachable == bool(counts)
    assert plan.sphere.captures == min(counts, default=None)
    least_mm = min(one.uncertainty_mm for one in plan.spheres)
    assert counts or plan.sphere.uncertainty_mm <= 1.02 * least_mm  # so near to each other they are alike
    alike = [one.diameter_mm for one in plan.spheres if one.captures in counts and one.captures == min(counts)]
    assert not counts or plan.sphere.diameter_mm == min(alike)


@pytest.mark.thorough
def test_sweeps_have_a_budget_too() -> None:
    made = simulate("tcp-sweep", 1)
    result = result_data(solve_stage(made.session, "tcp", made.files.__getitem__))
    found = budget_at(made.session, {"tcp": result})
    assert 0 < found.shared_uncertainty_mm < found.uncertainty_mm < 5
