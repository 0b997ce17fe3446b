"""The graph of results: a change makes stale exactly the stages that read it, over the whole cell and capture."""

import hashlib
import json
from typing import Any

import pytest
from pydantic import BaseModel

from calib_core.errors import InputError
from calib_core.graph.keys import Graph, inputs_sha256_of_0_1_0
from calib_core.graph.registry import STAGES, stages
from calib_core.records import Capture, Cell, Session, parse_session
from calib_core.simulation import simulate

ALL = {stage.name for stage in stages()}
OPTICS = {"camera", "laser-plane"}
SPHERE = ALL - OPTICS - {"hand-eye"}  # the tool, and all that rests on it; no board is fixed here
TABLE = {"turntable", "chain", "verify", "recheck", "merge"}
NONE: set[str] = set()
UNMOVED = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
POSE = [900.0, 10.0, 700.0, 170.0, 5.0, 30.0]


def session_of(**cell: Any) -> Session:
    """A session with captures of every step, all of points."""
    captures: list[dict[str, Any]] = [
        {"id": "c1", "step": "camera", "kind": "frame", "files": ["captures/c1.png"]},
        {"id": "l1", "step": "laser-plane", "kind": "frame", "files": ["captures/l1a.png", "captures/l1b.png"]},
        {"id": "p1", "step": "tcp", "kind": "profile", "files": ["captures/p1.csv"], "pose": POSE},
        {"id": "t1", "step": "turntable", "kind": "profile", "files": ["captures/t1.csv"], "pose": POSE,
         "table_deg": 10.0, "mount": "low"},
        {"id": "v1", "step": "verify", "kind": "profile", "files": ["captures/v1.csv"], "pose": POSE},
        {"id": "s1", "step": "scan", "kind": "cloud", "files": ["captures/s1.ply"], "pose": POSE,
         "table_deg": 0.0},
        {"id": "r1", "step": "recheck", "kind": "profile", "files": ["captures/r1.csv"], "pose": POSE},
    ]  # fmt: skip
    base: dict[str, Any] = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0}
    return parse_session({"format": "scancell-session/1", "cell": base | cell, "captures": captures})


def keys(session: Session) -> dict[str, str]:
    graph = Graph(session, str)
    return {name: graph.key(name) for name in ALL}


def changed_by(before: Session, after: Session) -> set[str]:
    old, new = keys(before), keys(after)
    return {name for name in ALL if old[name] != new[name]}


