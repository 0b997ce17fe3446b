"""Scanners that saw the table alone: placed by the sphere on it, or known to the table and to nothing else."""

import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.exports.answer import answer_of
from calib_core.exports.export import export
from calib_core.frames import RigidTransform
from calib_core.guidance.part_budget import budget_at
from calib_core.library.opened import OpenSession, Results, in_memory
from calib_core.records import Capture
from calib_core.review.answer import answer_record
from calib_core.review.cell_frames import session_frames
from calib_core.simulation import TOPOLOGY_SCENARIOS, TopologyScenario
from calib_core.simulation.topology import BallOptions, ScannerOptions
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.evidence import text_of
from calib_core.stages.guide import guide
from calib_core.stages.recheck.guide import recheck_plan
from tests.topology_errors import distances

CHI2 = {2: 18.4, 6: 27.9}  # 99.99 %


FIXED = TOPOLOGY_SCENARIOS["fixed-scanner-turntable"]
HELD, *MOUNTED = (
    replace(ball, at_mm=(*ball.at_mm[:2], z)) for ball, z in zip(FIXED.balls, (130, 436, 460), strict=True)
)
BESIDE = replace(FIXED, scanners=(ScannerOptions("arm"), ScannerOptions("gate", "base")), told="names")


def seen_by(
    scenario: str | TopologyScenario, keep: Callable[[Capture], bool]
) -> tuple[OpenSession, dict[str, Any]]:
    made = TOPOLOGY_SCENARIOS[scenario] if isinstance(scenario, str) else scenario
    session, files, truth = simulate_topology(made, "", 1)
    kept = [one for one in session.captures if keep(one)]
    return in_memory(session.model_copy(update={"captures": kept}), files), truth


def test_a_scanner_is_placed_by_the_sphere_on_the_table_that_another_saw_too() -> None:
    session, truth = seen_by("two-scanners-turntable", lambda one: one.step != "tcp" or one.scanner == "left")
    results = session.run()
    of_right = {one.id for one in session.record.captures if one.scanner == "right"}
    rows = {row.capture: row for row in results["turntable"].residuals}
    assert not any(rows[name].used for name in of_right)
    assert {rows[name].reason for name in of_right} == {"by 'right', which the stage chain places"}
    chain = results["chain"]
    assert chain.verdict == "pass"
    assert all(row.used for row in chain.residuals)
    found = list(distances(chain, truth))
    assert [name for name, *_ in found] == [
        "tool0_from_laser", "tool0_from_laser", "laser:left_from_laser:right", "table"
    ]  # fmt: skip
    for name, squared, freedom, _ in found:
        assert squared < CHI2[freedom], name


@pytest.mark.parametrize(("mounts", "why"), [(("low", "low"), "one-height"), (("low", "high"), "nothing-common")])
def test_a_scanner_that_the_table_does_not_tell_is_named_and_all_else_solved(
    mounts: tuple[str, str], why: str
) -> None:
    of = dict(zip(("arm", "gate"), mounts, strict=True))

    def keep(one: Capture) -> bool:
        return one.scanner == "arm" if one.step == "tcp" else one.mount == of[one.scanner or ""]

    session, _ = seen_by(replace(BESIDE, balls=(BallOptions(), HELD, *MOUNTED)), keep)
    result = session.run("turntable")["turntable"]
    told = next(one for one in result.findings if one.code == "scanner-not-placed")
    assert (told.severity, told.values["scanner"], told.values["why"]) == ("warning", "gate", why)
    assert {row.used for row in result.residuals if row.capture in told.captures} == {False}
    assert all(row.used for row in result.residuals if row.capture not in told.captures)


@pytest.fixture(scope="module")
def alone() -> tuple[OpenSession, dict[str, Any], Results]:
    session, truth = seen_by(replace(FIXED, balls=(HELD, *MOUNTED)), lambda one: one.step != "tcp")
    return session, truth, session.run()


def test_a_scanner_before_a_table_that_saw_nothing_of_the_robot_is_known_to_the_table_alone(
    alone: tuple[OpenSession, dict[str, Any], Results],
) -> None:
    session, truth, results = alone
    assert list(results) == ["turntable"]
    result = results["turntable"]
    assert result.verdict == "pass"
    assert "table-without-base" in {one.code for one in result.findings}
    for told in (result.base_from_laser, result.base_from_turntable):
        assert np.isnan(np.array(told, dtype=float)[:3]).all()
    assert np.isnan([*result.axis_direction_in_base, *result.axis_point_in_base_mm]).all()
    assert "Turntable seen from the scanner" in text_of(result)

    data = {"turntable": result.to_json()}
    seen = session_frames(session.record, data, asked=("laser", "turntable")).asked
    assert seen is not None
    with pytest.raises(cc.CalibrationError, match="base_from_laser"):
        session_frames(session.record, data, asked=("base", "laser"))
    axis = np.linalg.inv(truth["base_from_laser"])[:3, :3] @ truth["axes"][0]["axis_direction"]
    found, covariance = np.array(seen.matrix)[:3, :3], np.array(seen.covariance)[:2, :2]
    axis = axis * np.sign(axis @ found[:, 2])
    tilts = (found.T @ np.cross(found[:, 2], axis))[:2]
    assert tilts @ np.linalg.solve(covariance, tilts) < CHI2[2]


