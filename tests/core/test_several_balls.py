"""Several balls in one view: arcs told apart, each ball found, told distances used as measurements."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from bench_trouble import outcome

import calib_core as cc
from calib_core.cell.layout import KnownDistance
from calib_core.chain.balls import by_distances, wrong_distance
from calib_core.errors import MotionError
from calib_core.library.opened import in_memory
from calib_core.records.results import FoundFrame, ScannerFound
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.topology import AxisOptions, BallOptions, ScannerOptions
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.simulation.topology_scenarios import TOPOLOGY_SCENARIOS
from calib_core.simulation.topology_wanted import TopologyScenario
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.turntable import solve
from tests.plates import reflected
from tests.topology_errors import distances
from tests.trouble import all_troubles

CHI2 = {3: 21.1, 6: 27.9}  # 99.99 %


def within(result: TcpResult, truth: dict[str, Any]) -> Iterator[tuple[str, str]]:
    assert {ball.carrier for ball in result.spheres} == {"base"}
    for ball in result.spheres:
        off = [np.array(ball.center_mm) - one["center_mm"] for one in truth["spheres"]]
        nearest = int(np.argmin(np.linalg.norm(off, axis=1)))
        squared = off[nearest] @ np.linalg.solve(np.array(ball.covariance), off[nearest])
        assert squared < CHI2[3], ball.name
        yield ball.name, truth["spheres"][nearest]["name"]


def test_balls_of_a_plate_are_told_apart_without_being_named() -> None:
    simulated, truth = cc.simulate("plate", 2)
    result = simulated.run()["tcp"]
    assert result.verdict == "pass"
    assert all(row.used and row.profiles is None for row in result.residuals)
    assert sorted(true for _, true in within(result, truth)) == ["a", "b", "c"]
    assert {ball.name for ball in result.spheres} == {"sphere-1", "sphere-2", "sphere-3"}
    ((_, squared, _, _),) = distances(with_frame(result), truth)
    assert squared < CHI2[6]


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [1, 3])
def test_a_round_thing_that_goes_along_with_the_ball_is_told_from_it(seed: int) -> None:
    found = outcome(all_troubles()["sphere: a second sphere in view"], seed)
    (warning,) = found.warnings
    assert "another arc, more clearly than that of the sphere" in warning
    assert found.worst < 1.5  # 36 and 20 while clearest arcs counted


def with_frame(result: TcpResult) -> TcpResult:
    """Return a result of one scanner with its pose among its frames."""
    frame = {"into": "tool0", "outof": "laser", "matrix": result.tool0_from_laser, "covariance": result.covariance}
    return result.model_copy(update={"frames": [FoundFrame.model_validate(frame)]})


@pytest.mark.thorough
def test_told_distances_name_the_balls_and_find_the_scale() -> None:
    simulated, truth = cc.simulate("plate-distances", 2)
    result = simulated.run()["tcp"]
    assert dict(within(result, truth)) == {"a": "a", "b": "b", "c": "c"}
    assert isinstance(result.scanner, ScannerFound)
    found = dict(zip(result.scanner.names, result.scanner.values, strict=True))
    assert found["scale_x"] == pytest.approx(1 / 1.003 - 1, abs=0.001)


def test_distances_that_differ_and_fit_two_ways_name_nothing() -> None:
    corners, names = np.array([[0.0, 0, 0], [60, 0, 0], [0, 60, 0]]), ["a", "b", "c"]
    sure = 0.01 * np.eye(9)
    ab, ac = KnownDistance("a", "b", 60.0, 0.01), KnownDistance("a", "c", 60.0, 0.01)
    assert by_distances(corners, sure, names, [ab, ac]) == [["a", "b", "c"], ["a", "c", "b"]]
    assert by_distances(corners, sure, names, [ab, KnownDistance("a", "c", 60.5, 0.01)]) == []
    wrong = KnownDistance("a", "c", 70.0, 0.1)
    assert by_distances(corners, sure, names, [ab, KnownDistance("b", "c", 84.85, 0.01), wrong]) == []
    far = corners * [1, 1.5, 1]
    assert by_distances(far, sure, names[::-1], [ab, KnownDistance("a", "c", 90.0, 0.01)]) == [names]


def test_distances_that_differ_by_more_than_what_was_found_errs_name_the_balls() -> None:
    row, names = np.array([[0.0, 0, 0], [62.2, 0, 0], [123.4, 0, 0]]), ["a", "b", "c"]
    told = [KnownDistance("a", "b", 62.0, 0.01), KnownDistance("b", "c", 61.0, 0.01)]
    sure = 0.01 * np.eye(9)
    scale = np.outer(row.ravel(), row.ravel()) * 0.005**2  # all may be longer by as much
    assert by_distances(row, sure + scale, names, told) == [names]
    assert by_distances(row, 40 * sure + scale, names, told) == []


def test_the_distance_that_contradicts_the_others_is_named() -> None:
    row, names = np.array([[0.0, 0, 0], [60.0, 0, 0], [118.0, 0, 0]]), ["a", "b", "c"]
    sure = 0.02**2 * np.eye(9) + np.outer(row.ravel(), row.ravel()) * 0.005**2
    told = [KnownDistance(*pair, mm, 0.01) for pair, mm in (("ab", 61.0), ("bc", 58.0), ("ac", 118.0))]
    assert by_distances(row, sure, names, told) == []
    assert wrong_distance(row, sure, names, told) == (told[0], 60.0)
    assert wrong_distance(row, sure, names, told[:2]) is None  # either of the two


@pytest.mark.thorough
def test_a_distance_told_a_millimetre_wrong_is_named_first_and_left_out() -> None:
    simulated, truth = cc.simulate("plate-distances", 2)
    record = simulated.record
    one, *others = record.cell.sphere_distances or []
    told = [one.model_copy(update={"mm": one.mm + 1.0}), *others]
    record = record.model_copy(update={"cell": record.cell.model_copy(update={"sphere_distances": told})})
    result = in_memory(record, {name: simulated.read(name) for c in record.captures for name in c.files}).run()[
        "tcp"
    ]
    first = result.findings[0]
    assert (first.code, first.severity) == ("sphere-distances-not-used", "warning")
    assert [first.values["first"], first.values["second"]] == [*one.between]
    assert abs(float(first.values["found_mm"]) - one.mm) < 0.3  # its scanner's scale is 0.3 % off
    assert result.verdict == "warn"
    assert all(row.used for row in result.residuals)
    assert all(squared < CHI2[6] for _, squared, _, _ in distances(result, truth))


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [7, 29])
def test_two_distances_that_differ_by_two_millimetres_name_the_balls(seed: int) -> None:
    simulated, truth = cc.simulate("plate-distances", seed)
    result = simulated.run()["tcp"]
    assert "sphere-distances-not-used" not in {finding.code for finding in result.findings}
    assert dict(within(result, truth)) == {"a": "a", "b": "b", "c": "c"}


def test_balls_side_by_side_that_lie_on_one_large_circle_are_found() -> None:
    simulated, _ = cc.simulate("plate", 34)
    result = simulated.run()["tcp"]
    assert (result.verdict, [row.capture for row in result.residuals if not row.used]) == ("pass", [])


@pytest.mark.thorough
def test_the_distance_of_a_bar_finds_the_scale_whichever_ball_is_which() -> None:
    plate = TOPOLOGY_SCENARIOS["plate-distances"]
    session, files, _ = simulate_topology(replace(plate, balls=plate.balls[:2]), "bar", 1)
    result = in_memory(session, files).run()["tcp"]
    assert "spheres-named-either-way" in {finding.code for finding in result.findings}
    assert sorted(ball.name for ball in result.spheres) == ["a", "b"]
    assert isinstance(result.scanner, ScannerFound)
    found = dict(zip(result.scanner.names, result.scanner.values, strict=True))
    assert found["scale_x"] == pytest.approx(1 / 1.003 - 1, abs=0.001)


@pytest.mark.thorough
def test_one_scanner_sees_two_balls_and_another_sees_one() -> None:
    both = TOPOLOGY_SCENARIOS["scanners-on-flange-and-base"]
    second = replace(both.balls[0], name="second", at_mm=(830.0, 60.0, 470.0))
    scenario = replace(both, balls=(*both.balls, second), told="names")
    session, files, truth = simulate_topology(scenario, "three balls", 1)
    result = in_memory(session, files).run()["tcp"]
    assert result.verdict == "pass"
    assert sorted(ball.carrier for ball in result.spheres) == ["base", "base", "tool0"]
    assert "sphere-on-flange" in {ball.name for ball in result.spheres}
    assert all(squared < CHI2[6] for _, squared, _, _ in distances(result, truth))


def test_the_arc_of_a_reflection_gives_way_to_that_of_the_ball() -> None:
    session, files, truth = reflected(3, 5)
    result = in_memory(session, files).run()["tcp"]
    (named,) = (one for one in result.findings if one.severity != "note")
    assert (named.code, named.captures) == ("capture-with-reflection", ["p03", "p05"])
    assert all(row.used for row in result.residuals)
    ((_, squared, _, _),) = distances(with_frame(result), truth)
    assert squared < CHI2[6]


def test_one_ball_stays_one() -> None:
    simulated, _ = cc.simulate("tcp", 1)
    (ball,) = simulated.run()["tcp"].spheres
    assert (ball.name, len(ball.captures)) == ("sphere", 14)


@pytest.mark.thorough
def test_balls_of_a_plate_on_two_axes_are_told_apart_and_tell_the_axes() -> None:
    simulated, truth = cc.simulate("plate-on-positioner", 1)
    result = simulated.run()["chain"]
    assert result.verdict != "fail"
    assert all(row.used and row.profiles is None for row in result.residuals)
    on_plate = [ball for ball in result.spheres if ball.carrier == "turn"]
    assert [ball.name for ball in on_plate] == ["plate-1", "plate-2", "plate-3"]
    assert all(ball.center_mm is not None for ball in on_plate)
    apart = sorted(np.linalg.norm(np.subtract(a.center_mm, b.center_mm)) for a, b in combinations(on_plate, 2))
    true = [np.array(ball["center_mm"]) for ball in truth["spheres"] if ball["in"] == "turn"]
    assert apart == pytest.approx(sorted(np.linalg.norm(a - b) for a, b in combinations(true, 2)), abs=0.2)
    found = list(distances(result, truth))
    assert [name for name, *_ in found] == ["tool0_from_laser", "tilt", "turn"]
    assert all(squared < {2: 18.4, **CHI2}[freedom] for _, squared, freedom, _ in found)


@pytest.mark.thorough
@pytest.mark.parametrize("axis", ["rail", "slide"])
def test_balls_that_nobody_named_are_told_apart_beside_a_linear_axis(axis: str) -> None:
    made, plate = TOPOLOGY_SCENARIOS[axis], TOPOLOGY_SCENARIOS["plate"].balls
    if axis == "slide":  # in the chain the slide leaned by 1.1°, whose captures show the plate at one stop each
        moved = (replace(b, on=axis, mount="plate", at_mm=(b.at_mm[0] - 60, b.at_mm[1] - 300, 430)) for b in plate)
        plate = (made.balls[0], *moved)
    session, files, truth = simulate_topology(replace(made, balls=plate, cell=WIDE, on_axes=24), "", 1)
    results = in_memory(session, files).run()
    result = results["chain" if axis == "slide" else "tcp"]
    assert (result.verdict, len(result.spheres)) == ("pass", len(plate))
    assert all(row.used for row in result.residuals)
    found = list(distances(result, truth))
    assert [name for name, *_ in found] == ["tool0_from_laser", axis]
    assert all(squared < {2: 18.4, **CHI2}[freedom] for _, squared, freedom, _ in found)


@pytest.mark.thorough
def test_told_distances_name_balls_on_axes() -> None:
    scenario = replace(TOPOLOGY_SCENARIOS["plate-on-positioner"], told="distances")
    session, files, truth = simulate_topology(scenario, "plate-on-positioner", 3)
    result = in_memory(session, files).run()["chain"]
    on_plate = [ball for ball in result.spheres if ball.carrier == "turn"]
    assert sorted(ball.name for ball in on_plate) == ["a", "b", "c"]
    places = {ball.name: np.array(ball.center_mm) for ball in on_plate}
    true = {ball["name"]: np.array(ball["center_mm"]) for ball in truth["spheres"]}
    for one, other in combinations("abc", 2):
        told = np.linalg.norm(true[one] - true[other])
        assert np.linalg.norm(places[one] - places[other]) == pytest.approx(told, abs=0.04)


def around(
    on: str, middle_mm: tuple[float, float, float], radius_mm: float, count: int
) -> tuple[BallOptions, ...]:
    """Return balls of one mounting all around an axis, never two of them in one view."""
    x, y, z = middle_mm
    ways = 0.3 + 2 * np.pi * np.arange(count) / count
    return tuple(
        BallOptions(f"p{k}", on, (x + radius_mm * np.cos(way), y + radius_mm * np.sin(way), z + 15 * k), mount="p")
        for k, way in enumerate(ways.tolist())
    )


WIDE = TOPOLOGY_SCENARIOS["plate"].cell
FLOOR = TOPOLOGY_SCENARIOS["tilt"].balls[0]


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("axis", "height", "radius", "count"), [("table", 440.0, 110.0, 3), ("tilt", 520.0, 90.0, 3)]
)
def test_balls_all_around_an_axis_are_told_apart_though_never_seen_at_once(
    axis: str, height: float, radius: float, count: int
) -> None:
    balls = around(axis, (1000.0, -250.0, height), radius, count)
    axes = TOPOLOGY_SCENARIOS["gantry-turntable" if axis == "table" else "tilt"].axes
    scenario = TopologyScenario("", balls=(FLOOR, *balls), axes=axes, cell=WIDE, on_axes=24)
    session, files, truth = simulate_topology(scenario, "around", 1)
    result = in_memory(session, files).run()["chain"]
    assert result.verdict == "pass"
    assert all(row.used for row in result.residuals)
    assert [ball.name for ball in result.spheres] == ["sphere", "p-1", "p-2", "p-3"]
    assert all(squared < {2: 18.4, **CHI2}[many] for _, squared, many, _ in distances(result, truth))


def test_a_ball_that_was_moved_midway_is_still_named() -> None:
    balls = around("table", (1000.0, -250.0, 440.0), 110.0, 2)
    axes = TOPOLOGY_SCENARIOS["gantry-turntable"].axes
    scenario = TopologyScenario("", balls=(FLOOR, *balls), axes=axes, cell=WIDE, on_axes=24)
    session, files, truth = simulate_topology(scenario, "around", 1)
    first = [one for one in session.captures if truth["balls_seen"][one.id] != ["p1"]]
    then = [one for one in session.captures if truth["balls_seen"][one.id] == ["p1"]]
    moved = session.model_copy(update={"captures": [*first, *then]})
    with pytest.raises(cc.CalibrationError, match="Give these a `mount` of their own"):
        in_memory(moved, files).run("turntable")


@pytest.mark.thorough
def test_balls_around_two_axes_that_turn_together_are_refused_with_what_to_do() -> None:
    balls = around("turn", (1000.0, -250.0, 520.0), 90.0, 3)
    axes = TOPOLOGY_SCENARIOS["positioner"].axes
    scenario = TopologyScenario("", balls=(FLOOR, *balls), axes=axes, cell=WIDE, on_axes=30)
    session, files, truth = simulate_topology(scenario, "around", 1)
    with pytest.raises(cc.CalibrationError, match="give captures of another a `mount` of their own"):
        in_memory(session, files).run("turntable")
    named = [
        one.model_copy(update={"mount": truth["balls_seen"][one.id][0]}) if one.mount else one
        for one in session.captures
    ]
    result = in_memory(session.model_copy(update={"captures": named}), files).run()["chain"]
    assert result.verdict == "pass"
    assert all(squared < {2: 18.4, **CHI2}[many] for _, squared, many, _ in distances(result, truth))


FAR = BallOptions("far", "base", (980.0, -60.0, 500.0))
OFTEN = replace(WIDE, orientations=16)


@pytest.mark.thorough
def test_balls_far_apart_are_told_apart_though_never_seen_at_once() -> None:
    session, files, truth = simulate_topology(TopologyScenario("", balls=(FLOOR, FAR), cell=OFTEN), "far", 1)
    result = in_memory(session, files).run()["tcp"]
    assert result.verdict == "pass"  # poses did not fit, by 100 mm
    assert all(row.used for row in result.residuals)
    assert sorted(true for _, true in within(result, truth)) == ["far", "sphere"]
    ((_, squared, _, _),) = distances(with_frame(result), truth)
    assert squared < CHI2[6]


def test_balls_before_a_robot_on_a_rail_are_told_apart_by_the_captures_mountings() -> None:
    scenario = TopologyScenario("", balls=(FLOOR, FAR), axes=TOPOLOGY_SCENARIOS["rail"].axes, cell=OFTEN)
    session, files, truth = simulate_topology(scenario, "rail", 1)
    seen = truth["balls_seen"]
    named = [one.model_copy(update={"mount": seen[one.id][0]}) for one in session.captures]
    result = in_memory(session.model_copy(update={"captures": named}), files).run()["tcp"]
    assert result.verdict == "pass"
    assert dict(within(result, truth)) == {"far": "far", "sphere": "sphere"}
    assert all(squared < {2: 18.4, **CHI2}[many] for _, squared, many, _ in distances(result, truth))


def test_where_all_fit_badly_two_ways_are_told_apart_only_by_more() -> None:
    names, sure = ["a", "b", "c"], 0.5 * 0.3**2 * np.eye(9)  # a distance errs by 0.3 mm

    def found(second: float) -> list[list[str]]:
        told = [KnownDistance("a", "b", 60.0, 0.01), KnownDistance("b", "c", second, 0.01)]
        return by_distances(np.array([[0.0, 0, 0], [61.0, 0, 0], [61.0 + second, 0, 0]]), sure, names, told)

    assert found(57.0) == [names]  # 15 of squared deviations; 192 the other way round
    assert found(58.0) == []  # 104


@pytest.mark.thorough
def test_no_axis_is_sought_by_balls_that_were_not_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """By their tool axes were sought for a minute and more, and then the readings were blamed."""
    foot = AxisOptions("foot", "rotary", "robot", None, (0.0, 0.0, 1.0), low=-40.0, high=40.0)
    tilt = AxisOptions("tilt", "rotary", "object", None, (0.0, 1.0, 0.0), low=-40.0, high=40.0)
    balls = (
        BallOptions("one", "tool0", (25.0, -40.0, 130.0)),
        BallOptions("other", "tool0", (25.0, 60.0, 130.0)),
        BallOptions("riding", "tilt", (1015.0, -220.0, 446.0), mount="riding"),
    )
    cell = TopologyScenario(
        "",
        (ScannerOptions("gate", "base"),),
        balls,
        (foot, tilt),
        TcpScenario(window_x_mm=100.0),
        "names",
        on_axes=14,
    )
    session, files, _ = simulate_topology(cell, "", 21)
    opened = in_memory(session, files)
    assert "balls-not-told-apart" in {one.code for one in opened.run("tcp")["tcp"].findings}
    monkeypatch.setattr(solve, "table_of", None)
    for stage in ("turntable", "chain"):
        with pytest.raises(MotionError, match="2 spheres that can be told apart") as refused:
            opened.run(stage)
        assert "Name the sphere that each capture shows" in str(refused.value)
