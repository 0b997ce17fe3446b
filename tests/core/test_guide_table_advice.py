"""The turntable's next angle and height, and the verification's poses: by the covariance that the solve states."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.errors import ConflictError
from calib_core.frames import RigidTransform, rotation_from_vector
from calib_core.guidance.budget import together
from calib_core.guidance.calibrated import Calibrated, View
from calib_core.guidance.candidates import AWAY_DEG, AWAY_MM
from calib_core.guidance.cell_plan import CellToPlan, plan_cell
from calib_core.guidance.interim_estimate import table_so_far
from calib_core.guidance.pose_list import planned_poses
from calib_core.guidance.table_advice import TableSituation, advice_in, table_situation
from calib_core.guidance.table_design import TableDesign
from calib_core.records import Measured, Session
from calib_core.robots import parse_pose
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.guide import guide

Results = tuple[Session, dict[str, dict[str, Any]]]


@pytest.fixture(scope="module")
def cell() -> SimulatedSession:
    return simulate("turntable", 3)


@pytest.fixture(scope="module")
def measured(cell: SimulatedSession) -> list[Measured]:
    return [measure_capture(cell.session, c, cell.files.__getitem__) for c in cell.session.captures]


@pytest.fixture
def solved(turntable_results: Results) -> dict[str, Any]:
    return turntable_results[1]


def after(cell: SimulatedSession, turning: int, **fields: Any) -> Session:
    """The session with so many captures of the table."""
    told = cell.session.cell.model_copy(update=fields)
    return cell.session.model_copy(update={"cell": told, "captures": cell.session.captures[: 14 + turning]})


def situation(session: Session, measured: list[Measured], results: dict[str, Any]) -> TableSituation:
    found = table_situation(session, measured, results)
    assert found is not None
    return found


def test_what_is_predicted_on_the_table_is_what_the_chain_states(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    now = situation(after(cell, 16), measured, solved)
    known = Calibrated.of(solved["chain"])
    mounts = [mount["center_in_turntable_mm"] for mount in solved["chain"]["mounts"]]
    point = np.mean(mounts, axis=0)
    now = replace(now, points=point[None])
    design = TableDesign(now.still.taken, now.taken, now.still.assumed, now.table, now.points)
    rotations = [o.base_from_tool0.rotation for o in now.still.taken]
    views = [View(rotation, angle) for rotation in rotations for angle in np.deg2rad([0, 90, 180, 270])]
    stated = np.mean([together(known, view, point) for view in views], axis=0)
    promised = design.sigma_mm(range(16))
    assert promised / np.sqrt(np.linalg.eigvalsh(stated)[-1]) == pytest.approx(1.0, abs=0.15)
    # Every capture on the table takes something off it.
    each = [design.sigma_mm(range(n)) for n in (3, 6, 9, 12, 16)]
    assert each == sorted(each, reverse=True)


def test_the_next_angle_lies_where_none_was_and_gains_most(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    now = situation(after(cell, 3), measured, {"tcp": solved["tcp"]})  # 0, 45 and 90 degrees
    found = advice_in(now, 0.3)
    assert found.next is not None
    assert 135 <= found.next.table_deg <= 315
    assert found.meter.after_next_mm is not None
    assert found.meter.uncertainty_mm is not None
    assert found.meter.after_next_mm < 0.8 * found.meter.uncertainty_mm
    # The scanner is sent to where the sphere truly will be.
    table = cell.table
    assert table is not None
    spun = rotation_from_vector(np.array([0.0, 0.0, np.deg2rad(table.options.direction * found.next.table_deg)]))
    there = np.append(spun @ table.mounts_mm[0], 1.0)
    np.testing.assert_allclose(found.next.center_in_base_mm, (table.base_from_turntable @ there)[:3], atol=1.5)


def test_another_height_is_asked_for_where_it_tells_more(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    tall = after(cell, 8, workpiece_in_turntable_mm=[80.0, 0.0, 250.0])
    found = advice_in(situation(tall, measured, {"tcp": solved["tcp"]}), 0.05)
    assert found.next is not None
    assert found.next.higher_mm == pytest.approx(100.0)
    assert not advice_in(situation(after(cell, 16), measured, solved), 5.0).next  # enough


def test_the_guide_goes_by_the_wanted_figure(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    results = {"tcp": solved["tcp"]}
    now = guide(after(cell, 3, wanted_mm=0.55), measured, results).current
    assert now.step == "turntable"
    assert now.meter is not None
    assert now.suggested_table_deg is not None
    assert f"about {now.suggested_table_deg:.0f}°" in now.instruction
    assert now.suggested_pose_numbers is not None
    reached = guide(after(cell, 16, wanted_mm=2.0), measured, results).current
    assert reached.action == "solve"
    assert str(reached.progress).startswith("enough: ± 0.")


def test_a_planned_set_for_the_table(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    plan = planned_poses(after(cell, 3), measured, {"tcp": solved["tcp"]}, 4, "turntable")
    assert [pose.table_deg is not None and pose.mount is not None for pose in plan.poses] == [True] * 4
    assert plan.poses[0].approach_numbers is not None
    figures = [pose.uncertainty_mm for pose in plan.poses]
    assert figures[-1] < figures[0]  # type: ignore[operator]
    with pytest.raises(ConflictError, match="three captures"):
        planned_poses(after(cell, 1), measured, {"tcp": solved["tcp"]}, 4, "turntable")


def test_a_verification_keeps_away_from_the_calibration(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    session = after(cell, 0)
    plan = planned_poses(session, measured, {"tcp": solved["tcp"]}, 5, "verify")
    convention = session.cell.pose_convention
    used = [parse_pose(convention, c.pose or []) for c in session.captures]
    for planned in plan.poses:
        pose = parse_pose(convention, planned.numbers)
        for other in used:
            apart: RigidTransform = other.inverse() @ pose
            turned = np.rad2deg(np.linalg.norm(apart.rotation_vector_rad))
            assert np.linalg.norm(pose.translation_mm - other.translation_mm) >= AWAY_MM - 1e-6 or (
                turned >= AWAY_DEG - 1e-6
            )
    # Limits that were set ask for it, with a pose.
    alone = session.model_dump(mode="json", exclude_unset=True)
    alone["cell"].pop("turntable", None)
    alone["cell"]["verification"] = {"tool_mm": 0.5}
    limited = Session.model_validate(alone)
    now = guide(limited, measured, {"tcp": {**solved["tcp"], "stale": False}}).current
    assert (now.step, now.action) == ("verify", "capture")
    assert now.suggested_pose_numbers is not None


@pytest.mark.thorough
def test_a_plan_says_where_the_sphere_goes_on_a_table() -> None:
    told = {"near_mm": 130, "far_mm": 230, "near_width_mm": 60}
    table = {"radius_mm": 120, "height_mm": 200, "most_angles": 6}
    fields = {"scanner": told, "sphere_diameter_mm": 40, "table": table, "most_captures": 10}
    plan = plan_cell(CellToPlan.model_validate(fields | {"wanted_mm": 0.3}))
    assert plan.table is not None
    chosen = plan.table.layout
    assert plan.reachable is True
    assert chosen.uncertainty_mm <= 0.3
    cheaper = [one for one in plan.table.layouts if one.captures < chosen.captures]
    assert all(one.uncertainty_mm > 0.3 for one in cheaper)
    # For a tall part a second height is worth more than as many angles at the first.
    by = {(one.radius_mm, len(one.heights_mm), one.angles): one.uncertainty_mm for one in plan.table.layouts}
    assert by[60, 2, 4] < by[60, 1, 6]
    never = plan_cell(CellToPlan.model_validate(fields | {"wanted_mm": 0.01}))
    assert never.reachable is False
    assert "out of reach" in never.table.sentence  # type: ignore[union-attr]


def test_the_axis_is_known_better_after_each_capture_and_as_well_as_is_said(
    cell: SimulatedSession, measured: list[Measured], solved: dict[str, Any]
) -> None:
    tool = {"tcp": solved["tcp"]}
    assert table_so_far(after(cell, 2), measured, tool) is None  # two captures tell no axis
    found = [table_so_far(after(cell, turning), measured, tool) for turning in (4, 8, 16)]
    spread = [np.sqrt(np.trace(one.covariance[3:, 3:])) for one in found if one is not None]
    assert len(spread) == 3
    assert spread == sorted(spread, reverse=True)
    last, table = found[-1], cell.table
    assert last is not None
    assert table is not None
    truth = RigidTransform.from_rounded(table.base_from_turntable, "base", "turntable")
    off = truth.difference(last.base_from_turntable)
    sigmas = np.sqrt(np.diag(last.covariance))
    assert np.all(np.abs(off) < 4 * sigmas)
    stated = np.sqrt(np.diag(np.array(solved["chain"]["turntable_covariance"])))
    np.testing.assert_allclose(sigmas, stated, rtol=0.35)
