"""The edges of a cell by its record: every topology is listed, and what contradicts itself is one sentence."""

from typing import Any

import pytest

from calib_core.archive.folder import parse_json
from calib_core.captures.contradictions import unfit
from calib_core.cell.axes import axis_that_moved
from calib_core.errors import InputError, MotionError
from calib_core.library.opened import in_memory
from calib_core.records import Capture, parse_capture, parse_cell, parse_session
from calib_core.stages.pipeline import solve_stage
from tests.cell_edges import Edge, Edges, edges_of

POSE = [900.0, 10.0, 700.0, 170.0, 5.0, 30.0]


def captures_of(*told: dict[str, Any]) -> list[Capture]:
    base = {"step": "tcp", "kind": "center", "center_mm": [0.0, 0.0, 200.0], "pose": POSE}
    return [parse_capture({**base, "id": f"p{k}", **one}) for k, one in enumerate(told)]


def edges(*captures: dict[str, Any], **cell: Any) -> Edges:
    return edges_of(parse_cell({"pose_convention": "kuka", **cell}), captures_of(*captures))


def links(edges: tuple[Edge, ...]) -> list[tuple[str, str]]:
    return [(edge.into, edge.outof) for edge in edges]


def names(edges: Edges, into: str, outof: str) -> list[str]:
    return [f"{'-' if against else ''}{edge.outof}" for edge, against in edges.way(into, outof)]


def test_the_plain_cell_has_robot_scanner_and_ball() -> None:
    plain = edges({})
    assert links(plain.all) == [("base", "tool0"), ("tool0", "laser"), ("base", "ball:sphere")]
    assert names(plain, "ball:sphere", "laser") == ["-ball:sphere", "tool0", "laser"]


def test_a_turntable_is_an_axis_and_each_mounting_a_ball_on_it() -> None:
    table = {"step": "turntable", "table_deg": 45.0}
    found = edges({}, {**table, "mount": "low"}, {**table, "mount": "high"})
    assert links(found.of("axis")) == [("base", "turntable")]
    assert links(found.of("place"))[1:] == [("turntable", "ball:low"), ("turntable", "ball:high")]
    assert names(found, "ball:high", "laser") == ["-ball:high", "-turntable", "tool0", "laser"]


def test_a_fixed_scanner_sees_the_ball_on_the_flange() -> None:
    fixed = edges({}, arrangement="sphere-on-robot")
    assert links(fixed.all) == [("base", "tool0"), ("base", "laser"), ("tool0", "ball:sphere-on-flange")]
    told = edges({}, scanners={"gate": {"on": "base"}}, spheres=[{"name": "a", "on": "tool0"}])
    assert links(told.all) == [("base", "tool0"), ("base", "laser:gate"), ("tool0", "ball:a")]


def test_two_scanners_and_three_balls() -> None:
    spheres = [{"name": name, "on": on} for name, on in (("a", None), ("b", "base"), ("c", "tool0"))]
    found = edges({"scanner": "left"}, scanners={"left": {}, "gate": {"on": "base"}}, spheres=spheres)
    assert links(found.of("mount")) == [("tool0", "laser:left"), ("base", "laser:gate")]
    assert [edge.into for edge in found.of("place")] == ["base", "base", "tool0"]
    assert names(found, "laser:gate", "laser:left") == ["-laser:gate", "tool0", "laser:left"]


RAIL = {"name": "rail", "kind": "linear", "carries": "robot"}
TILT, TURN = {"name": "tilt", "kind": "rotary"}, {"name": "turn", "kind": "rotary"}


def test_axes_stand_on_the_one_before_that_carries_the_same() -> None:
    read = {"axes_deg": {"tilt": 10.0, "turn": 30.0}, "axes_mm": {"rail": 500.0}}
    found = edges(
        read, {**read, "axes_mm": {"rail": 0.0}}, axes=[TILT, RAIL, TURN], spheres=[{"name": "a", "on": "turn"}]
    )
    assert links(found.of("axis")) == [("base", "tilt"), ("base", "rail"), ("tilt", "turn")]
    assert links(found.of("pose")) == [("rail", "tool0")]
    assert names(found, "ball:a", "laser") == ["-ball:a", "-turn", "-tilt", "rail", "tool0", "laser"]


def test_tables_beside_each_other_stand_on_base() -> None:
    found = edges(
        {"axes_deg": {"one": 1.0, "two": 2.0}},
        axes=[{"name": "one", "kind": "rotary"}, {"name": "two", "kind": "rotary", "on": "base"}],
    )
    assert links(found.of("axis")) == [("base", "one"), ("base", "two")]


