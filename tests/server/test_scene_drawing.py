"""What is drawn of a session: every capture in its place, every point in the colour of its residual."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Session
from server.scenes.colors import DIVERGING, REJECTED, USED, diverging_colors, length_text, residual_limit_mm
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.legend import legend_html, rejected_html
from server.scenes.nodes import Node, axes
from server.scenes.scene_model import BY_HAND, MAX_POINTS, SceneFacts, scene_facts
from server.scenes.views import FIELD_OF_VIEW_RAD, VIEWS, view
from tests.server.scene_cell import CENTER_MM, TOOL0_FROM_LASER, make_cell


def drawn(facts: SceneFacts, picked: str | None = None) -> dict[str, Node]:
    return draw(facts, look_at(facts, picked))


def changed(before: dict[str, Node], after: dict[str, Node]) -> set[str]:
    return {n for n in after if n not in before or before[n].fingerprint() != after[n].fingerprint()}


def test_every_capture_has_its_flange_its_scanner_its_light_and_its_name() -> None:
    cell = make_cell()
    nodes = drawn(scene_facts(cell.scene()))
    for k, pose in enumerate(cell.poses):
        name = f"p{k + 1:02d}"
        flange, laser = nodes[f"/frames/{name}/flange"], nodes[f"/frames/{name}/laser"]
        np.testing.assert_allclose(flange.arguments["position"], pose.translation_mm / 1000, atol=1e-12)
        expected = (pose @ TOOL0_FROM_LASER).translation_mm / 1000
        np.testing.assert_allclose(laser.arguments["position"], expected, atol=1e-9)
        assert f"/light/{name}" in nodes
        assert name in nodes[f"/labels/{name}"].arguments["text"]
    assert {f"/base/{axis}" for axis in "xyz"} <= nodes.keys()
    np.testing.assert_allclose(nodes["/sphere/solved"].arguments["position"], CENTER_MM / 1000)


def test_a_capture_of_another_sphere_has_no_residuals_and_does_not_stretch_the_scale() -> None:
    facts = scene_facts(make_cell().scene())
    there = next(number for number, capture in enumerate(facts.captures) if capture.state == "used")
    captures = list(facts.captures)
    beside_mm = captures[there].points_in_laser_mm + np.array([0.0, 0.0, 300.0])  # the far sphere of a ball bar
    captures[there] = dataclasses.replace(captures[there], points_in_laser_mm=beside_mm)
    with_another = dataclasses.replace(facts, captures=tuple(captures))
    assert facts.residuals_mm(facts.captures[there]) is not None
    assert with_another.residuals_mm(captures[there]) is None
    assert look_at(with_another).limit_mm <= look_at(facts).limit_mm


def test_points_lie_where_they_were_measured_to_a_micrometre_and_carry_their_residuals_colour() -> None:
    cell = make_cell()
    facts = scene_facts(cell.scene())
    look = look_at(facts)
    nodes = draw(facts, look)
    used = [k for k, c in enumerate(facts.captures) if c.state == "used"]
    assert look.limit_mm == residual_limit_mm([cell.residuals[k] for k in used])
    for k in used:
        node = nodes[f"/points/p{k + 1:02d}"]
        true_mm = (cell.poses[k] @ TOOL0_FROM_LASER).apply(cell.points[k])
        shown_mm = (node.arguments["points"].astype(float) + node.arguments["position"]) * 1000
        np.testing.assert_allclose(shown_mm, true_mm, atol=1e-3)
        assert node.arguments["precision"] == "float32"
        # The cell knows each point's distance from the sphere; one grey level is its rounding.
        expected = diverging_colors(cell.residuals[k], look.limit_mm).astype(int)
        assert np.abs(node.arguments["colors"].astype(int) - expected).max() <= 1


def test_rejected_captures_are_crossed_out_coloured_and_say_why() -> None:
    cell = make_cell(rejected=("p05",))
    facts = scene_facts(cell.scene(failed=("p09",)))
    nodes = drawn(facts)
    for name, reason in (("p05", "sphere moved by 3.0 mm"), ("p09", "sphere leaves the stripe at the left")):
        assert nodes[f"/frames/{name}/flange"].arguments["origin_color"] == REJECTED
        assert f"/frames/{name}/cross" in nodes
        assert nodes[f"/labels/{name}"].arguments["text"] == f"✕ {name}"  # quiet until it is picked
        assert reason in drawn(facts, name)[f"/labels/{name}"].arguments["text"]
        assert (nodes[f"/points/{name}"].arguments["colors"] == REJECTED).all()
        assert reason in rejected_html(facts)
    assert nodes["/frames/p01/flange"].arguments["origin_color"] == USED
    assert "/frames/p01/cross" not in nodes
    assert "2 rejected" in legend_html(facts, look_at(facts))
    by_hand = (dataclasses.replace(c, reason=BY_HAND) if c.id == "p09" else c for c in facts.captures)
    words = legend_html(dataclasses.replace(facts, captures=tuple(by_hand)), look_at(facts))
    assert "1 rejected" in words
    assert "1 excluded" in words


def test_before_a_result_only_flanges_are_shown_and_no_file_is_read() -> None:
    def never(_: object) -> np.ndarray:
        raise AssertionError("points were read that cannot be placed")

    scene = dataclasses.replace(make_cell().scene(count=5, solved=False), load_points=never)
    facts = scene_facts(scene)
    names = drawn(facts).keys()
    assert sum(name.startswith("/frames") and name.endswith("/flange") for name in names) == 5
    assert not [n for n in names if n.startswith(("/light", "/points", "/sphere")) or n.endswith("/laser")]
    assert "first result" in legend_html(facts, look_at(facts))


def test_an_empty_session_still_shows_the_base() -> None:
    facts = scene_facts(make_cell().scene(count=0, solved=False))
    assert {name.split("/")[1] for name in drawn(facts)} == {"base"}
    assert "Nothing to draw yet" in legend_html(facts, look_at(facts))


def test_a_capture_without_a_usable_pose_is_left_out_and_the_others_stay() -> None:
    scene = make_cell().scene(count=3)
    captures = list(scene.session.captures)
    captures[1] = captures[1].model_copy(update={"pose": [1.0, 2.0]})
    captures[2] = captures[2].model_copy(update={"pose": None})
    session = Session.model_validate({**dict(scene.session), "captures": captures})
    facts = scene_facts(dataclasses.replace(scene, session=session))
    assert [c.id for c in facts.captures] == ["p01"]


def test_one_more_capture_changes_nothing_but_itself() -> None:
    cell = make_cell()
    before = drawn(scene_facts(cell.scene(count=8, solved=False)))
    after = drawn(scene_facts(cell.scene(count=9, solved=False)))
    # And the way from the last capture to the next pose.
    moved = {name for name in changed(before, after) if not name.startswith("/arm/")}  # it stands at the last one
    assert moved - {"/ghost/way"} == {"/frames/p09/flange", "/labels/p09"}
    assert before.keys() <= after.keys()


def test_picking_a_capture_lights_it_up_and_dims_the_others() -> None:
    facts = scene_facts(make_cell().scene())
    touched = changed(drawn(facts), drawn(facts, "p03"))
    others = {f"/light/{c.id}" for c in facts.captures if c.id != "p03"}
    rest = {n for n in touched if "p03" not in n and not n.startswith("/arm/")} - {"/uncertainty/tool"}
    assert others <= rest
    assert {name.split("/")[1] for name in rest} == {"light", "frames", "points", "labels"}
    before, after = drawn(facts), drawn(facts, "p03")
    assert all(after[n].arguments["opacity"] < before[n].arguments["opacity"] for n in rest if "scanner" in n)
    clouds = [name for name in rest if name.startswith("/points/")]
    off_grey = [
        sum(float(np.abs(one[name].arguments["colors"] - 172.0).sum()) for name in clouds)
        for one in (before, after)
    ]
    assert 0 < off_grey[1] < 0.5 * off_grey[0]
    assert {"/points/p03", "/frames/p03/flange", "/labels/p03", "/light/p03"} <= touched


def test_the_cells_own_arm_is_drawn_where_it_is_known_and_its_joints_were_read() -> None:
    scene = make_cell().scene()
    last = scene.session.captures[-1].model_copy(update={"joints_deg": [0.0, -90.0, 90.0, 0.0, 90.0, 0.0]})
    robot = scene.session.cell.robot.model_copy(update={"arm": "ur5e"})
    cell = scene.session.cell.model_copy(update={"robot": robot})
    captures = [*scene.session.captures[:-1], last]
    session = scene.session.model_copy(update={"cell": cell, "captures": captures})
    own = drawn(scene_facts(dataclasses.replace(scene, session=session)))["/arm/links"]
    generic = drawn(scene_facts(scene))["/arm/links"]
    lengths_mm = 1000 * np.linalg.norm(np.diff(own.arguments["points"], axis=1), axis=2).ravel()
    assert {round(float(one)) for one in lengths_mm} >= {425, 392, 162}  # as its maker publishes them
    assert len(generic.arguments["points"]) == 4


@pytest.mark.parametrize("z_sign", [1.0, -1.0])
@pytest.mark.parametrize("away_mm", [190.0, 5.0])
def test_the_light_comes_from_the_side_that_the_scanner_sees(z_sign: float, away_mm: float) -> None:
    angle = np.deg2rad(np.linspace(-65, 65, 200))
    arc = np.stack([12 * np.sin(angle), 0 * angle, away_mm - 12 * np.cos(angle)], axis=1) * [1, 1, z_sign]

    def load_points(_: Capture) -> FloatArray:
        return arc

    scene = dataclasses.replace(make_cell().scene(count=1), load_points=load_points)
    corners = drawn(scene_facts(scene))["/light/p01"].arguments["vertices"] * 1000.0
    depth = corners[:, 2] * z_sign  # grows away from the scanner
    assert depth.max() == pytest.approx((arc[:, 2] * z_sign).max(), abs=1e-3)
    assert depth.min() <= min(0.0, (arc[:, 2] * z_sign).min() - 10)
    assert corners[:, 0].min() == pytest.approx(arc[:, 0].min(), abs=1e-3)
    assert corners[:, 0].max() == pytest.approx(arc[:, 0].max(), abs=1e-3)
    assert (corners[:, 1] == 0).all()
    # From far away it starts in the scanner's origin; from an origin beside the sphere the source is not known.
    assert (np.abs(corners).sum(axis=1) == 0).any() == (away_mm > 100)


def test_a_label_gives_the_whole_reason_for_the_page_to_shorten() -> None:
    scene = make_cell(rejected=("p01",)).scene(count=2)
    tcp = scene.results["tcp"]
    reason = "the sphere appears 3.00 mm (x -1.97, y +0.12) from where the others see it, 9 times. Take it again."
    rows = [r.model_copy(update={"reason": reason}) for r in tcp.residuals]  # pyright: ignore
    facts = scene_facts(dataclasses.replace(scene, results={"tcp": tcp.model_copy(update={"residuals": rows})}))
    label = drawn(facts, "p01")["/labels/p01"].arguments["text"]
    assert label == f"✕ p01 · {reason}"
    assert reason in rejected_html(facts)


def test_many_points_are_thinned_to_the_bound_evenly() -> None:
    cell = make_cell(count=4, points=120_000)
    facts = scene_facts(cell.scene())
    counts = [len(c.points_in_laser_mm) for c in facts.captures]
    assert sum(counts) <= MAX_POINTS
    assert min(counts) == max(counts) >= MAX_POINTS / 4 / 2


def test_without_a_diameter_the_points_say_the_radius() -> None:
    scene = make_cell().scene()
    cell = scene.session.cell.model_copy(update={"sphere_diameter_mm": None})
    session = scene.session.model_copy(update={"cell": cell})
    facts = scene_facts(dataclasses.replace(scene, session=session))
    assert facts.sphere_radius_mm == pytest.approx(20.0, abs=0.05)  # the captures' own offsets have sigma 0.05


def test_names_from_outside_cannot_become_markup() -> None:
    scene = make_cell(rejected=("p01",)).scene(count=2)
    tcp = scene.results["tcp"]
    rows = [r.model_copy(update={"reason": "<img src=x onerror=alert(1)>"}) for r in tcp.residuals]  # pyright: ignore
    facts = scene_facts(dataclasses.replace(scene, results={"tcp": tcp.model_copy(update={"residuals": rows})}))
    assert "<img" not in rejected_html(facts)
    assert "&lt;img" in rejected_html(facts)


@pytest.mark.parametrize("name", VIEWS)
def test_every_view_holds_what_it_is_for(name: str) -> None:
    facts = scene_facts(make_cell().scene())
    camera = view(name, facts)
    ahead = camera.look_at_m - camera.position_m
    ahead /= np.linalg.norm(ahead)
    to_sphere = CENTER_MM / 1000 - camera.position_m
    angle = np.arccos(to_sphere @ ahead / np.linalg.norm(to_sphere))
    assert angle < FIELD_OF_VIEW_RAD / 2
    assert np.linalg.norm(np.cross(ahead, camera.up)) > 1e-4  # up is not along the view


@given(st.floats(1e-4, 5.0), st.lists(st.floats(-10, 10), min_size=1, max_size=50))
def test_the_scale_has_grey_at_zero_is_monotone_and_ends_in_its_end_colours(
    limit: float, values: list[float]
) -> None:
    colors = diverging_colors(np.array([-limit * 2, 0.0, limit * 2]), limit)
    assert [tuple(c) for c in colors.tolist()] == [DIVERGING[0], DIVERGING[2], DIVERGING[4]]
    assert len(set(DIVERGING[2])) == 1
    warmth = np.diff(diverging_colors(np.sort(values), limit)[:, [0, 2]].astype(int) @ [1, -1])
    assert (warmth >= -1).all()  # from blue to red, but for rounding


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=80))
def test_the_limit_covers_98_percent_and_is_at_most_twice_too_wide(values: list[float]) -> None:
    quantile = float(np.quantile(np.abs(values), 0.98))
    limit = residual_limit_mm([np.array(values)])
    assert limit >= quantile * (1 - 1e-6)
    assert limit <= max(2 * quantile, 1e-4)


def test_lengths_read_well() -> None:
    assert [length_text(v) for v in (0.05, 0.0015, 1.5)] == ["50 µm", "1.5 µm", "1.5 mm"]


def test_small_axes_are_large_ones_scaled_down_for_the_clients_outlines() -> None:
    """The client compares all corners within 0.01 of each other, which takes seconds where all of them are."""
    node = axes("/frames/p01/flange", RigidTransform.identity("base", "tool0"), 24.0, (1, 2, 3))
    assert node.arguments["axes_length"] * node.arguments["scale"] == pytest.approx(0.024)
    assert node.arguments["axes_radius"] > 100 * 0.01


@pytest.mark.parametrize(("count", "method"), [(80, "add_batched_axes"), (400, "add_batched_meshes_simple")])
def test_very_many_flanges_point_where_they_look_in_the_colour_of_their_state(count: int, method: str) -> None:
    cell = make_cell(count=count, rejected=("p03",))
    flanges = drawn(scene_facts(cell.scene()))["/frames/flanges"]
    assert flanges.method == method
    assert flanges.instances == tuple(capture.id for capture in cell.scene().session.captures)
    places = flanges.arguments["batched_positions"]
    np.testing.assert_allclose(places, [p.translation_mm / 1000 for p in cell.poses], atol=1e-6)
    if method == "add_batched_meshes_simple":
        told = {tuple(color) for color in flanges.arguments["batched_colors"].tolist()}
        assert told == {USED, REJECTED}
        assert flanges.arguments["vertices"][:, 2].argmax() == 3  # the tip, along z
