"""The guide of the turntable: angles, heights, table, chain; and that of camera and laser plane."""

from typing import Any

import numpy as np
import pytest

from calib_core.captures.measure import measure_capture
from calib_core.errors import ConflictError
from calib_core.graph.keys import Graph, stage_captures
from calib_core.guidance.pose_list import planned_poses
from calib_core.records import Guide, Measured, Session
from calib_core.records.guidance import Meter
from calib_core.simulation import TOPOLOGY_SCENARIOS, simulate
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.guide import guide
from calib_core.stages.turntable.guide import _has_tcp, _suggested_deg, _words


@pytest.fixture(scope="module")
def cell() -> Session:
    return simulate("turntable", 4).session


def guided(session: Session, results: dict[str, Any] | None = None, refused: tuple[str, ...] = ()) -> Guide:
    measured = [
        Measured(capture=c.id, kind=c.kind, verdict="fail" if c.id in refused else "pass")
        for c in session.captures
    ]
    return guide(session, measured, results or {}, Graph(session, str).stale(results or {}))


def result_of(session: Session, stage: str, **more: Any) -> dict[str, Any]:
    rows = [{"capture": c.id, "used": True} for c in stage_captures(session, stage) if not c.excluded]
    key = Graph(session, str).key(stage)
    base = {
        "stage": stage,
        "inputs_sha256": key,
        "verdict": "pass",
        "warnings": [],
        "undetermined": [],
        "residuals": rows,
    }
    return base | {"sphere_center_in_base_mm": [900.0, 120.0, 400.0]} | more


def after_tcp(cell: Session, turning: int) -> tuple[Session, dict[str, Any]]:
    """The session with all TCP captures, solved, and so many of the turntable's."""
    session = cell.model_copy(update={"captures": cell.captures[: 14 + turning]})
    return session, {"tcp": result_of(session, "tcp")}


def test_every_capture_on_the_table_leaves_fewer_to_take(cell: Session) -> None:
    seen = [guided(*after_tcp(cell, k)).current for k in range(17)]
    assert [now.still_needed for now in seen] == list(range(16, -1, -1))
    assert [now.action for now in seen] == ["capture"] * 16 + ["solve"]
    assert [now.drawing for now in seen] == [
        "turntable-first", *["turntable-turn"] * 7, "turntable-height", *["turntable-turn"] * 7, "turntable-solve",
    ]  # fmt: skip
    assert all(now.step == "turntable" and now.why and now.exit for now in seen)
    # What it suggests is what the simulated table does next.
    for k in (*range(1, 8), *range(9, 16)):
        assert f"about {cell.captures[14 + k].table_deg:.0f}°" in seen[k].instruction
    assert "'high'" in str(seen[9].progress)


def test_what_does_not_count(cell: Session) -> None:
    session, results = after_tcp(cell, 8)
    assert guided(session, results, refused=("t03",)).current.still_needed == 9
    same = [c.model_copy(update={"table_deg": 45.0}) if c.step == "turntable" else c for c in session.captures]
    now = guided(session.model_copy(update={"captures": same}), results).current
    assert (now.still_needed, now.progress) == (15, "1 of 8 angles at height 'low'")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"table_deg": None}, "table's angle of t03"),
        ({"pose": None}, "robot's pose of t03"),
        ({"pose": [1.0, 2.0]}, "robot's pose of t03"),
    ],
)
def test_what_is_missing_comes_first(cell: Session, change: dict[str, Any], words: str) -> None:
    session, results = after_tcp(cell, 5)
    captures = [c.model_copy(update=change) if c.id == "t03" else c for c in session.captures]
    assert words in guided(session.model_copy(update={"captures": captures}), results).current.instruction


def test_radians_are_named() -> None:
    session, results = after_tcp(simulate("turntable-radians", 4).session, 16)
    now = guided(session, results).current
    assert "radians" in now.why
    assert f"table's angle in degrees of {session.captures[-1].id}" in now.instruction


def test_small_angles_of_whole_degrees_are_no_radians(cell: Session) -> None:
    session, results = after_tcp(cell, 16)
    numbers = {c.id: number for number, c in enumerate(session.captures)}
    small = [
        c.model_copy(update={"table_deg": float(numbers[c.id] % 6 + 1)}) if c.step == "turntable" else c
        for c in session.captures
    ]
    assert "radians" not in guided(session.model_copy(update={"captures": small}), results).current.why
    small = [c.model_copy(update={"table_deg": c.table_deg and c.table_deg + 0.1}) for c in small]
    assert "radians" in guided(session.model_copy(update={"captures": small}), results).current.why