READ = {"axes_deg": {"tilt": 1.0, "turn": 2.0}}
BALLS = [{"name": "a", "diameter_mm": 40.0}, {"name": "b", "diameter_mm": 40.0}]


@pytest.mark.parametrize(
    ("cell", "captures", "sentence"),
    [
        ({"axes": [{**TILT, "on": "turn"}, {**TURN, "on": "tilt"}]}, [READ], r"loop: 'tilt' on 'turn' on 'tilt'"),
        ({"axes": [{**TILT, "on": "tilt"}]}, [READ], r"a loop: 'tilt' on 'tilt'"),
        ({"axes": [{**TILT, "on": "rial"}]}, [READ], r"axes\[tilt\].on: need one of .*got 'rial'"),
        ({"axes": [TILT, {**RAIL, "on": "tilt"}]}, [READ], r"'rail' with `carries: robot` on 'tilt'"),
        ({"axes": [RAIL, {**RAIL, "name": "lift", "on": "base"}]}, [READ], r"one axis that the robot stands on"),
        ({"axes": [TILT, TILT]}, [READ], r"'tilt' twice"),
        ({"axes": [{"name": "tool0", "kind": "rotary"}]}, [READ], r"a name for the axis that no frame has"),
        ({"axes": [TILT]}, [{}, {}], r"readings of the axis 'tilt', got none in any capture"),
        ({"axes": [TILT]}, [READ], r"captures\[p0\].axes_deg: need one of 'tilt', got 'turn'"),
        ({"axes": [RAIL]}, [{"axes_deg": {"rail": 5.0}}], r"need axes_mm, got axes_deg .*is linear"),
        (
            {"axes": [RAIL]},
            [{"axes_mm": {"rail": 0.0}}, {"axes_mm": {"rail": 1.8}}],
            r"of the linear axis 'rail' in mm, got from 0 to 1.8, which looks like metres",
        ),
        ({"spheres": [BALLS[0], BALLS[0]]}, [{}], r"cell.spheres: .*got 'a' twice"),
        ({"spheres": [{**BALLS[0], "on": "plate"}]}, [{}], r"spheres\[a\].on: .*got 'plate'"),
        ({"spheres": BALLS, "sphere_distances": [{"between": ["a", "c"], "mm": 90}]}, [{}], r"got 'c'"),
        ({"spheres": BALLS, "sphere_distances": [{"between": ["a", "b"], "mm": 9}]}, [{}], r"told apart.* 40 mm"),
        ({"spheres": BALLS, "sphere_distances": [{"between": ["a", "a"], "mm": 90}]}, [{}], r"between two balls"),
        (
            {"spheres": BALLS, "sphere_distances": [{"between": ["a", "b"], "mm": 90}] * 2},
            [{}],
            r"each distance once",
        ),
        (
            {"arrangement": "sphere-on-robot", "scanners": {"left": {"on": "tool0"}}},
            [{}],
            r"scanners on base, as the arrangement 'sphere-on-robot' has them, got on tool0",
        ),
        (
            {"arrangement": "sphere-on-robot", "spheres": [{"name": "a", "on": "base"}]},
            [{}],
            r"spheres on tool0, .*got on base",
        ),
        (
            {"arrangement": "scanner-on-robot", "scanners": {"gate": {"on": "base"}}},
            [{}],
            r"scanners on tool0, .*got on base",
        ),
        (
            {"known": {"frames": [{"into": "base", "outof": "rail", "matrix": [[1.0, 0, 0, 0]] * 4}]}},
            [{}],
            r"known.frames: need one of .*got 'rail'",
        ),
    ],
)  # fmt: skip
def test_what_contradicts_itself_is_one_sentence(
    cell: dict[str, Any], captures: list[dict[str, Any]], sentence: str
) -> None:
    with pytest.raises(InputError, match=sentence):
        edges(*captures, **cell)


@pytest.mark.parametrize(
    ("under", "sentence"),
    [(("turn", "tilt"), "loop: 'tilt' on 'turn' on 'tilt'"), (("base", "tlit"), "got 'tlit'")],
)
def test_axes_that_do_not_lead_to_base_are_one_sentence_of_check_and_run(
    under: tuple[str, str], sentence: str
) -> None:
    axes = [{**axis, "on": on} for axis, on in zip((TILT, TURN), under, strict=True)]
    opened = in_memory(
        parse_session(
            {
                "format": "scancell-session/1",
                "cell": {"pose_convention": "kuka", "axes": axes},
                "captures": [one.to_json() for one in captures_of(READ, {"axes_deg": {"tilt": 9.0, "turn": 7.0}})],
            }
        ),
        {},
    )
    assert [finding for finding in opened.check() if finding.severity == "error" and sentence in finding.text]
    with pytest.raises(InputError, match=sentence):
        opened.run()


