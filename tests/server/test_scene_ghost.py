"""The pose to take next stands in the scene as the guide proposes it, and goes once nothing is asked for."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.stages.guide import guide
from server.scenes.colors import GHOST
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.scene_model import SceneFacts, scene_facts
from tests.server.scene_cell import TOOL0_FROM_LASER, make_cell


def ghost_nodes(facts: SceneFacts) -> dict[str, object]:
    return {name: node for name, node in draw(facts, look_at(facts)).items() if name.startswith("/ghost")}


def test_the_ghost_stands_where_the_guide_says() -> None:
    scene = make_cell().scene(count=3, solved=False)
    suggested = guide(scene.session, list(scene.measured), {}).current.suggested_pose
    assert suggested is not None
    pose = RigidTransform.from_rounded(suggested, "base", "tool0")
    facts = scene_facts(scene)
    nodes = draw(facts, look_at(facts))
    flange = nodes["/ghost/flange"].arguments
    assert flange["position"] == pytest.approx(pose.translation_mm / 1000)
    assert flange["origin_color"] == GHOST
    # Where the scanner sits on the flange is not known yet, and nothing is guessed.
    assert "/ghost/laser" not in nodes
    way = nodes["/ghost/way"].arguments["points"].reshape(-1, 3)
    assert way[0] == pytest.approx(facts.captures[-1].base_from_tool0.translation_mm / 1000, abs=1e-6)
    assert way[-1] == pytest.approx(pose.translation_mm / 1000, abs=1e-6)


def test_with_a_known_scanner_the_ghosts_light_reaches_the_sphere() -> None:
    cell = make_cell(rejected=())
    # Solved, then one capture was left out: the guide asks for more, about the sphere that was found.
    scene = cell.scene(count=6)
    captures = [c.model_copy(update={"excluded": c.id == "p06"}) for c in scene.session.captures]
    session = scene.session.model_copy(update={"captures": captures})
    facts = scene_facts(replace(scene, session=session, stale=frozenset({"tcp"})))
    assert facts.next_pose is not None
    nodes = draw(facts, look_at(facts))
    laser = facts.next_pose @ TOOL0_FROM_LASER
    assert nodes["/ghost/laser"].arguments["position"] == pytest.approx(laser.translation_mm / 1000)
    ahead_m = nodes["/ghost/light"].arguments["vertices"][1, 2]
    assert ahead_m * 1000 == pytest.approx(laser.inverse().apply(facts.sphere_center_in_base_mm)[2], abs=1e-3)
    alone = look_at(facts, "p01", alone=True)
    assert not [name for name in draw(facts, alone) if name.startswith("/ghost")]


def test_there_is_no_ghost_when_nothing_is_to_be_taken() -> None:
    cell = make_cell(rejected=())
    assert ghost_nodes(scene_facts(cell.scene())) == {}
    assert ghost_nodes(scene_facts(cell.scene(count=0, solved=False))) == {}


def test_the_way_is_left_out_where_the_flange_only_turns() -> None:
    cell = make_cell(rejected=())
    facts = scene_facts(cell.scene(count=2, solved=False))
    assert facts.next_pose is not None
    here = facts.captures[-1].base_from_tool0
    turned = RigidTransform.of(facts.next_pose.rotation, here.translation_mm, "base", "tool0")
    nodes = draw(type(facts)(facts.captures, None, None, None, next_pose=turned), look_at(facts))
    assert "/ghost/flange" in nodes
    assert "/ghost/way" not in nodes
    assert np.isfinite(nodes["/ghost/ring"].arguments["points"]).all()
