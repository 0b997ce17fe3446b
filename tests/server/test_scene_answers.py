"""Two answers in one scene: magnified alike, so that overlapping ellipsoids mean that the answers agree."""

from dataclasses import replace

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.review.placed_points import PlacedPoint
from server.scenes.answers import answers, magnified, places_mm
from server.scenes.display_options import look_at
from server.scenes.scene_model import scene_facts
from server.scenes.step_views import story
from tests.server.scene_cell import TOOL0_FROM_LASER, make_cell


def pair(apart_mm: float) -> PlacedPoint:
    other = RigidTransform.of(
        TOOL0_FROM_LASER.rotation,
        TOOL0_FROM_LASER.translation_mm + np.array([apart_mm, 0.0, 0.0]),
        "tool0",
        "laser",
    )
    known = np.diag([0.04, 0.01, 0.01]) ** 2
    return PlacedPoint("tool0_from_laser", (TOOL0_FROM_LASER, other), np.array([0.0, 0.0, 200.0]), (known, known))


@pytest.mark.parametrize(("apart_mm", "times"), [(0.1, 300), (3.0, 10), (500.0, 1)])
def test_both_points_and_their_ellipsoids_are_magnified_alike(apart_mm: float, times: int) -> None:
    facts = scene_facts(replace(make_cell(count=4).scene(), compared=(pair(apart_mm),)))
    assert magnified(facts) == times
    drawn = {node.name: node.arguments for node in answers(facts, look_at(facts))}
    root = "/answers/tool0_from_laser"
    first, second = (np.array(drawn[f"{root}/{name}/point"]["position"]) * 1000 for name in ("first", "second"))
    assert np.linalg.norm(second - first) == pytest.approx(times * apart_mm)
    widest_mm = max(drawn[f"{root}/first/point"]["scale"]) * 1000
    assert widest_mm == pytest.approx(2 * times * 0.04, abs=0.3)
    frames = [np.array(drawn[f"{root}/{name}/frame"]["position"]) * 1000 for name in ("first", "second")]
    assert np.linalg.norm(frames[1] - frames[0]) == pytest.approx(apart_mm)  # the scanners stand where they are
    assert np.isfinite(places_mm(facts)).all()
    assert story("answers", "result", facts).layers == {"answers"}


def test_a_scene_without_two_answers_tells_its_captures() -> None:
    facts = scene_facts(make_cell(count=4).scene())
    assert list(answers(facts, look_at(facts))) == []
    assert "answers" not in story("answers", "result", facts).subject
