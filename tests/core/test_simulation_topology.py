"""Simulated cells of every topology: what their scanners saw lies where the cell's edges say, by the truth."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from calib_core.cell.axes import frame_of, readings
from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.records import Capture
from calib_core.simulation import TOPOLOGY_SCENARIOS, SimulatedSession, TopologyScenario, simulate
from calib_core.simulation.topology_cell import simulate_topology
from tests.cell_edges import Edges, edges_of
from tests.topologies import topologies


def moved(axis: dict[str, Any], reading: float) -> FloatArray:
    """How an axis moves what it carries, (4, 4) in base as all axes read zero."""
    amount = axis["direction"] * axis["scale"] * reading
    direction, found = np.array(axis["axis_direction"]), np.eye(4)
    if axis["kind"] == "linear":
        found[:3, 3] = amount * direction
    else:
        found[:3, :3] = rotation_from_vector(np.deg2rad(amount) * direction)
        found[:3, 3] = axis["axis_point_mm"] - found[:3, :3] @ axis["axis_point_mm"]
    return found


def center_by_edges(simulated: SimulatedSession, edges: Edges, capture: Capture, ball: str) -> FloatArray:
    """Where the scanner of a capture must see a ball's centre, (3,), by the truth of every edge between them."""
    truth = simulated.truth
    axes = {axis["name"]: axis for axis in truth["axes"]}
    mounts = {frame["scanner"] or "": frame["matrix"] for frame in truth["frames"] if frame["outof"] == "laser"}
    (carrier, place) = next((b["in"], [*b["center_mm"], 1.0]) for b in truth["spheres"] if b["name"] == ball)
    laser = f"laser:{capture.scanner}" if capture.scanner else "laser"
    way = np.eye(4)
    for edge, against in edges.way(laser, frame_of(carrier)):
        if edge.kind == "axis":
            step = moved(axes[edge.name], readings(capture).get(edge.name, 0.0))
        else:
            step = np.array(mounts[edge.name] if edge.kind == "mount" else truth["base_from_tool0"][capture.id])
        way = way @ (np.linalg.inv(step) if against else step)
    return (way @ place)[:3]


def worst_mm(simulated: SimulatedSession) -> float:
    """How far points lie from the nearest ball that they may be of, at most."""
    session, truth = simulated.session, simulated.truth
    edges = edges_of(session.cell, session.captures)
    radii = {found["name"]: found["diameter_mm"] / 2 for found in truth["spheres"]}
    worst = 0.0
    for capture in session.captures:
        lines = simulated.files[capture.files[0]].decode().splitlines()[1:]
        told = np.array([[float(n) for n in line.split(",")] for line in lines if not line.endswith(",")])
        in_files = np.array(truth["in_files"][capture.scanner or ""])
        points = np.linalg.solve(in_files, np.stack([told[:, 0], np.zeros(len(told)), told[:, 1]])).T
        off = [
            np.abs(np.linalg.norm(points - center_by_edges(simulated, edges, capture, ball), axis=1) - radii[ball])
            for ball in truth["balls_seen"][capture.id]
        ]
        worst = max(worst, float(np.min(off, axis=0).max()))
    return worst


@pytest.mark.thorough(keep=8)
@pytest.mark.parametrize("name", sorted(TOPOLOGY_SCENARIOS))
def test_points_lie_where_the_edges_say(name: str) -> None:
    simulated = simulate(name, 5)
    assert len(simulated.session.captures) >= 14
    assert worst_mm(simulated) < 0.25  # six sigmas of a point, an axis's reading far out, rounding to 4 decimals
    assert simulate(name, 5).files == simulated.files


@pytest.mark.thorough
@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(topologies(), st.integers(0, 10_000))
def test_a_drawn_topology_is_listed_as_it_was_built(scenario: TopologyScenario, seed: int) -> None:
    simulated = SimulatedSession(*simulate_topology(scenario, "drawn", seed), None)
    edges = edges_of(simulated.session.cell, simulated.session.captures)
    assert [edge.name for edge in edges.of("mount")] == [scanner.name for scanner in scenario.scanners]
    assert {edge.name for edge in edges.of("axis")} == {axis.name for axis in scenario.axes}
    assert [edge.name for edge in edges.of("place")] == [ball.name for ball in scenario.balls]
    assert {capture.scanner for capture in simulated.session.captures} == {s.name for s in scenario.scanners}
    assert worst_mm(simulated) < 0.3


def test_files_of_a_scanner_whose_scale_is_off_are_not_rounded_to_columns() -> None:
    scenario = replace(TOPOLOGY_SCENARIOS["plate"], scanner_scale=1.003)
    _, files, _ = simulate_topology(scenario, "", 1)
    rows = next(iter(files.values())).decode().splitlines()[1:]
    x = np.array([float(row.split(",")[0]) for row in rows]) / 1.003
    np.testing.assert_allclose(x, np.round(x, 1), atol=1e-4)


def test_a_true_tables_frame_stands_where_results_put_it() -> None:
    simulated = simulate("fixed-scanner-turntable", 5)
    first = next(one for one in simulated.session.captures if one.table_deg is not None)
    ball = next(b for b in simulated.truth["spheres"] if b["name"] == simulated.truth["balls_seen"][first.id][0])
    table = np.array(simulated.truth["base_from_turntable"])
    assert (np.array(ball["center_mm"]) - table[:3, 3]) @ table[:3, 2] == pytest.approx(0.0, abs=1e-9)