def test_table_then_chain_then_review(cell: Session) -> None:
    session, results = after_tcp(cell, 16)
    assert (guided(session, results).current.action, guided(session, results).current.stage) == (
        "solve",
        "turntable",
    )
    table = results | {"turntable": result_of(session, "turntable")}
    now = guided(session, table).current
    assert (now.action, now.stage, now.drawing) == ("solve", "chain", "chain-solve")
    failed = results | {"turntable": result_of(session, "turntable", verdict="fail", warnings=["The table slips"])}
    assert (guided(session, failed).current.action, guided(session, failed).current.why) == (
        "review",
        "The table slips.",
    )
    solved = table | {"chain": result_of(session, "chain")}
    now = guided(session, solved).current
    assert (now.action, now.drawing, now.step) == ("capture", "scan-first", "scan")
    statuses = {s.step: s.status for s in guided(session, solved).steps}
    assert (statuses["tcp"], statuses["turntable"]) == ("done", "done")
    refused = table | {"chain": result_of(session, "chain", verdict="fail")}
    statuses = {s.step: s.status for s in guided(session, refused).steps}
    assert (statuses["tcp"], statuses["turntable"]) == ("done", "done")
    fewer = session.model_copy(update={"captures": session.captures[:-1]})
    statuses = {s.step: s.status for s in guided(fewer, solved).steps}
    assert (statuses["tcp"], statuses["turntable"]) == ("done", "stale")
    assert guided(fewer, solved).current.still_needed == 1


