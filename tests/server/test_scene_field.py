"""The error budget over the table in the scene: where its dots lie, what their colours say, when they are told."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.guidance.part_budget import budget_at
from calib_core.simulation import simulate
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from server.scenes.colors import VIRIDIS
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.legend import legend_html
from server.scenes.scene_input import SceneInput
from server.scenes.scene_model import scene_facts
from server.scenes.step_views import story
from server.scenes.stored import scene_input


@pytest.fixture(scope="module")
def solved() -> tuple[SceneInput, ChainResult]:
    made = simulate("turntable", 2)
    result = solve_stage(made.session, "chain", made.files.__getitem__)
    assert isinstance(result, ChainResult)
    return scene_input(made.session, made.files.__getitem__, [], {"chain": result.to_json()}), result


@pytest.mark.thorough
def test_dots_over_the_table_have_the_colour_of_their_uncertainty(solved: tuple[SceneInput, ChainResult]) -> None:
    scene, result = solved
    facts = scene_facts(scene)
    assert facts.field is not None
    nodes = draw(facts, look_at(facts))
    dots = nodes["/field/points"].arguments
    table = RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable")
    drawn_mm = 1000 * (dots["points"] + np.array(dots["position"]))
    assert drawn_mm == pytest.approx(table.apply(facts.field.points_mm), abs=0.01)
    worst = int(np.argmax(facts.field.uncertainty_mm))
    assert tuple(dots["colors"][worst]) == VIRIDIS[-1]
    place = facts.field.points_mm[worst].tolist()
    said = budget_at(scene.session, {"chain": result.to_json()}, place)
    assert facts.field.uncertainty_mm[worst] == pytest.approx(said.uncertainty_mm, rel=1e-9)


def test_its_legend_is_told_with_the_tables_result_alone(solved: tuple[SceneInput, ChainResult]) -> None:
    facts = scene_facts(solved[0])
    told = story("sphere-on-table", "result", facts).layers
    low, high = facts.field.range_mm if facts.field else (0.0, 0.0)
    assert f"±{low:.2f} mm</span><span>±{high:.2f} mm" in legend_html(facts, look_at(facts), told)
    measuring = story("sphere-on-table", "measure", facts).layers
    assert "One scan of" not in legend_html(facts, look_at(facts), measuring)


def test_a_stale_answer_has_none(solved: tuple[SceneInput, ChainResult]) -> None:
    facts = scene_facts(replace(solved[0], stale=frozenset({"chain"})))
    assert facts.field is None
    assert not any(name.startswith("/field") for name in draw(facts, look_at(facts)))
