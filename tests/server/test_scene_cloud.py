"""The merged cloud in the scene: the stored one instead of raw scans, its colours, sections and deviations."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib_core.archive.stored_clouds import CLOUD_FILE, REFERENCE_FILE
from calib_core.errors import InputError
from calib_core.findings.catalogues import catalogue
from calib_core.formats.ply import ply_pieces
from calib_core.fusion.deviation import Deviations
from calib_core.messages import made_lately
from calib_core.stages.merge.record import MergeResult
from server.scenes.cloud_layers import cloud_place, deviation_colors, height_range_mm
from server.scenes.cloud_view import Against, CloudView, Section, section_of
from server.scenes.colors import DIVERGING, SCANS, VIRIDIS, WAITING
from server.scenes.detail import Gaze, detail
from server.scenes.deviation import CloudDeviation
from server.scenes.display_options import Look, look_at
from server.scenes.layers import draw
from server.scenes.legend import legend_html
from server.scenes.live import LiveScene
from server.scenes.merged import MAX_SCAN_POINTS, merged_cloud
from server.scenes.nodes import Node
from server.scenes.scene_input import SceneInput
from server.scenes.scene_model import SceneFacts, scene_facts
from server.scenes.stored import scene_input
from server.scenes.surface_pick import picked_on_cloud
from server.scenes.views import FIELD_OF_VIEW_RAD, view
from tests.server.test_scene_steps import merged_scene

SIDE = np.linspace(-40.0, 40.0, 81)
PLATE = np.stack(np.meshgrid(SIDE, SIDE, [10.0], indexing="ij"), axis=-1).reshape(-1, 3)
BALL_MM, RADIUS_MM = np.array([0.0, 0.0, 40.0]), 12.0


def ball(count: int = 3000) -> np.ndarray:
    rng = np.random.default_rng(3)
    normal = rng.normal(size=(count, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return BALL_MM + (RADIUS_MM + rng.normal(0, 0.01, count))[:, None] * normal


CLOUD = np.concatenate([PLATE, ball()])
# A square two tenths above the plate: every point of it lies 0.2 mm inside.
REFERENCE = np.array([[-50, -50, 10.2], [50, -50, 10.2], [50, 50, 10.2], [-50, 50, 10.2]], dtype=float)


def ply(points: np.ndarray, triangles: np.ndarray | None = None) -> bytes:
    return b"".join(bytes(piece) for piece in ply_pieces(points, triangles=triangles))


def fused_scene(points: np.ndarray = CLOUD, reference: bytes | None = None) -> SceneInput:
    """The scene of merged scans, with a merged cloud stored beside them."""
    raw, _ = merged_scene()
    files = {CLOUD_FILE: ply(points)} | ({} if reference is None else {REFERENCE_FILE: reference})
    results = {stage: result.to_json() | {"cloud": CLOUD_FILE} for stage, result in raw.results.items()}
    scene = scene_input(raw.session, lambda _: b"", [], results, files.get)
    return replace(scene, load_scans=raw.load_scans, outputs=tuple(files))


def scans_scene(points: np.ndarray, scans: np.ndarray) -> SceneInput:
    """The same with a cloud that says which scan, s0 or s2, weighs most at each point."""
    scene = fused_scene()
    names = ("x", "y", "z", "scan")
    data = b"".join(bytes(piece) for piece in ply_pieces(np.column_stack([points, scans]), names))
    merge = scene.results["merge"]
    assert isinstance(merge, MergeResult)
    rows = [row.model_copy(update={"points": 500}) for row in merge.residuals]
    merge = merge.model_copy(update={"residuals": rows})
    return replace(
        scene, results={"merge": merge}, load_merged=lambda: merged_cloud({"merge": merge}, {CLOUD_FILE: data}.get)
    )


def drawn(facts: SceneFacts, view: CloudView | None = None) -> dict[str, Node]:
    return draw(facts, look_at(facts, cloud=view))


def points_of(nodes: dict[str, Node]) -> np.ndarray:
    """The points of the merged cloud in its own frame, mm."""
    chunks = [
        node for name, node in nodes.items() if name.startswith("/scans/merged/") and "points" in node.arguments
    ]
    clouds = [c for c in chunks if c.method == "add_point_cloud"]
    return np.concatenate([(c.arguments["points"].astype(float) + c.arguments["position"]) * 1000 for c in clouds])


def test_the_stored_cloud_is_drawn_and_the_scans_where_their_colours_are_asked() -> None:
    facts = scene_facts(fused_scene())
    np.testing.assert_allclose(points_of(drawn(facts)), CLOUD, atol=1e-3)
    legend = legend_html(facts, look_at(facts))
    assert "cleaned and merged" in legend
    top = legend.split("</span></div>")[0].rpartition(">")[2]  # of the heights
    assert top.endswith(" mm in T")
    assert catalogue("zh").say(made_lately(top) or top).startswith("T 中 ")
    by_scan = drawn(facts, CloudView("by scan"))
    assert len(points_of(by_scan)) == 1000  # two scans of 500 points
    assert "as they were measured" in legend_html(facts, look_at(facts, cloud=CloudView("by scan")))


def test_a_cloud_that_knows_its_scans_is_coloured_by_them() -> None:
    numbers = np.where(np.arange(len(CLOUD)) < 10, -1, CLOUD[:, 0] > 0)
    facts = scene_facts(scans_scene(CLOUD, numbers))
    view = CloudView("by scan")
    nodes = drawn(facts, view)
    np.testing.assert_allclose(points_of(nodes), CLOUD, atol=1e-3)
    colors = nodes["/scans/merged/0"].arguments["colors"]
    np.testing.assert_array_equal(colors, np.array([*SCANS[:2], WAITING])[numbers])
    legend = legend_html(facts, look_at(facts, cloud=view))
    assert "cleaned and merged" in legend
    assert "weighs most" in legend
    assert all(name in legend for name in ("s0", "s2"))
    assert "s1" not in legend


def test_details_have_the_colours_of_their_scans() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(-50, 50, (MAX_SCAN_POINTS + 400_000, 3))
    facts = scene_facts(scans_scene(points, (points[:, 0] > 0).astype(float)))
    place = cloud_place(facts, look_at(facts))
    assert place is not None
    eye, target = place.apply(np.array([[0.0, 0.0, 120.0], [0.0, 0.0, 40.0]]))
    node = detail(facts, look_at(facts, cloud=CloudView("by scan")), Gaze(eye, target, 0.6))
    assert node is not None
    inside = node.arguments["points"][:, 0] * 1000 + node.arguments["position"][0] * 1000
    sure = np.abs(inside) > 1e-3
    np.testing.assert_array_equal(
        node.arguments["colors"][sure], np.array(SCANS[:2], dtype=np.uint8)[(inside[sure] > 0).astype(int)]
    )


def test_a_cloud_of_another_merge_than_its_result_is_not_taken_for_its_scans() -> None:
    scene = scans_scene(CLOUD, np.full(len(CLOUD), 7.0))
    merged = scene_facts(scene).merged
    assert merged is not None
    assert len(merged.scan) == 0
    np.testing.assert_allclose(merged.points_mm, CLOUD, atol=1e-4)


def test_a_large_cloud_is_thinned_evenly_and_said_to_be() -> None:
    rng = np.random.default_rng(1)
    facts = scene_facts(fused_scene(rng.uniform(-50, 50, (MAX_SCAN_POINTS + 200_001, 3))))
    shown = points_of(drawn(facts))
    assert len(shown) == MAX_SCAN_POINTS
    assert np.abs(shown.mean(axis=0)).max() < 0.3
    counts = [f"{count:,}".replace(",", "\u202f") for count in (MAX_SCAN_POINTS, MAX_SCAN_POINTS + 200_001)]
    assert f"{counts[0]} of {counts[1]} points" in legend_html(facts, look_at(facts))  # no comma: German readers


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_section_hides_one_side_and_keeps_the_colours(axis: str) -> None:
    facts = scene_facts(fused_scene())
    number = "xyz".index(axis)
    for keep, side in (("below", -1), ("above", 1)):
        section = Section(axis, 12.0, keep)  # pyright: ignore[reportArgumentType]
        nodes = drawn(facts, CloudView("by height", section))
        along = points_of(nodes)[:, number]
        assert len(along) == int((side * (CLOUD[:, number] - 12.0) >= 0).sum())
        assert (side * (along - 12.0) >= -1e-3).all()
        assert "/scans/merged/cut" in nodes
        assert f"Cut at {axis} = 12.0 mm" in legend_html(facts, look_at(facts, cloud=CloudView(section=section)))
    assert facts.merged is not None
    assert height_range_mm(facts.merged)[1] > 50  # of the whole cloud, not of what is left of it


def test_a_click_meets_the_surface_that_is_seen_and_no_stray_before_it() -> None:
    stray = [[3.0, 2.0, 90.0]]
    facts = scene_facts(fused_scene(np.concatenate([CLOUD, stray])))
    place = cloud_place(facts, look_at(facts))
    assert place is not None
    eye = place.apply(np.array([3.0, 2.0, 300.0])) / 1000
    down = place.rotation @ np.array([0.0, 0.0, -2.0])
    point = picked_on_cloud(facts, look_at(facts), eye, down)
    assert point is not None
    assert abs(np.linalg.norm(point - BALL_MM) - RADIUS_MM) < 0.1
    np.testing.assert_allclose(point[:2], [3.0, 2.0], atol=0.01)
    cut = CloudView(section=Section("z", 20.0))  # the ball is cut away
    point = picked_on_cloud(facts, look_at(facts, cloud=cut), eye, down)
    np.testing.assert_allclose(point, [3.0, 2.0, 10.0], atol=0.01)
    assert picked_on_cloud(facts, look_at(facts), eye, -down) is None


def test_a_section_by_a_picked_plane_cuts_along_its_normal() -> None:
    section = section_of("z", 5.0, normal=[1.0, 2.0, 2.0])
    directions = section.directions
    np.testing.assert_allclose(directions @ directions.T, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(np.cross(directions[0], directions[1]), directions[2], atol=1e-12)
    facts = scene_facts(fused_scene())
    view = CloudView(section=section, picked_mm=((0.0, 0.0, 52.0),))
    nodes = drawn(facts, view)
    assert len(points_of(nodes)) == int((CLOUD @ [1, 2, 2] / 3 <= 5.0).sum())
    assert "/scans/merged/picked/0" in nodes
    border = (nodes["/scans/merged/cut"].arguments["points"] * 1000).reshape(-1, 3)
    np.testing.assert_allclose(border @ [1, 2, 2] / 3, 5.0, atol=1e-3)
    with pytest.raises(InputError, match="normal"):
        section_of("z", 5.0, normal=[0.0, 0.0, 0.0])


def live_colors(scene: SceneInput, view: CloudView, look: Callable[[np.ndarray], None]) -> str:
    live = LiveScene(scene)
    try:
        live.show_cloud(view)
        look(np.asarray(live._handles["/scans/merged/0"].colors))  # pyright: ignore[reportPrivateUsage]
        return live.legend
    finally:
        live.stop()


def test_deviations_from_a_mesh_are_blue_inside() -> None:
    reference = ply(REFERENCE, np.array([[0, 1, 2], [0, 2, 3]]))
    scene = fused_scene(PLATE, reference)

    def all_blue(colors: np.ndarray) -> None:
        assert (colors[:, 2] > colors[:, 0]).all()
        assert tuple(colors[0]) == DIVERGING[0]

    legend = live_colors(scene, CloudView("by deviation"), all_blue)
    assert "Distance to the reference mesh" in legend
    assert "RMS 0.200 mm over 6561 points" in legend
    assert "200 µm" in legend


def test_a_tolerance_makes_five_bands_and_the_legend_says_their_shares() -> None:
    values = np.array([-0.31, -0.3, -0.16, -0.15, 0.0, 0.1, 0.15, 0.151, 0.3, 0.4, np.nan])
    found = CloudDeviation(values, 1.0, "it", Deviations(values), lambda points: points[:, 0], 0.3)
    look = Look(0.1, deviation=found)
    colors = deviation_colors(values, len(values), look)
    expected = [*(DIVERGING[band] for band in (0, 1, 1, 2, 2, 2, 2, 3, 3, 4)), WAITING]
    assert colors.tolist() == [list(color) for color in expected]
    scene = fused_scene(PLATE, ply(REFERENCE, np.array([[0, 1, 2], [0, 2, 3]])))
    mesh = scene.load_reference()
    assert mesh is not None
    scene = replace(scene, load_reference=lambda: replace(mesh, tolerance_mm=0.3))

    def one_band(colors: np.ndarray) -> None:
        assert (colors == DIVERGING[1]).all()

    legend = live_colors(scene, CloudView("by deviation"), one_band)
    assert "−300 µm to −150 µm: 100.0 %" in legend
    assert "above +300 µm: 0.0 %" in legend
    assert "Distance to the reference mesh" in legend


def test_deviations_from_the_sphere_leave_the_rest_grey() -> None:
    def plate_grey(colors: np.ndarray) -> None:
        assert (colors[: len(PLATE)] == WAITING).all()
        assert len(np.unique(colors[len(PLATE) :], axis=0)) > 50

    view = CloudView("by deviation", against=Against("sphere", 2 * RADIUS_MM))
    legend = live_colors(fused_scene(), view, plate_grey)
    assert "the sphere, diameter 24.000 mm as known" in legend
    assert "RMS 0.010 mm" in legend


def test_without_a_reference_or_a_sphere_the_legend_says_so() -> None:
    def grey(colors: np.ndarray) -> None:
        assert (colors == WAITING).all()

    assert "a reference mesh" in live_colors(fused_scene(PLATE), CloudView("by deviation"), grey)
    view = CloudView("by deviation", against=Against("sphere", 5.0))
    assert "No deviations" in live_colors(fused_scene(PLATE), view, grey)


def test_the_cloud_is_read_once_and_again_after_another_merge() -> None:
    read: list[int] = []
    scene = fused_scene()
    counted = replace(scene, load_merged=lambda: (read.append(1), scene.load_merged())[1])
    live = LiveScene(counted)
    try:
        live.update(counted)
        live.highlight("s0")
        assert len(read) == 1
        live.update(replace(counted, outputs=("clouds/merged.ply another",)))
        assert len(read) == 2
    finally:
        live.stop()


def test_the_view_of_the_object_holds_it_and_little_else() -> None:
    facts = scene_facts(fused_scene())
    assert facts.table is not None
    seen, table = view("Object", facts), view("Axes", facts)
    corners = facts.table.base_from_turntable.apply(CLOUD) / 1000 - seen.position_m
    ahead = seen.look_at_m - seen.position_m
    angles = np.arccos(corners @ ahead / np.linalg.norm(corners, axis=1) / np.linalg.norm(ahead))
    assert 0.5 < angles.max() / (FIELD_OF_VIEW_RAD / 2) < 1.05
    assert np.linalg.norm(ahead) < np.linalg.norm(table.look_at_m - table.position_m)
    without = replace(facts, merged=None)
    np.testing.assert_array_equal(view("Object", without).position_m, view("Captures", without).position_m)


def test_the_view_of_a_held_part_is_where_it_is_drawn() -> None:
    facts = scene_facts(fused_scene())
    assert facts.merged is not None
    held = replace(facts, merged=replace(facts.merged, frame="tool0"))
    points = drawn(held)
    root = np.array(points["/scans/merged"].arguments["position"])
    seen = view("Object", held)
    assert np.linalg.norm(root) > 0.3  # m: where the flange was, far from base
    assert np.linalg.norm(seen.look_at_m - root) < 0.15
    np.testing.assert_allclose(view("Axes", replace(held, table=None)).look_at_m, seen.look_at_m, atol=0.05)


def test_heights_run_from_dark_to_light() -> None:
    facts = scene_facts(fused_scene())
    colors = drawn(facts)["/scans/merged/0"].arguments["colors"]
    assert tuple(colors[np.argmin(CLOUD[:, 2])]) == VIRIDIS[0]
    assert tuple(colors[np.argmax(CLOUD[:, 2])]) == VIRIDIS[-1]