def test_a_table_that_its_scanner_alone_knows_is_the_answer_and_is_exported_as_seen_from_it(
    alone: tuple[OpenSession, dict[str, Any], Results],
) -> None:
    session, _, results = alone
    data = {stage: one.to_json() for stage, one in results.items()}
    edges = {edge.name: edge.state for edge in session_frames(session.record, data).edges}
    assert edges == {"base_from_tool0": "measured", "base_from_laser": "sought", "laser_from_turntable": "solved"}
    told = answer_record(answer_of(session.record, results))
    seen = told.laser_from_turntable
    assert seen is not None
    assert (told.stage, told.verdict, told.base_from_laser, told.base_from_turntable) == (
        "turntable", "pass", None, None
    )  # fmt: skip
    assert told.position_sigma_mm == pytest.approx(
        np.sqrt(np.linalg.eigvalsh(np.array(seen.covariance)[3:, 3:])[-1])
    )
    written = {name: export(session.record, results, name)[0].decode() for name in ("json", "csv", "urdf")}
    assert np.allclose(json.loads(written["json"])["laser_from_turntable"], seen.matrix, atol=1e-12)
    assert written["csv"].splitlines()[-1].startswith("laser,turntable,")
    assert '<parent link="laser"/>' in written["urdf"]
    for name in ("kuka", "fanuc", "moveit"):  # frames in the robot's base, or tools
        with pytest.raises(cc.CalibrationError, match="determined to each other alone"):
            export(session.record, results, name)


def test_the_guide_asks_a_scanner_before_a_table_for_no_sphere_on_a_robot(
    alone: tuple[OpenSession, dict[str, Any], Results],
) -> None:
    session, _, results = alone
    for known in ({}, {stage: one.to_json() for stage, one in results.items()}):
        told = guide(session.record, [], known)
        assert told.current.step == ("scan" if known else "turntable")
        assert {one.step: one.status for one in told.steps}["tcp"] == "not-needed"


def test_a_scanner_on_the_flange_that_alone_saw_the_table_is_found_with_it() -> None:
    def keep(one: Capture) -> bool:
        return (one.step == "tcp") == (one.scanner == "gate")

    session, truth = seen_by(replace(BESIDE, balls=(BallOptions(), HELD, *MOUNTED)), keep)
    result = session.run()["chain"]
    assert (result.verdict, all(row.used for row in result.residuals)) == ("pass", True)
    found = list(distances(result, truth))
    assert [name for name, *_ in found] == ["base_from_laser", "tool0_from_laser", "table"]
    for name, squared, freedom, _ in found:
        assert squared < CHI2[freedom], name


def test_a_table_that_its_scanner_alone_knows_has_a_budget_and_is_rechecked_by_another_session(
    alone: tuple[OpenSession, dict[str, Any], Results],
) -> None:
    session, _, results = alone
    data = {stage: one.to_json() for stage, one in results.items()}
    told = budget_at(session.record, data)
    seen = answer_record(answer_of(session.record, results))
    assert (told.frame, told.stage) == ("turntable", "turntable")
    (table,) = (part for part in told.parts if part.name == "table")
    assert 0 < table.worst_sigma_mm < told.uncertainty_mm < 0.5
    assert all(part.sigma_mm < 1e-3 for part in told.parts if part.name in ("tool", "arm"))
    assert seen.budget is not None
    with pytest.raises(cc.CalibrationError, match="scancell drift"):
        recheck_plan(session.record, data)


def test_two_scanners_before_a_table_are_known_to_it_and_to_each_other() -> None:
    beside = ScannerOptions("west", "base", aim_mm=(1000.0, -200.0, 440.0))
    two = replace(FIXED, scanners=(ScannerOptions("east", "base"), beside), told="names", balls=(HELD, *MOUNTED))
    session, truth = seen_by(two, lambda one: one.step != "tcp" and int(one.id[1:]) % 2 == 1)
    result = session.run("turntable")["turntable"]
    assert all(row.used or "arc" in str(row.reason) for row in result.residuals)
    (relative,) = (one for one in result.frames if one.outof.startswith("laser:"))
    assert (relative.into, relative.outof) == ("laser:east", "laser:west")
    assert "Scanner west seen from east" in {getattr(block, "title", None) for block in result.evidence}
    true = {one["scanner"]: np.array(one["matrix"]) for one in truth["frames"] if one["outof"] == "laser"}
    off = RigidTransform.from_rounded(relative.matrix, "laser", "laser").difference(
        RigidTransform.from_rounded(np.linalg.inv(true["east"]) @ true["west"], "laser", "laser")
    )
    covariance = np.array(relative.covariance)
    assert off @ np.linalg.solve(covariance, off) < CHI2[6]
    assert np.sqrt(np.trace(covariance[3:, 3:])) < 0.1
    rows = export(session.record, {"turntable": result}, "csv")[0].decode().splitlines()
    assert {tuple(row.split(",")[:2]) for row in rows[-2:]} == {
        ("laser_east", "laser_west"), ("laser_east", "turntable")
    }  # fmt: skip


@pytest.mark.thorough
def test_what_a_second_scanner_saw_is_judged_by_where_that_is() -> None:
    beside = ScannerOptions("west", "base", aim_mm=(1000.0, -200.0, 440.0))
    two = replace(FIXED, scanners=(ScannerOptions("east", "base"), beside), told="names", balls=(HELD, *MOUNTED))
    session, _ = seen_by(two, lambda one: one.step != "tcp" and int(one.id[1:]) % 2 == 0)  # no side is told
    (told,) = (one for one in session.run("turntable")["turntable"].findings if one.severity == "error")
    assert told.code == "axis-mirrored"  # by the other's place angles were said to be off by 47°
    assert "turntable.direction" not in told.to_do  # senses are told about up, which such a cell does not know
