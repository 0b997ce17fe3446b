"""Further captures of solved cells of other topologies: the machine can take them, and they show the ball."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.errors import ConflictError
from calib_core.exports.planned_program import planned_program
from calib_core.guidance.pose_list import PoseList, planned_poses
from calib_core.library.opened import in_memory
from calib_core.records import Measured, Session
from calib_core.records.base import PlannedStep
from calib_core.simulation import TOPOLOGY_SCENARIOS, TopologyScenario
from calib_core.simulation.topology import BallOptions, TopologyWorld, build_topology
from calib_core.simulation.topology_cell import simulate_topology

SEED = 3


@cache
def solved(name: str) -> tuple[Session, list[Measured], dict[str, dict[str, Any]]]:
    session, files, _ = simulate_topology(TOPOLOGY_SCENARIOS[name], name, SEED)
    results = in_memory(session, files).run()
    measured = [measure_capture(session, capture, files.__getitem__) for capture in session.captures]
    return session, measured, {stage: result.to_json() for stage, result in results.items()}


def world_of(name: str) -> TopologyWorld:
    """The truth that the session of this name and seed was drawn from."""
    options = TOPOLOGY_SCENARIOS[name]
    rng = np.random.default_rng([SEED, 20_268])
    return build_topology(
        options.scanners, options.balls, options.axes, options.cell.sphere_diameter_sigma_mm, rng
    )


def planned(name: str, step: PlannedStep, count: int = 4) -> PoseList:
    return planned_poses(*solved(name), count, step)


def seen_in_truth(name: str, plan: PoseList) -> list[tuple[float, float]]:
    """Where each planned capture truly has its ball, |y| over the radius, and z."""
    world, found = world_of(name), list[tuple[float, float]]()
    for pose in plan.poses:
        table = {} if pose.table_deg is None else {"table": pose.table_deg}
        where = {**table, **(pose.axes_deg or {}), **(pose.axes_mm or {})}
        flange = world.base_from_foot(where) @ np.array(pose.base_from_tool0)
        laser_from_base = world.laser_from_base(pose.scanner or next(iter(world.scanners)), flange)
        best = (np.inf, np.inf)
        for ball, (options, _) in world.balls.items():
            if options.mount == pose.mount:
                at = (laser_from_base @ np.append(world.ball_in_base(ball, flange, where), 1.0))[:3]
                best = min(best, (abs(float(at[1])) / world.radii_mm[ball], float(at[2])))
        found.append(best)
    return found


@pytest.mark.parametrize(
    ("name", "step"),
    [
        ("positioner", "turntable"),
        ("slide", "turntable"),
        ("fixed-scanner-turntable", "turntable"),
        ("gantry-turntable", "turntable"),
        ("gantry-turntable", "verify"),
        ("linear-turntable", "verify"),
        ("rail", "tcp"),
        ("two-scanners", "verify"),
    ],
)
def test_what_is_planned_shows_the_ball_in_truth(name: str, step: PlannedStep) -> None:
    plan = planned(name, step)
    for beside, depth in seen_in_truth(name, plan):
        assert beside < 0.93  # planned up to 0.88 of the radius, seen as the calibration is off by a millimetre
        assert 120 < depth < 280
    figures = [pose.uncertainty_mm for pose in plan.poses]
    assert all(figure is not None for figure in figures)
    assert figures == sorted(figures, reverse=True)  # type: ignore[type-var]


def test_axes_are_named_where_the_cell_names_them() -> None:
    for pose in planned("positioner", "turntable").poses:
        assert pose.axes_deg is not None
        assert set(pose.axes_deg) == {"tilt", "turn"}
        assert -41 < pose.axes_deg["tilt"] < 41
        assert (pose.table_deg, pose.axes_mm) == (None, None)
        assert pose.approach_numbers is not None
    assert all(list(pose.axes_mm or {}) == ["rail"] for pose in planned("rail", "verify").poses)


def test_a_gantry_is_asked_for_no_tilt() -> None:
    session, _, _ = solved("gantry-turntable")
    steps: tuple[PlannedStep, ...] = ("tcp", "turntable", "verify")
    for step in steps:
        for pose in planned("gantry-turntable", step).poses:
            turned = [np.abs(np.array(pose.numbers[3:]) - np.array((c.pose or [])[3:])).max()
                      for c in session.captures]  # fmt: skip
            assert min(turned) < 1e-6


def test_before_a_scanner_that_stands_still_the_table_alone_moves() -> None:
    plan = planned("fixed-scanner-turntable", "turntable")
    assert not plan.by_robot
    assert str(plan.note).startswith("Move the axes alone")
    assert all(pose.table_deg is not None for pose in plan.poses)
    with pytest.raises(ConflictError, match="for which the robot moves"):
        planned_program(solved("fixed-scanner-turntable")[0], plan, "abb")


def test_a_program_names_the_axes() -> None:
    plan = planned("slide", "turntable", 2)
    program = planned_program(solved("slide")[0], plan, "abb").content.decode()
    assert "slide at" in program


def test_each_scanner_and_ball_is_verified_in_turn() -> None:
    assert sorted(str(pose.scanner) for pose in planned("two-scanners", "verify").poses) == [
        "left", "left", "right", "right",
    ]  # fmt: skip


def test_what_cannot_be_planned_is_said_in_its_own_words() -> None:
    with pytest.raises(ConflictError, match="a sphere on an axis that was captured, got none"):
        planned("rail", "turntable")
    session, measured, _ = solved("positioner")
    with pytest.raises(ConflictError, match="a cell that is solved, its axes too"):
        planned_poses(session, measured, {}, 4, "turntable")


@pytest.mark.parametrize("step", ["turntable", "verify"])
@pytest.mark.parametrize("name", ["positioner", "fixed-scanner-turntable"])
def test_where_the_answer_failed_that_is_said(name: str, step: PlannedStep) -> None:
    session, measured, results = solved(name)
    failed = {stage: {**result, "verdict": "fail"} for stage, result in results.items()}
    with pytest.raises(ConflictError, match=r"got one that failed: '.*Do what its findings say"):
        planned_poses(session, measured, failed, 4, step)


def test_where_sizes_differ_a_pose_that_verifies_names_its_ball() -> None:
    balls = (
        BallOptions("small", diameter_mm=30.0),
        BallOptions("large", at_mm=(850.0, 60.0, 470.0), diameter_mm=50.0),
    )
    made = TopologyScenario("sizes", balls=balls, told="names")
    session, files, truth = simulate_topology(made, "drawn", SEED)
    results = {"tcp": in_memory(session, files).run("tcp")["tcp"].to_json()}
    measured = [measure_capture(session, capture, files.__getitem__) for capture in session.captures]
    centers = {ball["name"]: np.array([*ball["center_mm"], 1.0]) for ball in truth["spheres"]}
    poses = planned_poses(session, measured, results, 4, "verify").poses
    for pose in poses:
        laser = np.linalg.inv(np.array(pose.base_from_tool0) @ np.array(truth["tool0_from_laser"]))
        assert pose.mount is not None
        assert abs((laser @ centers[pose.mount])[1]) < 15.0
