"""What is drawn of turntable, camera, plane of light and merged scans, each against the truth that made it."""

import io
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from calib_core.frames import FloatArray, RigidTransform
from calib_core.guidance.interim_estimate import TableSoFar
from calib_core.records import parse_session
from server.scenes.cloud_view import CloudColors, CloudView
from server.scenes.colors import LIGHT, REJECTED, SCANS, VIRIDIS
from server.scenes.display_options import look_at
from server.scenes.layers import draw
from server.scenes.legend import legend_html
from server.scenes.live import LiveScene
from server.scenes.merged import KnownScans, merged_scans, thinned
from server.scenes.nodes import Node
from server.scenes.optics import BASE_FROM_CAMERA
from server.scenes.panel import Player
from server.scenes.scene_input import SceneInput
from server.scenes.scene_model import SceneFacts, scene_facts
from server.scenes.stored import scene_input
from server.scenes.views import FIELD_OF_VIEW_RAD, first_view, view
from tests.server.scene_cell import wait_until

TOOL = RigidTransform.of([0.3, -0.2, 0.9], [30.0, -100.0, 120.0], "tool0", "laser")
TABLE = RigidTransform.of([0.05, -0.03, 0.4], [700.0, 120.0, 250.0], "base", "turntable")
RADIUS_MM = 20.0
MOUNTS = {"low": np.array([90.0, 0.0, 60.0]), "high": np.array([0.0, 90.0, 220.0])}
HEAD: dict[str, Any] = {"method": "m", "software": "s", "inputs_sha256": "0" * 64, "verdict": "pass"}


def about_z(angle_deg: float) -> RigidTransform:
    return RigidTransform.of([0.0, 0.0, np.deg2rad(angle_deg)], [0.0, 0.0, 0.0], "turntable", "turntable")


def truth_mm(mount: str, table_deg: float, direction: int) -> FloatArray:
    return (TABLE @ about_z(direction * table_deg)).apply(MOUNTS[mount])


