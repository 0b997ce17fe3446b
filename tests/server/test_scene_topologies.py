"""Scenes of other topologies: each scanner where it is, balls on the flange and on linear axes, by the truth."""

from typing import Any

import numpy as np
import pytest

import calib_core as cc
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.nodes import Node
from server.scenes.scene_model import SceneFacts, scene_facts
from server.scenes.stored import scene_input


def drawn(scenario: str) -> tuple[SceneFacts, dict[str, Node], dict[str, Any]]:
    simulated, truth = cc.simulate(scenario, 1)
    results = {stage: result.to_json() for stage, result in simulated.run().items()}
    facts = scene_facts(scene_input(simulated.record, simulated.read, [], results))
    return facts, draw(facts, look_at(facts)), truth


def test_a_scanner_that_stands_still_is_drawn_beside_the_one_on_the_flange() -> None:
    facts, nodes, truth = drawn("scanners-on-flange-and-base")
    true = {frame["scanner"]: np.array(frame["matrix"]) for frame in truth["frames"]}
    seen = {"arm": 0, "gate": 0}
    for capture in facts.captures:
        laser = capture.base_from_laser
        assert laser is not None
        seen[capture.scanner] += 1
        if capture.scanner == "gate":
            np.testing.assert_allclose(laser.translation_mm, true["gate"][:3, 3], atol=1.0)
        residuals = facts.residuals_mm(capture)
        assert residuals is not None
        assert np.abs(residuals).max() < 1.0  # the points lie on the ball that the scene draws for them
    assert min(seen.values()) > 8
    still = [name for name in nodes if name.endswith("/laser") and nodes[name.replace("laser", "flange")]]
    assert len(still) == seen["arm"] + 1  # the one that stands still once
    assert {"/sphere/solved", "/sphere/1"} <= set(nodes)


@pytest.mark.thorough
def test_balls_of_a_linear_axis_stand_where_it_brought_them() -> None:
    facts, nodes, _ = drawn("slide")
    assert facts.table is not None
    assert len(facts.table.places) > 8
    assert sum(name.startswith("/places/") and name.endswith("/sphere") for name in nodes) > 8
    assert all("\u202fmm" in place.read for place in facts.table.places)
    assert not any(name.startswith("/circles/") for name in nodes)


def test_every_axis_is_drawn_where_it_is_and_called_by_its_name() -> None:
    facts, nodes, truth = drawn("rail-positioner")
    assert facts.table is not None
    assert (facts.table.axis, facts.table.title) == ("turn", "Rotary axis turn")
    assert {(axis.name, axis.under_robot) for axis in facts.axes} == {("rail", True), ("tilt", False)}
    true = {axis["name"]: axis for axis in truth["axes"]}
    for name, node in (("rail", "/base/axis-rail"), ("tilt", "/table/axis-tilt")):
        start, end = 1000.0 * nodes[node].arguments["points"][0]
        along = (end - start) / np.linalg.norm(end - start)
        assert abs(along @ np.array(true[name]["axis_direction"])) > 0.9999
        assert nodes[f"{node}-name"].arguments["text"] == name
    point = np.array(true["tilt"]["axis_point_mm"]) - start
    assert np.linalg.norm(point - along * (point @ along)) < 1.0  # the tilt's line, in base
    # The arm stands where the rail brought it, and reads are told of axes under the object alone.
    feet = [one.base_from_foot.translation_mm for one in facts.captures]
    assert np.ptp(feet, axis=0).max() > 300.0
    np.testing.assert_allclose(1000.0 * nodes["/arm/links"].arguments["points"][0][0], feet[-1], atol=0.1)
    assert all(place.read.startswith("tilt ") and "rail" not in place.read for place in facts.table.places)


def test_one_capture_shows_an_axis_as_it_stood() -> None:
    facts, _, _ = drawn("positioner")
    assert facts.table is not None
    place = facts.table.places[0]
    (capture,) = (one for one in facts.captures if one.id == place.capture)
    center = capture.sphere_center_in_base_mm
    assert center is not None
    np.testing.assert_allclose(center, place.center_in_base_mm, atol=0.5)
    nodes = draw(facts, look_at(facts, capture.id, alone=True))
    assert nodes["/turned/angle"].arguments["text"] == place.read


def test_a_plates_points_lie_on_its_balls_which_are_drawn_where_the_axes_brought_them() -> None:
    facts, _, _ = drawn("plate-on-positioner")
    plates = [one for one in facts.captures if one.mount == "plate" and one.state == "used"]
    assert len(plates) > 20
    for capture in plates:
        residuals = facts.residuals_mm(capture)
        assert residuals is not None
        assert np.abs(residuals).max() < 1.0
    nodes = draw(facts, look_at(facts, plates[0].id, alone=True))
    assert sum(name.startswith("/turned/table/sphere-") for name in nodes) == 3