CELL: dict[str, tuple[Any, set[str]]] = {
    "id": ("cell-4", NONE),
    "arrangement": ("sphere-on-robot", SPHERE),
    "pose_convention": ("fanuc", SPHERE),
    "sphere_diameter_mm": (41.0, SPHERE),
    "sphere_diameter_sigma_mm": (0.01, SPHERE),
    "scanner.kind": ("profile", NONE),
    "scanner.point_sigma_mm": (0.02, SPHERE),
    "scanner.z_axis": ("toward", SPHERE),
    "scanner.errors": ("apply", SPHERE),
    "sphere_class": ("turned", SPHERE),
    "scanners": ({"left": {"point_sigma_mm": 0.1}}, SPHERE),
    "spheres": ([{"name": "a", "diameter_mm": 30.0}], SPHERE),
    "sphere_distances": ([{"between": ["a", "b"], "mm": 100.0}], SPHERE),
    "axes": ([{"name": "tilt", "kind": "rotary"}], SPHERE),
    "known.frames": ([{"into": "base", "outof": "laser", "matrix": UNMOVED}], SPHERE),
    "robot.position_sigma_mm": (0.1, SPHERE),
    "robot.orientation_sigma_deg": (0.1, SPHERE),
    "robot.brand": ("KUKA", NONE),
    "robot.arm": ("ur5e", SPHERE),
    "robot.errors": ("apply", SPHERE),
    "turntable.direction": (-1, TABLE),
    "turntable.angle_sigma_deg": (0.1, TABLE),
    "turntable.encoder": ("scale", TABLE),
    "turntable.angles": ("unknown", TABLE),
    "board": ({"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0}, OPTICS),
    "known.camera": ({"camera_matrix": [[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]}, OPTICS),
    "known.laser_plane": ({"normal": [0, 1, 0], "distance_mm": 5.0}, {"laser-plane"}),
    "known.tool0_from_laser": (UNMOVED, SPHERE),
    "known.base_from_laser": (UNMOVED, SPHERE),
    "equipment": ([{"kind": "sphere", "serial": "17"}], NONE),
    "release": ({"needs": ["verify"]}, NONE),
    "known.base_from_turntable": (UNMOVED, TABLE),
    "findings": ({"stored-note": "warning"}, NONE),
    "wanted_mm": (0.2, NONE),
    "workpiece_in_laser_mm": ([0.0, 0.0, 200.0], NONE),
    "workpiece_in_turntable_mm": ([0.0, 0.0, 50.0], NONE),
    "limits.clearance_mm": (50.0, NONE),
    "limits.tilt_deg": (20.0, NONE),
    "limits.turn_deg": (20.0, NONE),
    "limits.reach": ({"low_mm": [0, 0, 0], "high_mm": [1, 1, 1]}, NONE),
    "limits.no_go": ([{"low_mm": [0, 0, 0], "high_mm": [1, 1, 1]}], NONE),
    "nominal": ({"tool_sigma_mm": 5.0}, NONE),
    "scanner.field_of_view": ({"near_mm": 100, "far_mm": 200, "near_width_mm": 50}, NONE),
    "scanner.pitch_mm": (0.1, NONE),
    "verification.tool_mm": (0.5, {"verify"}),
    "verification.form_mm": (0.5, {"verify"}),
    "verification.form_95_mm": (0.5, {"verify"}),
    "verification.size_mm": (0.5, {"verify"}),
    "verification.spacing_mm": (0.5, {"verify"}),
    "verification.flatness_mm": (0.5, {"verify"}),
    "verification.flatness_95_mm": (0.5, {"verify"}),
    "verification.ball_bar_mm": (300.0, {"verify"}),
    "verification.ball_bar_sigma_mm": (0.005, {"verify"}),
    "verification.changes": ([{"at": "then", "field": "tool_mm", "captures": 1}], {"verify"}),
    "merge.voxel_mm": (0.7, {"merge"}),
    "merge.mesh": ("none", {"merge"}),
    "merge.holes": ("fill", {"merge"}),
    "merge.mesh_tolerance_mm": (0.3, {"merge"}),
    "merge.registration": (True, {"merge"}),
    "merge.self_calibration": (True, {"merge"}),
    "merge.memory_mb": (500.0, {"merge"}),
    "merge.reference": ("part.stl", {"merge"}),
    "merge.alignment": ({"method": "none"}, {"merge"}),
    "merge.tolerance_mm": (0.4, {"merge"}),
}  # fmt: skip


def leaves(record: type[BaseModel], path: str = "") -> set[str]:
    """The fields of a record by dotted names; of a part that is always there, its own ones."""
    found: set[str] = set()
    for name, field in record.model_fields.items():
        kind: Any = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            found |= leaves(kind, f"{path}{name}.")
        else:
            found.add(path + name)
    return found


def test_every_field_of_the_cell_and_of_a_capture_is_tried_here() -> None:
    assert set(CELL) >= leaves(Cell)
    assert set(CAPTURE) == set(Capture.model_fields) - {"step"}


def with_field(path: str, value: Any) -> Session:
    name, _, inner = path.partition(".")
    return session_of(**{name: {inner: value} if inner else value})


@pytest.mark.parametrize("path", list(CELL))
def test_a_change_of_the_cell_makes_stale_who_reads_it(path: str) -> None:
    value, stale = CELL[path]
    assert changed_by(session_of(), with_field(path, value)) == stale


# By field: another value, and the stages that read it in a capture of each step: camera, laser-plane, tcp,
# turntable, verify, scan, recheck.  What a stage reads, those that rest on it depend on too.
READ_BY = {
    "c1": OPTICS, "l1": OPTICS, "p1": SPHERE, "t1": TABLE, "v1": {"verify"}, "s1": {"merge"},
    "r1": {"recheck"},
}  # fmt: skip
SPHERES, PLACED = ("p1", "t1", "v1", "r1"), ("p1", "t1", "v1", "r1", "s1")
CAPTURE: dict[str, tuple[Any, tuple[str, ...]]] = {
    "environment": ({"ball_c": 24.0}, NONE),
    "excluded_because": ({"who": "me", "when": "2026-11-23T22:00:00+00:00", "why": "bumped"}, NONE),
    "included_because": ({"who": "me", "when": "2026-11-23T22:05:00+00:00", "why": "good after all"}, NONE),
    "added_because": ({"who": "me", "when": "2026-11-23T22:07:00+00:00"}, NONE),
    "changed_because": ({"who": "me", "when": "2026-11-23T22:08:00+00:00"}, NONE),
    "taken": ("2026-11-23T22:00:00+00:00", NONE),
    "clock": ("server", NONE),
    "id": ("x9", tuple(READ_BY)),
    "kind": ("cloud", tuple(READ_BY)),
    "files": (["captures/other.ply"], tuple(READ_BY)),
    "pose": ([1.0, 2.0, 3.0, 4.0, 5.0, 6.0], PLACED),
    "table_deg": (77.0, ("t1", "s1")),
    "axes_deg": ({"tilt": 12.0}, PLACED),
    "axes_mm": ({"rail": 350.0}, PLACED),
    "mount": ("high", SPHERES),
    "center_mm": ([1.0, 2.0, 3.0], SPHERES),
    "poses": ([POSE], PLACED),
    "timestamps_s": ([0.5], PLACED),
    "pose_track": ([{"t_s": 0.0, "pose": POSE}], PLACED),
    "excluded": (True, tuple(READ_BY)),
    "side": (-1, SPHERES),
    "board_of": ("c1", ()),  # of dark boards, which count no more
    "scanner": ("left", PLACED),
    "format": ("npy", PLACED),
    "format_settings": ({"unit": "mm"}, PLACED),
    "joints_deg": ([1.0] * 6, ()),  # no arm is named that they would be held against
    "joints_mm": ([1.0], ()),
    "device_time_s": (12.0, ("p1",)),
    "active_tool": (3, PLACED),
    "active_frame": (2, PLACED),
    "moving": (True, PLACED),
    "source": ("program.src:12", ()),
}


@pytest.mark.parametrize("field", list(CAPTURE))
@pytest.mark.parametrize("capture", list(READ_BY))
def test_a_change_of_a_capture_makes_stale_who_reads_it(field: str, capture: str) -> None:
    before = session_of()
    value, read_in = CAPTURE[field]
    data = before.to_json()
    record: dict[str, Any] = next(c for c in data["captures"] if c["id"] == capture)
    if record.get(field) == value:
        value = "profile"
    record[field] = value
    after = parse_session(data)
    expected = READ_BY[capture] if capture in read_in else NONE
    assert changed_by(before, after) == expected


def test_an_arm_makes_the_joints_count_and_files_count_by_content() -> None:
    cell = {"robot": {"arm": "ur5e"}}
    before = session_of(**cell)
    data = before.to_json()
    data["captures"][2]["joints_deg"] = [1.0] * 6
    assert changed_by(before, parse_session(data)) == SPHERE
    other = Graph(before, lambda name: "other" if name.endswith("v1.csv") else name)
    assert {name for name in ALL if other.key(name) != keys(before)[name]} == {"verify"}


def test_an_excluded_capture_is_read_by_nobody() -> None:
    data = session_of().to_json()
    data["captures"][2]["excluded"] = True
    before = parse_session(data)
    data["captures"][2] |= {"pose": [0.0] * 6, "files": ["captures/gone.csv"]}
    assert changed_by(before, parse_session(data)) == NONE
    del data["captures"][2]
    assert changed_by(before, parse_session(data)) - {"merge", "verify"} == NONE


def test_a_solver_gets_what_its_key_was_made_of_and_nothing_else() -> None:
    session = session_of(merge={"voxel_mm": 0.7}, robot={"brand": "KUKA", "position_sigma_mm": 0.1})
    given = Graph(session, str).session_for("tcp")
    assert [capture.id for capture in given.captures] == ["p1"]
    assert (given.cell.robot.brand, given.cell.robot.position_sigma_mm) == (None, 0.1)
    assert given.cell.merge.voxel_mm is None
    assert {c.id for c in Graph(session, str).session_for("merge").captures} == {"p1", "t1", "s1"}


@pytest.mark.parametrize("stage", ["tcp", "turntable", "chain", "merge"])
def test_results_of_0_1_0_are_known_to_be_fresh(stage: str) -> None:
    """The hash of version 0.1.0 as it was: the whole cell and the captures of a stage and those it rested on."""
    session = session_of()
    steps = {
        "tcp": {"tcp"}, "turntable": {"tcp", "turntable"}, "chain": {"tcp", "turntable"},
        "merge": {"scan", "tcp", "turntable"},
    }[stage]  # fmt: skip
    captures = [capture for capture in session.captures if capture.step in steps]
    inputs = {
        "stage": stage,
        "cell": session.cell.model_dump(mode="json", exclude_defaults=True),
        "captures": [capture.model_dump(mode="json", exclude_defaults=True) for capture in captures],
        "files": {name: name for capture in captures for name in capture.files},
    }
    text = json.dumps(inputs, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    first = hashlib.sha256(text.encode()).hexdigest()
    assert inputs_sha256_of_0_1_0(session, STAGES.get(stage), str) == first
    assert Graph(session, str).is_fresh(stage, first)
    assert not Graph(session_of(sphere_diameter_mm=41.0), str).is_fresh(stage, first)


def test_a_file_that_cannot_be_read_any_more_makes_its_results_stale() -> None:
    simulated = simulate("tcp", 1)
    whole = Graph.of_files(simulated.session, simulated.files.__getitem__)
    stored = {"tcp": {"inputs_sha256": whole.key("tcp")}, "unheard-of": {"inputs_sha256": "0"}}
    assert whole.stale(stored) == {"unheard-of"}

    def gone(name: str) -> bytes:
        raise InputError("a file", "no such file", "Copy it there.", name)

    assert Graph.of_files(simulated.session, gone).stale(stored) == {"tcp", "unheard-of"}


def test_a_new_field_that_is_not_told_changes_no_key(monkeypatch: pytest.MonkeyPatch) -> None:
    untold, told = session_of(), session_of(nominal={"standoff_mm": 180.0})
    before = keys(untold)
    tcp = STAGES.get("tcp")
    monkeypatch.setattr(type(tcp), "reads", (*tcp.reads, "nominal"))
    assert keys(untold) == before
    assert keys(told)["tcp"] != before["tcp"]
    identity = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    brought = session_of(known={"tool0_from_laser": identity})
    before = keys(brought)
    monkeypatch.setattr(type(tcp), "known", (*tcp.known, "camera"))
    assert keys(brought)["turntable"] == before["turntable"]


def test_topology_that_is_empty_is_not_told_and_changes_no_key() -> None:
    data = session_of().to_json()
    data["cell"] |= {"spheres": [], "sphere_distances": [], "axes": [], "known": {"frames": []}}
    for capture in data["captures"]:
        capture |= {"axes_deg": {}, "axes_mm": {}}
    assert keys(parse_session(data)) == keys(session_of())