def table_captures(direction: int) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return clouds of the sphere at four angles and two heights, from a scanner 200 mm in front of each."""
    rng = np.random.default_rng(5)
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    for number, (mount, angle) in enumerate((m, a) for m in MOUNTS for a in (0.0, 40.0, 90.0, 200.0)):
        rotation = np.diag([1.0, -1.0, -1.0])
        center = truth_mm(mount, angle, direction)
        laser = RigidTransform.of(rotation, center - rotation @ [0.0, 0.0, 200.0], "base", "laser")
        rays = rng.normal(size=(400, 3)) * [1.0, 1.0, 0.3] - [0.0, 0.0, 1.2]
        rays *= RADIUS_MM / np.linalg.norm(rays, axis=1, keepdims=True)
        name = f"t{number}"
        stream = io.BytesIO()
        np.save(stream, rays + np.array([0.0, 0.0, 200.0]))
        files[f"captures/{name}.npy"] = stream.getvalue()
        pose = laser @ TOOL.inverse()
        captures.append(
            {
                "id": name,
                "step": "turntable",
                "kind": "cloud",
                "files": [f"captures/{name}.npy"],
                "pose": pose.matrix.ravel().tolist(),
                "table_deg": angle,
                "mount": mount,
            }
        )
    return captures, files


def turntable_result(captures: list[dict[str, Any]], direction: int, rejected: str = "t2") -> dict[str, Any]:
    def row(capture: dict[str, Any]) -> dict[str, Any]:
        used = capture["id"] != rejected
        return {
            "capture": capture["id"],
            "used": used,
            "reason": None if used else "the table's angle is off by 3.0°. Read it again.",
            "mount": capture["mount"],
            "table_deg": capture["table_deg"],
            "center_in_base_mm": truth_mm(capture["mount"], capture["table_deg"], direction).tolist(),
        }

    zeros = np.zeros((3, 3)).tolist()
    circle = {
        "mount": "low",
        "center_in_base_mm": TABLE.apply([0.0, 0.0, 60.0]).tolist(),
        "normal_in_base": TABLE.rotate([0.0, 0.0, 1.0]).tolist(),
        "radius_mm": 90.0,
        "circle_rms_mm": 0.0,
        "plane_rms_mm": 0.0,
        "captures": [],
    }
    return {
        **HEAD,
        "stage": "turntable",
        "base_from_turntable": TABLE.to_rows(),
        "axis_direction_in_base": TABLE.rotate([0.0, 0.0, 1.0]).tolist(),
        "axis_point_in_base_mm": TABLE.translation_mm.tolist(),
        "direction": direction,
        "axis_direction_covariance": zeros,
        "axis_point_covariance": zeros,
        "axis_direction_sigma_deg": 0.01,
        "axis_point_sigma_mm": 0.05,
        "mounts": [
            {"mount": m, "center_in_turntable_mm": place.tolist(), "radius_mm": 90.0, "captures": 4}
            for m, place in MOUNTS.items()
        ],
        "circles": [circle],
        "angle_sigma_deg": 0.003,
        "encoder_scale": {"error": 0.0, "sigma": 0.001, "applied": False},
        "radial_rms_mm": 0.0,
        "axial_rms_mm": 0.0,
        "angle_rms_deg": 0.0,
        "covariance": np.zeros((6, 6)).tolist(),
        "tool0_from_laser": TOOL.to_rows(),
        "variance_components": {
            "point_sigma_mm": 0.02,
            "position_sigma_mm": 0.05,
            "orientation_sigma_rad": 0.0,
            "orientation_sigma_deg": 0.0,
        },
        "residuals": [row(capture) for capture in captures],
    }


def scene_of(
    captures: list[dict[str, Any]], files: Mapping[str, bytes], results: Mapping[str, Any], **cell: Any
) -> SceneInput:
    record = {"pose_convention": "matrix", "sphere_diameter_mm": 2 * RADIUS_MM, **cell}
    session = parse_session({"format": "scancell-session/1", "cell": record, "captures": captures})
    return scene_input(session, files.__getitem__, [], results)


def table_scene(direction: int = 1) -> SceneInput:
    captures, files = table_captures(direction)
    results = {"turntable": turntable_result(captures, direction)}
    return scene_of(captures, files, results, known={"tool0_from_laser": TOOL.to_rows()})


def drawn(facts: SceneFacts, picked: str | None = None, **look: Any) -> dict[str, Node]:
    return draw(facts, look_at(facts, picked, **look))


def at_mm(node: Node) -> FloatArray:
    return np.array(node.arguments["position"]) * 1000


@pytest.mark.parametrize("direction", [1, -1])
def test_the_table_has_its_axis_its_circles_and_the_sphere_at_each_angle(direction: int) -> None:
    scene = table_scene(direction)
    nodes = drawn(scene_facts(scene))
    ends = nodes["/table/axis"].arguments["points"][0] * 1000.0
    in_table = TABLE.inverse().apply(ends)
    np.testing.assert_allclose(in_table[:, :2], 0, atol=1e-2)
    assert in_table[0, 2] < 0 < 220 < in_table[1, 2]  # upwards, past both mountings
    for number, place in enumerate(MOUNTS.values()):
        ring = TABLE.inverse().apply(nodes[f"/circles/{number}"].arguments["points"].reshape(-1, 3) * 1000.0)
        np.testing.assert_allclose(np.hypot(ring[:, 0], ring[:, 1]), 90.0, atol=1e-2)
        np.testing.assert_allclose(ring[:, 2], place[2], atol=1e-2)
    paper = TABLE.inverse().apply(nodes["/circles/paper-0"].arguments["points"].reshape(-1, 3) * 1000.0)
    np.testing.assert_allclose(np.linalg.norm(paper - [0, 0, 60.0], axis=1), 90.0, atol=1e-2)
    for capture in scene.session.captures:
        assert capture.table_deg is not None
        center = truth_mm(capture.mount or "", capture.table_deg, direction)
        np.testing.assert_allclose(at_mm(nodes[f"/places/{capture.id}/sphere"]), center, atol=1e-6)
        assert f"{capture.table_deg:g}°" in nodes[f"/places/{capture.id}/angle"].arguments["text"]


def test_mountings_differ_in_colour_and_rejected_places_are_crossed_and_say_why() -> None:
    facts = scene_facts(table_scene())
    nodes = drawn(facts)
    colors = {c: nodes[f"/places/{c}/sphere"].arguments["color"] for c in ("t0", "t1", "t2", "t4")}
    assert colors["t0"] == colors["t1"] != colors["t4"]
    assert colors["t2"] == REJECTED
    assert "/places/t2/cross" in nodes
    assert "/places/t0/cross" not in nodes
    assert "angle is off by 3.0°" in nodes["/places/t2/angle"].arguments["text"]
    assert "sphere high" in legend_html(facts, look_at(facts))


@pytest.mark.parametrize("direction", [1, -1])
def test_points_on_the_turned_sphere_are_coloured_by_their_distance_to_where_the_solution_expects_it(
    direction: int,
) -> None:
    facts = scene_facts(table_scene(direction))
    assert len(facts.captures) == 8
    for capture in facts.captures:
        residuals = facts.residuals_mm(capture)
        assert residuals is not None
        assert len(residuals) == 400
        assert np.abs(residuals).max() < 1e-6  # the points were made on the sphere


@pytest.mark.parametrize("direction", [1, -1])
def test_the_cell_turns_to_a_capture(direction: int) -> None:
    facts = scene_facts(table_scene(direction))
    nodes = drawn(facts, "t3", alone=True)
    assert {n.split("/")[2] for n in nodes if n.startswith("/frames/")} == {"t3"}
    table = nodes["/turned/table"]
    w, x, y, z = table.arguments["wxyz"]
    spoke = np.array([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)])
    expected = (TABLE @ about_z(200.0 * direction)).rotate([1.0, 0.0, 0.0])
    np.testing.assert_allclose(spoke, expected, atol=1e-9)
    # The mounted sphere turns with the table: it is a child of it, at its place in T.
    np.testing.assert_allclose(at_mm(nodes["/turned/table/sphere-0"]), MOUNTS["low"], atol=1e-9)
    assert "/turned/table/sphere-1" not in nodes
    assert "t3" in legend_html(facts, look_at(facts, "t3", alone=True))
    everything = drawn(facts, "t3")
    assert not [n for n in everything if n.startswith("/turned")]
    assert "/frames/t0/flange" in everything
    next_one = drawn(facts, "t2", alone=True)["/turned/table"]
    assert (next_one.looks(), next_one.place() == table.place()) == (table.looks(), False)  # moved, not sent again


def board_poses() -> dict[str, RigidTransform]:
    return {
        f"b{k}": RigidTransform.of([0.1 * k, 0.3, 0.05], [-40.0, -25.0, 300.0 + 60.0 * k], "camera", "board")
        for k in range(4)
    }


def optics_results(with_plane: bool = True) -> dict[str, Any]:
    camera = {
        **HEAD,
        "stage": "camera",
        "model": "plain",
        "image_size": [640, 480],
        "camera_matrix": [[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]],
        "distortion": {},
        "tilt_rad": [0.0, 0.0],
        "reprojection_rms_px": 0.1,
        "corner_sigma_px": 0.1,
        "parameters": [],
        "covariance": [],
        "coverage": {"counts": [[1]], "covered": 1.0, "near_mm": 300.0, "far_mm": 500.0, "largest_tilt_rad": 0.5},
        "residuals": [
            {"capture": name, "used": name != "b1", "camera_from_board": pose.to_rows()}
            for name, pose in board_poses().items()
        ]
        + [{"capture": "b9", "used": False, "reason": "no board"}],
    }
    camera_from_laser = RigidTransform.of([0.0, 0.6, 0.0], [0.0, 5.0, 300.0], "camera", "laser")
    rotation = camera_from_laser.rotation[:, 1]
    plane = {
        **HEAD,
        "stage": "laser-plane",
        "plane_in_camera": {"normal": rotation.tolist(), "distance_mm": 5.0},
        "camera_from_laser": camera_from_laser.to_rows(),
        "plane_rms_mm": 0.05,
        "covariance": np.zeros((6, 6)).tolist(),
        "plane_covariance": np.zeros((4, 4)).tolist(),
        "joint_covariance": [],
        "normal_sigma_deg": 0.05,
        "distance_sigma_mm": 0.05,
        "residuals": [{"capture": "b3", "used": True}],
    }
    return {"camera": camera, "laser-plane": plane} if with_plane else {"camera": camera}


def optics_scene(with_plane: bool = True) -> SceneInput:
    steps = {"b0": "camera", "b1": "camera", "b2": "camera", "b3": "laser-plane"}
    captures = [{"id": i, "step": step, "kind": "frame", "files": [f"{i}.png"]} for i, step in steps.items()]
    board = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 10.0}
    return scene_of(captures, {}, optics_results(with_plane), board=board)


def test_the_camera_sees_its_boards_and_the_plane_of_light_cuts_the_one_with_the_stripe() -> None:
    facts = scene_facts(optics_scene())
    nodes = drawn(facts)
    for name, pose in board_poses().items():
        cloud = nodes[f"/boards/{name}/corners"]
        corners = (cloud.arguments["points"].astype(float) + cloud.arguments["position"]) * 1000
        assert len(corners) == 54
        np.testing.assert_allclose(corners[9], (BASE_FROM_CAMERA @ pose).apply([0.0, 10.0, 0.0]), atol=1e-3)
    assert nodes["/boards/b1/face"].arguments["color"] == REJECTED
    assert nodes["/boards/b3/face"].arguments["color"] == LIGHT
    frustum = nodes["/camera/frustum"].arguments["points"].reshape(-1, 3) * 1000.0
    rays = BASE_FROM_CAMERA.inverse().apply(frustum)
    rays = rays[rays[:, 2] > 1.0]
    np.testing.assert_allclose(np.abs(rays[:, 0] / rays[:, 2]), 320 / 600, atol=1e-4)
    np.testing.assert_allclose(np.abs(rays[:, 1] / rays[:, 2]), 240 / 600, atol=1e-4)
    ends = BASE_FROM_CAMERA.inverse().apply(nodes["/plane/stripes"].arguments["points"].reshape(-1, 3) * 1000.0)
    assert len(ends) == 2
    on_board = board_poses()["b3"].inverse().apply(ends)
    np.testing.assert_allclose(on_board[:, 2], 0.0, atol=1e-2)  # on the board, and within the plane of light
    np.testing.assert_allclose(ends @ optics_results()["laser-plane"]["plane_in_camera"]["normal"], 5.0, atol=1e-2)
    assert first_view(facts) == "Camera"


def test_the_legend_says_what_of_the_camera_is_missing() -> None:
    facts = scene_facts(optics_scene(with_plane=False))
    legend = legend_html(facts, look_at(facts))
    assert "plane of light is not solved yet" in legend
    assert "1 view has no board" in legend
    assert not [n for n in drawn(facts) if n.startswith("/plane")]
    known = {"camera": {"camera_matrix": [[600, 0, 319.5], [0, 600, 239.5], [0, 0, 1]]}}
    brought = scene_facts(scene_of([], {}, {}, known=known))
    assert "not solved here" in legend_html(brought, look_at(brought))
    assert "/camera/frustum" in drawn(brought)


SCAN_FILES: dict[str, bytes] = {}


def merged_scene(points: int = 500, merged: bool = True) -> tuple[SceneInput, FloatArray]:
    """Return three scans of one part, each point measured from a table turned otherwise."""
    rng = np.random.default_rng(3)
    part = rng.uniform([-50, -50, 0], [50, 50, 100], (points, 3))
    laser = RigidTransform.of(np.diag([1.0, -1.0, -1.0]), [690.0, 110.0, 600.0], "base", "laser")
    captures: list[dict[str, Any]] = []
    files: dict[str, bytes] = {}
    for number, angle in enumerate((0.0, 120.0, 240.0)):
        seen = laser.inverse().apply((TABLE @ about_z(angle)).apply(part))
        stream = io.BytesIO()
        np.save(stream, seen)
        files[f"s{number}.npy"] = stream.getvalue()
        pose = (laser @ TOOL.inverse()).matrix.ravel().tolist()
        capture = {"id": f"s{number}", "step": "scan", "kind": "cloud", "files": [f"s{number}.npy"]}
        captures.append({**capture, "pose": pose, "table_deg": angle})
    merge = {
        **HEAD,
        "stage": "merge",
        "frame": "turntable",
        "cloud": None,
        "points": 1,
        "scanned_points": 3 * points,
        "voxel_mm": 0.5,
        "overlap_rms_mm": None,
        "expected_overlap_rms_mm": None,
        "overlap_pairs": 0,
        "mesh": None,
        "low_mm": [0, 0, 0],
        "high_mm": [1, 1, 1],
        "residuals": [{"capture": c["id"], "used": c["id"] != "s1"} for c in captures],
    }
    known = {"tool0_from_laser": TOOL.to_rows(), "base_from_turntable": TABLE.to_rows()}
    SCAN_FILES.update(files)
    return scene_of(captures, files, {"merge": merge} if merged else {}, known=known), part


def test_merged_scans_lie_on_each_other_in_the_tables_frame_and_turn_with_it() -> None:
    scene, part = merged_scene()
    facts = scene_facts(scene)
    assert facts.merged is not None
    assert facts.merged.names == ("s0", "s2")  # the merge used no other
    for number in range(2):
        np.testing.assert_allclose(facts.merged.points_mm[facts.merged.scan == number], part, atol=0.01)
    nodes = drawn(facts)
    cloud = nodes["/scans/merged/0"]
    shown = (cloud.arguments["points"].astype(float) + cloud.arguments["position"]) * 1000
    np.testing.assert_allclose(shown[:500], part, atol=0.01)
    np.testing.assert_allclose(at_mm(nodes["/scans/merged"]), TABLE.translation_mm, atol=1e-9)
    turned = drawn(facts, "s2", alone=True)
    assert turned["/scans/merged"].place() != nodes["/scans/merged"].place()
    assert turned["/scans/merged/0"].fingerprint() == cloud.fingerprint()  # only its frame moves
    assert first_view(facts) == "Axes"
    camera = view("Axes", facts)
    ahead = (camera.look_at_m - camera.position_m) / np.linalg.norm(camera.look_at_m - camera.position_m)
    to_part = TABLE.apply(part) / 1000 - camera.position_m
    angles = np.arccos(to_part @ ahead / np.linalg.norm(to_part, axis=1))
    assert angles.max() < FIELD_OF_VIEW_RAD / 2 * 1.2


@pytest.mark.parametrize(("how", "low", "high"), [("by scan", SCANS[0], SCANS[1]), ("by height", *VIRIDIS[::4])])
def test_scans_are_coloured(how: CloudColors, low: tuple[int, ...], high: tuple[int, ...]) -> None:
    facts = scene_facts(merged_scene()[0])
    assert facts.merged is not None
    colors = drawn(facts, cloud=CloudView(how))["/scans/merged/0"].arguments["colors"]
    order = facts.merged.scan if how == "by scan" else facts.merged.points_mm[:, 2]
    assert tuple(colors[np.argmin(order)]) == low
    assert tuple(colors[np.argmax(order)]) == high
    assert ("z " in legend_html(facts, look_at(facts, cloud=CloudView(how)))) == (how == "by height")


def test_scans_are_thinned_evenly_over_their_length() -> None:
    rows = np.arange(30.0).reshape(-1, 3)
    assert thinned(rows, 100) is rows
    np.testing.assert_array_equal(thinned(rows, 4), rows[[0, 3, 6, 9]])


def test_playing_goes_on_until_it_is_told_to_end() -> None:
    steps: list[int] = []
    player = Player(lambda: steps.append(1), step_s=0.005)
    player.play(True)
    player.play(True)
    wait_until(lambda: len(steps) >= 3)
    player.stop()
    assert not player.playing
    count = len(steps)
    time.sleep(0.05)
    assert len(steps) == count


def test_turning_sends_one_capture_moves_the_table_and_all_comes_back() -> None:
    live = LiveScene(table_scene())
    try:
        before = live.node_names
        live.turn_to(4)
        names = live.node_names
        assert "/turned/table" in names
        assert {n.split("/")[2] for n in names if n.startswith("/frames/")} == {"t3"}
        assert "t3" in live.legend
        live.turn_to(3)
        assert {n.split("/")[2] for n in live.node_names if n.startswith("/frames/")} == {"t2"}
        live.turn_to(0)
        assert live.node_names == before
    finally:
        live.stop()


def test_scans_are_drawn_each_in_its_colour_before_they_are_merged() -> None:
    scene, part = merged_scene(merged=False)
    facts = scene_facts(scene)
    assert facts.merged is not None
    assert facts.merged.names == ("s0", "s1", "s2")
    for number in range(3):
        np.testing.assert_allclose(facts.merged.points_mm[facts.merged.scan == number], part, atol=0.01)
    colors = drawn(facts)["/scans/merged/0"].arguments["colors"]
    assert {tuple(color) for color in colors.tolist()} == set(SCANS[:3])  # whatever a merged cloud is coloured by
    assert "<h2>Scans</h2>" in legend_html(facts, look_at(facts))


def test_a_scan_that_comes_in_is_read_and_the_others_are_not_again() -> None:
    scene, _ = merged_scene(merged=False)
    read: list[str] = []
    known: KnownScans = {}

    def counted(name: str) -> bytes:
        read.append(name)
        return SCAN_FILES[name]

    for count in (2, 3, 2):
        some = scene.session.model_copy(update={"captures": scene.session.captures[:count]})
        found = merged_scans(some, {}, counted, known)
        assert found is not None
        assert len(found.names) == len(known) == count
    assert read == ["s0.npy", "s1.npy", "s2.npy"]


@pytest.mark.parametrize("sigma_mm", [1.0, 0.25])
def test_the_axis_lies_in_a_tube_as_wide_as_it_is_uncertain(sigma_mm: float) -> None:
    """Three captures or more, nothing solved: the tube is k = 2, ten times as large, and opens where it turns."""
    turn = 2e-3
    covariance = np.diag([turn**2, turn**2, 0.0, sigma_mm**2, sigma_mm**2, sigma_mm**2])
    known = TableSoFar(TABLE, covariance, 1, MOUNTS)
    facts = SceneFacts((), TOOL, None, RADIUS_MM, table_so_far=known)
    drawn = draw(facts, look_at(facts))
    tube = drawn["/table-so-far/axis-tube"]
    rings = 1000.0 * np.array(tube.arguments["vertices"]).reshape(9, 24, 3)
    heights = rings[:, 0, 2]
    width = np.linalg.norm(rings[:, :, :2], axis=2)
    expected = 2 * 10 * np.hypot(sigma_mm, turn * heights)
    np.testing.assert_allclose(width, np.minimum(expected, 25.0)[:, None] * np.ones(24), rtol=1e-3)
    assert "axis by now" in legend_html(facts, look_at(facts))
    assert "/table-so-far/circle-1" in drawn