def test_a_tool_that_was_given_needs_no_chain(cell: Session) -> None:
    known = cell.cell.known.model_copy(
        update={"tool0_from_laser": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    )
    turning = [c for c in cell.captures if c.step == "turntable"]
    session = cell.model_copy(update={"captures": turning, "cell": cell.cell.model_copy(update={"known": known})})
    assert guided(session).current.stage == "turntable"
    failed = guided(session, {"turntable": result_of(session, "turntable", verdict="fail")}).current
    assert (failed.step, failed.action) == ("turntable", "review")
    assert guided(session, {"turntable": result_of(session, "turntable")}).current.step == "scan"


def test_a_slide_is_drawn_as_one() -> None:
    made = simulate("slide", 1).session
    still = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    known = made.cell.known.model_copy(update={"tool0_from_laser": still})
    moved = [one for one in made.captures if one.step == "turntable"][:2]
    session = made.model_copy(update={"captures": moved, "cell": made.cell.model_copy(update={"known": known})})
    now = guided(session).current
    assert (now.step, now.drawing) == ("turntable", "slide")


def frames(camera: int, plane: int, board: bool = True) -> Session:
    captures = [
        {"id": f"{step[0]}{k:02d}", "step": step, "kind": "frame", "files": [f"captures/{step[0]}{k:02d}.png"]}
        for step, count in (("camera", camera), ("laser-plane", plane))
        for k in range(count)
    ]
    cell: dict[str, Any] = {"pose_convention": "abb", "scanner": {"kind": "frame"}}
    if board:
        cell["board"] = {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 9.0}
    return Session.model_validate({"cell": cell, "captures": captures})


def seen_at(session: Session, *boxes: tuple[float, float, float]) -> list[Measured]:
    """Boards of which corners were seen in squares: left, top and width."""
    return [
        Measured(
            capture=c.id, kind="frame", verdict="pass", image_size=(600, 600),
            preview=[[x + w * i / 8, y + w * j / 8] for i in range(9) for j in range(9)],
        )
        for c, (x, y, w) in zip(session.captures, boxes, strict=True)
    ]  # fmt: skip


def test_the_camera_is_led_over_the_image_and_the_distances() -> None:
    assert "board" in guided(frames(0, 0, board=False)).current.instruction
    assert "middle" in guided(frames(0, 0)).current.instruction
    two = frames(2, 0)
    now = guide(two, seen_at(two, (10, 10, 280), (310, 310, 280)), {}).current
    assert "upper right" in now.instruction
    three = frames(3, 0)
    same_size = seen_at(three, (10, 10, 560), (15, 10, 560), (10, 15, 560))
    assert "nearer" in guide(three, same_size, {}).current.instruction
    ten = frames(10, 0)
    boxes = [(10.0, 10.0, 560.0), *[(100.0, 100.0, 300.0)] * 9]
    assert guide(ten, seen_at(ten, *boxes), {}).current.action == "solve"
    assert guide(ten, seen_at(ten, *[(10.0, 10.0, 200.0)] * 10), {}).current.action == "capture"


def test_the_plane_waits_for_the_camera_and_the_camera_for_the_stripes() -> None:
    ten = frames(10, 0)
    camera = {"camera": result_of(ten, "camera")}
    now = guided(ten, camera).current
    assert (now.step, now.drawing, now.still_needed) == ("laser-plane", "board-stripe", 8)
    # Boards with the stripe count for the camera too: it is solved again only once they are all there.
    some, all_there = frames(10, 3), frames(10, 8)
    assert (guided(some, camera).current.step, guided(some, camera).current.still_needed) == ("laser-plane", 5)
    now = guided(all_there, camera).current
    assert (now.step, now.action) == ("camera", "solve")
    again = {"camera": result_of(all_there, "camera")}
    assert (guided(all_there, again).current.stage, guided(all_there, again).current.action) == (
        "laser-plane",
        "solve",
    )
    done = again | {"laser-plane": result_of(all_there, "laser-plane")}
    assert guided(all_there, done).current.step == "tcp"


def test_axes_that_a_cell_names_are_asked_for_by_their_readings() -> None:
    cell = simulate("positioner", 4).session
    seen = [guided(*after_tcp(cell, k)).current for k in (0, 4, 8)]
    assert [(now.action, now.still_needed) for now in seen] == [("capture", 8), ("capture", 4), ("solve", 0)]
    assert "one axis at a time" in seen[0].instruction
    results = {stage: result_of(cell, stage) for stage in ("tcp", "turntable", "chain")}
    assert guided(cell, results).current.step == "scan"  # "Give the table's angle" was all that was ever said
    unread = [c.model_copy(update={"axes_deg": {"turn": 5.0}}) if c.id == "p20" else c for c in cell.captures]
    now = guided(cell.model_copy(update={"captures": unread}), results).current
    assert "reading of the axis 'tilt' of p20" in now.instruction


def test_what_a_gantry_leaves_open_is_not_asked_for_beside_a_table() -> None:
    cell = simulate("gantry-turntable", 4).session
    opened = {"up_to_shift": {"covariance": []}, "undetermined": [{"description": "along x"}]}
    tcp = {"tcp": result_of(cell, "tcp", **opened)}
    assert guided(cell, tcp).current.stage == "turntable"
    more = {stage: result_of(cell, stage, **opened) for stage in ("turntable", "chain")}
    assert guided(cell, tcp | more).current.step == "scan"
    alone = simulate("gantry", 4).session
    asked = guided(alone, {"tcp": result_of(alone, "tcp", **opened)}).current
    assert "1 left open" in asked.progress
    assert "if the machine can" in asked.why  # no tilt that a gantry cannot make is asked for


@pytest.mark.parametrize("name", ["two-scanners", "plate", "rail"])
def test_a_set_of_poses_begins_with_what_several_scanners_or_balls_told(name: str) -> None:
    simulated = simulate(name, 4)
    session, truth = simulated.session, simulated.truth
    measured = [measure_capture(session, c, simulated.files.__getitem__) for c in session.captures]
    balls = [{"name": one["name"], "in": "base", "center_mm": one["center_mm"]} for one in truth["spheres"]]
    told = {
        "tool0_from_laser": truth["tool0_from_laser"],
        "sphere_center_in_base_mm": truth["spheres"][0]["center_mm"],
        "frames": truth["frames"],
        "spheres": balls,
        "covariance": np.diag([1e-6] * 3 + [0.01] * 3).tolist(),
    }
    plan = planned_poses(session, measured, {"tcp": result_of(session, "tcp", **told)}, 4)
    reached = [pose.uncertainty_mm or np.inf for pose in plan.poses]
    assert reached == sorted(reached, reverse=True)
    assert reached[0] < 0.5  # ± 9 mm, or not determined, were told beside a result of ± 0.2 mm
    assert all(pose.approach_numbers for pose in plan.poses)


def test_a_set_of_poses_before_anything_is_known_of_a_scanner_that_stands_still_is_refused_in_a_sentence() -> None:
    session = simulate("fixed-scanner-turntable", 4).session
    with pytest.raises(ConflictError, match="the scanner's place and the ball's, known about, got too few"):
        planned_poses(session, [], {}, 4)


def test_where_no_even_step_is_free_the_middle_of_the_widest_gap_is_asked_for_across_zero_too() -> None:
    taken = [20.0, 65.0, 110.0, 155.0, 200.0, 245.0, 290.0, 325.0]
    assert _suggested_deg(taken) == pytest.approx((325 + 380) / 2)
    assert _suggested_deg(taken[:-1]) == pytest.approx(335)


@pytest.mark.parametrize(("step", "chained"), [("tcp", True), ("camera", False), ("verify", False)])
def test_a_chain_is_solved_with_the_table_where_captures_of_the_tool_are_there(step: str, chained: bool) -> None:
    session = simulate("turntable", 4).session
    captures = [c.model_copy(update={"step": step if c.step == "tcp" else c.step}) for c in session.captures]
    assert _has_tcp(session.model_copy(update={"captures": captures})) == chained


def test_a_rail_under_the_robot_asks_for_no_table() -> None:
    session = simulate_topology(TOPOLOGY_SCENARIOS["rail"], "rail", 3)[0]
    assert next(one for one in guide(session, [], {}).steps if one.step == "turntable").status == "not-needed"


def test_the_meter_says_how_well_it_is_known_and_what_is_wanted_where_that_is_told() -> None:
    alone, wanted = _words(Meter(uncertainty_mm=0.31)), _words(Meter(uncertainty_mm=0.31, wanted_mm=0.2))
    assert "0.31" in alone
    assert wanted.startswith(f"{alone}, wanted")
    assert "0.2" in wanted.removeprefix(alone)