def test_balls_of_one_diameter_whose_places_are_not_told_are_fine() -> None:
    assert len(edges({}, spheres=BALLS).of("place")) == 2


def test_an_arrangement_that_scanners_agree_with_is_fine() -> None:
    fixed = edges({}, arrangement="sphere-on-robot", scanners={"gate": {}})
    assert links(fixed.of("mount")) == [("base", "laser:gate")]


def test_a_sigma_of_the_wrong_unit_is_refused() -> None:
    with pytest.raises(InputError, match=r"sigma_mm of the linear axis 'rail', got sigma_deg"):
        parse_cell({"pose_convention": "kuka", "axes": [{**RAIL, "sigma_deg": 0.01}]})


def test_a_name_that_stands_twice_in_the_file_is_told() -> None:
    text = b'{"format": "scancell-session/1", "cell": {"scanners": {"left": {}, "left": {"on": "base"}}}}'
    with pytest.raises(InputError, match=r"session.json: need names that differ, got 'left' twice"):
        parse_json(text, "session.json")


def test_a_capture_that_does_not_read_an_axis_is_kept_and_not_used() -> None:
    cell = parse_cell({"pose_convention": "kuka", "axes": [TILT]})
    captures = captures_of({"axes_deg": {"tilt": 1.0}}, {}, {"axes_deg": {"tilt": 9.0}})
    (finding,) = unfit(cell, captures)
    assert (finding.code, finding.captures) == ("capture-without-axis-reading", ["p1"])


def test_an_axis_that_no_tcp_capture_reads_carries_not_their_sphere() -> None:
    cell = parse_cell({"pose_convention": "kuka", "axes": [RAIL, TILT]})
    own = {"axes_mm": {"rail": 100.0}}
    table = {"step": "turntable", **own, "axes_deg": {"tilt": 1.0}}
    assert unfit(cell, captures_of(own, own, table, table)) == []
    found = unfit(cell, captures_of(own, {}, table, {**table, "axes_deg": None}))
    assert [(one.captures, one.values["axis"]) for one in found] == [(["p1"], "rail"), (["p3"], "tilt")]
    told = parse_cell(
        {"pose_convention": "kuka", "axes": [RAIL, TILT], "spheres": [{"name": "sphere", "on": "tilt"}]}
    )
    (finding,) = unfit(told, captures_of(own, own, table))
    assert (finding.captures, finding.values["axis"]) == (["p0", "p1"], "tilt")


def test_too_few_captures_are_told_with_why_others_were_left_out() -> None:
    read = [{**one.model_dump(mode="json", exclude_none=True)} for one in captures_of(*[{}] * 6)]
    read[0]["axes_mm"] = {"rail": 1.0}
    cell = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0, "axes": [RAIL]}
    session = parse_session({"format": "scancell-session/1", "cell": cell, "captures": read})
    with pytest.raises(MotionError, match=r"got 1\. p1–p5 are not used: .* the axis rail stood\. Add the axis's"):
        solve_stage(session, "tcp", {}.__getitem__)


def test_a_sphere_that_is_told_to_ride_on_an_axis_that_moved_is_refused_among_tcp_captures() -> None:
    own = [{"axes_deg": {"tilt": 10.0 * (k // 3)}, "mount": "ab"[k % 2]} for k in range(6)]
    read = [one.model_dump(mode="json", exclude_none=True) for one in captures_of(*own)]
    balls = [{"name": "a", "on": "base"}, {"name": "b", "on": "tilt"}]
    cell = {"pose_convention": "kuka", "sphere_diameter_mm": 40.0, "axes": [TILT], "spheres": balls}
    session = parse_session({"format": "scancell-session/1", "cell": cell, "captures": read})
    with pytest.raises(MotionError, match=r"seems to ride on the axis 'tilt', which moved.*step 'turntable'"):
        solve_stage(session, "tcp", {}.__getitem__)
    assert axis_that_moved(session.cell, session.captures[:3]) is None
    assert axis_that_moved(session.cell, session.captures) == "tilt"
