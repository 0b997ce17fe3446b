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
