"""Cells whose only balls ride on axes: scanners and axes are found together, and used as any other answer."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.exports.export import export
from calib_core.guidance.part_budget import budget_at
from calib_core.library.opened import OpenSession, Results, in_memory
from calib_core.records import Session
from calib_core.simulation import TOPOLOGY_SCENARIOS, TopologyScenario
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.evidence import text_of
from calib_core.stages.guide import guide
from calib_core.stages.recheck.guide import recheck_plan
from tests.topology_errors import distances
from tests.topology_use import merge_of_patches

CHI2 = {2: 18.4, 6: 27.9}  # 99.99 %


def riding(name: str, **more: Any) -> TopologyScenario:
    made = TOPOLOGY_SCENARIOS[name]
    balls = tuple(ball for ball in made.balls if ball.on not in ("base", "tool0"))
    return replace(made, balls=balls, **more)


ON_TABLE = riding("gantry-turntable", on_axes=8)
ARM = replace(ON_TABLE, machine="arm", cell=TOPOLOGY_SCENARIOS["positioner"].cell)
Solved = tuple[OpenSession, Results, dict[str, Any], Mapping[str, bytes]]


@pytest.fixture(scope="module")
def solved() -> Solved:
    session, files, truth = simulate_topology(ARM, "", 1)
    opened = in_memory(session, files)
    return opened, opened.run(), truth, files


def all_within(result: Any, truth: dict[str, Any]) -> list[str]:
    found = list(distances(result, truth))
    for name, squared, freedom, _ in found:
        assert squared < CHI2[freedom], name
    return [name for name, *_ in found]


def test_scanner_and_table_are_found_together_where_no_ball_stood_still(solved: Solved) -> None:
    session, results, truth, _ = solved
    assert list(results) == ["turntable", "chain"]
    chain = results["chain"]
    assert chain.verdict == "pass"
    assert [(row.capture, row.used) for row in chain.residuals] == [(c.id, True) for c in session.record.captures]
    assert all_within(chain, truth) == ["tool0_from_laser", "table"]
    off = np.array(chain.sphere_center_in_base_mm) - truth["spheres"][0]["center_mm"]  # with the table at zero
    assert off @ np.linalg.solve(np.array(chain.sphere_center_covariance), off) < 21.1
    assert "the robot stands" not in text_of(chain)


def test_such_an_answer_is_checked_guided_exported_budgeted_and_merged(solved: Solved) -> None:
    session, results, _, files = solved
    assert not [one for one in session.check() if one.severity == "error"]
    data = {stage: one.to_json() for stage, one in results.items()}
    for known, step in (({}, "turntable"), (data, "scan")):
        told = guide(session.record, [], known)
        assert told.current.step == step
        (tcp,) = (one for one in told.steps if one.step == "tcp")
        assert (tcp.status, "spheres on axes" in (tcp.note or "")) == ("not-needed", True)
    assert b"base_from_turntable" in export(session.record, results, "json")[0]
    assert budget_at(session.record, data).uncertainty_mm < 0.5
    assert merge_of_patches(session.record, files, results).points > 0
    with pytest.raises(cc.CalibrationError, match="drift"):
        recheck_plan(session.record, data)


def test_a_table_that_was_seen_from_one_pose_asks_for_a_ball_that_stands_still(solved: Solved) -> None:
    session, _, _, files = solved
    pose = session.record.captures[0].pose
    captures = [one.model_copy(update={"pose": pose}) for one in session.record.captures]
    same = Session.model_validate({**session.record.to_json(), "captures": [one.to_json() for one in captures]})
    opened = in_memory(same, files)
    assert "no-tcp-captures" in {one.code for one in opened.check()}
    with pytest.raises(cc.CalibrationError, match="from one and the same pose"):
        opened.run("turntable")


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("name", ["slide", "tilt", "positioner", "two-tables", "rail-positioner"])
def test_axes_of_any_kind_tell_where_the_scanner_is(name: str) -> None:
    session, files, truth = simulate_topology(riding(name), "", 1)
    chain = in_memory(session, files).run()["chain"]
    assert chain.verdict == "pass"
    assert len(all_within(chain, truth)) == 1 + len(chain.axes)


@pytest.mark.thorough
def test_a_gantry_before_a_table_leaves_open_what_no_turn_tells() -> None:
    session, files, _ = simulate_topology(ON_TABLE, "", 1)
    chain = in_memory(session, files).run()["chain"]
    assert chain.verdict == "pass"
    assert chain.up_to_shift is not None
    assert np.isnan(np.array(chain.tool0_from_laser, dtype=float)[:3, 3]).all()
    assert np.isfinite(np.array(chain.tool0_from_laser, dtype=float)[:3, :3]).all()
    assert merge_of_patches(session, files, {"chain": chain}).points > 0
