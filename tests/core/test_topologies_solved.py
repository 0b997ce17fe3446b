"""Cells of other topologies are solved as well as they say, by the truth of a simulator of its own."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.cell.layout import Layout, MovedAxis
from calib_core.cell.walk import Carriers, ways
from calib_core.chain.axes_start import axes_start
from calib_core.chain.tcp import solve_tcp
from calib_core.exports.workpiece import at_workpiece
from calib_core.frames import RigidTransform
from calib_core.library.opened import in_memory
from calib_core.records import Session
from calib_core.records.described import DescribedCell
from calib_core.simulation import TOPOLOGY_SCENARIOS, TcpScenario, TopologyScenario, simulate_described
from calib_core.simulation.topology import AxisOptions, BallOptions, ScannerOptions
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.evidence import text_of
from calib_core.stages.tcp.result import mounts_found
from tests.core.test_verify_on_axes import shifted
from tests.topology_errors import distances

CHI2 = {2: 18.4, 6: 27.9}  # 99.99 %


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize(
    ("scenario", "names"),
    [
        ("two-scanners", ["tool0_from_laser", "tool0_from_laser", "laser:left_from_laser:right"]),
        ("scanners-on-flange-and-base", ["tool0_from_laser", "base_from_laser"]),
        ("fixed-scanner-turntable", ["base_from_laser", "table"]),
        ("positioner", ["tool0_from_laser", "tilt", "turn"]),
        ("rail", ["tool0_from_laser", "rail"]),
        ("slide", ["tool0_from_laser", "slide"]),
        ("two-tables", ["tool0_from_laser", "one", "two"]),
        ("tilt", ["tool0_from_laser", "tilt"]),
        ("positioner-geared", ["tool0_from_laser", "tilt", "turn"]),
        (
            "two-scanners-turntable",
            ["tool0_from_laser", "tool0_from_laser", "laser:left_from_laser:right", "table"],
        ),
    ],
)
def test_every_edge_is_within_what_is_stated(scenario: str, names: list[str]) -> None:
    simulated, truth = cc.simulate(scenario, 1)
    results = simulated.run()
    last = results["chain" if "chain" in results else "tcp"]
    found = list(distances(last, truth))
    assert [name for name, *_ in found] == names
    for name, squared, freedom, _ in found:
        assert squared < CHI2[freedom], name
    assert all(row.used for row in last.residuals if "arc" not in str(row.reason))
    titles = [str(block.title) for block in last.evidence]
    for frame in last.frames:
        assert any(f"Scanner {frame.scanner} " in title for title in titles) or frame.scanner is None
    called = {"table": "Turntable", "slide": "Linear axis slide"}.get(names[-1], f"Rotary axis {names[-1]}")
    carrying = [title for title in titles if title.endswith("in the robot's base")]
    assert carrying == ([f"{called} in the robot's base"] if "chain" in results else [])
    shown = [row.cells[0] for block in last.evidence if block.id == "axes" for row in block.rows]
    assert shown == ([axis.name for axis in last.axes] if len(last.axes) > ("chain" in results) else [])
    title = text_of(results["tcp"]).splitlines()[0]
    assert ("Scanner in base" in title) == scenario.startswith("fixed")


@pytest.mark.thorough
def test_at_the_workpiece_a_rails_travel_is_no_lever() -> None:
    simulated, _ = cc.simulate("rail-positioner", 1)
    result = simulated.run()["chain"]
    places = at_workpiece(simulated.record, result.model_dump(mode="json"))
    apart = max(one.worst_sigma_mm for one in places if one.of != "both")
    both = [one.worst_sigma_mm for one in places if one.of == "both"]
    assert len(both) == 2
    assert max(both) < 2 * apart


WAIST = AxisOptions("waist", "rotary", "robot", point_in_base_mm=(150.0, -100.0, 0.0), low=-60.0, high=60.0)
RAIL = AxisOptions("rail", "linear", "robot", None, (0.0, 1.0, 0.0), low=0.0, high=400.0, sigma=0.02)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("scanner", "ball", "axes"),
    [
        (ScannerOptions(), BallOptions(), (WAIST,)),
        (ScannerOptions("gate", "base"), BallOptions("held", "tool0", (25.0, -40.0, 130.0)), (RAIL, WAIST)),
    ],
)
def test_axes_of_either_kind_under_the_robot(
    scanner: ScannerOptions, ball: BallOptions, axes: tuple[AxisOptions, ...]
) -> None:
    session, files, truth = simulate_topology(TopologyScenario("", (scanner,), (ball,), axes), "drawn", 1)
    result = in_memory(session, files).run("tcp")["tcp"]
    assert result.verdict == "pass"
    assert [axis.name for axis in result.axes] == [axis.name for axis in axes]
    for name, squared, freedom, _ in distances(result, truth):
        assert squared < CHI2[freedom], name


def geared(scenario: str, scale: float, encoder: str | None = None) -> tuple[Any, dict[str, Any]]:
    """Return the last answer before a rail whose scale is not one, estimated scatters, and the truth."""
    made = TOPOLOGY_SCENARIOS[scenario]
    axes = (replace(made.axes[0], scale=scale, high=500.0), *made.axes[1:])
    made = replace(made, axes=axes, cell=replace(made.cell, sigmas="estimated"))
    session, files, truth = simulate_topology(made, "drawn", 2)
    rail, *others = session.cell.axes or []
    cell = session.cell.model_copy(update={"axes": [rail.model_copy(update={"encoder": encoder}), *others]})
    results = in_memory(session.model_copy(update={"cell": cell}), files).run()
    return results["chain" if "chain" in results else "tcp"], truth


@pytest.mark.thorough(keep=2)
@pytest.mark.parametrize(
    ("scenario", "scale", "encoder"),
    [
        ("rail", 1.002, None),
        ("rail", 1.002, "exact"),
        ("rail", 0.99, "scale"),
        ("rail", 1.0, None),
        ("rail-positioner", 1.002, None),
    ],
)
def test_the_scale_of_an_axis_under_the_robot_is_found_and_told(
    scenario: str, scale: float, encoder: str | None
) -> None:
    result, truth = geared(scenario, scale, encoder)
    rail = result.axes[0]
    told = [one.values for one in result.findings if one.code == "encoder-scale"]
    assert [one["axis"] for one in told] == ["rail"] * (scale != 1.0 and encoder != "scale")
    assert result.verdict == ("warn" if told else "pass")
    for one in told:
        assert abs(one["error_percent"] - 100 * (scale - 1)) < 2 * one["uncertainty_percent"]
    if encoder == "exact" or scale == 1.0:
        assert (rail.scale, rail.scale_sigma) == (1.0, None)
        return
    assert abs(rail.scale - scale) < 4 * rail.scale_sigma < 0.002
    off = np.array(result.sphere_center_in_base_mm) - truth["spheres"][0]["center_mm"]
    assert off @ np.linalg.solve(np.array(result.sphere_center_covariance), off) < 21.1
    for name, squared, freedom, _ in distances(result, truth):
        assert squared < CHI2[freedom], name


BESIDE = ScannerOptions("gate", "base")
LARGE, MIDDLE, SMALL = (
    BallOptions(name, "base", (900.0 + x, 150.0 + y, 420.0), diameter)
    for name, x, y, diameter in (
        ("large", 0.0, 0.0, 50.0),
        ("middle", 70.0, 0.0, 40.0),
        ("small", 30.0, 60.0, 30.0),
    )
)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("scanners", "balls"),
    [
        ((ScannerOptions("hand"), BESIDE), (LARGE, BallOptions("held", "tool0", (25.0, -40.0, 130.0), 30.0))),
        ((ScannerOptions(),), (LARGE, MIDDLE, SMALL)),
    ],
)
def test_balls_of_different_sizes_are_each_solved_by_their_own(
    scanners: tuple[ScannerOptions, ...], balls: tuple[BallOptions, ...]
) -> None:
    made = TopologyScenario("sizes", scanners, balls, (), told="names")
    session, files, truth = simulate_topology(made, "drawn", 1)
    sizes = {ball.name: ball.diameter_mm for ball in session.cell.spheres or []}
    assert sizes == {ball.name: ball.diameter_mm for ball in balls}
    cell = session.cell.model_copy(update={"sphere_diameter_mm": None})
    result = in_memory(session.model_copy(update={"cell": cell}), files).run("tcp")["tcp"]
    assert result.verdict == "pass"
    assert {ball.name for ball in result.spheres} == set(sizes)
    assert all(row.used for row in result.residuals if "arc" not in str(row.reason))
    found = list(distances(result, truth))
    assert len(found) >= len(scanners)
    for name, squared, freedom, _ in found:
        assert squared < CHI2[freedom], name


@pytest.mark.thorough
def test_two_scanners_at_one_stop_are_known_to_each_other_better_than_on_the_flange() -> None:
    errors = {}
    for seed in (1, 2, 3):
        simulated, truth = cc.simulate("two-scanners", seed)
        for name, squared, freedom, error_mm in distances(simulated.run()["tcp"], truth):
            assert squared < CHI2[freedom]
            errors.setdefault(name, []).append(error_mm)
    assert sum(errors["laser:left_from_laser:right"]) < 0.4 * sum(errors["tool0_from_laser"]) / 2


@pytest.mark.thorough
def test_what_errors_in_the_files_do_to_a_relative_pose_is_known_beyond_their_slope() -> None:
    """They turn both scanners by 30 mrad: by their slope alone the relative pose was many of its sigmas off."""
    simulated, _ = cc.simulate("two-scanners", 1)
    session = simulated.record
    seen = [observe_capture(session, capture, simulated.read) for capture in session.captures]
    held = solve_tcp(seen, sphere_of(session.cell, session.captures)).held
    layout, left = held.state.walk.layout, np.zeros(len(held.covariance))
    left[layout.mount(0)], left[layout.mount(1)] = (
        [0.0, 0.03, 0.0, -5.0, 0.0, 1.0],
        [0.0, 0.03, 0.0, -6.0, 0.0, 1.0],
    )
    covariance = held.covariance - np.outer(held.known_off, held.known_off) + np.outer(left, left)
    found = mounts_found(replace(held, left=left, covariance=covariance))[-1]
    right = held.state.position.moved(layout, -left)
    one, other = (
        RigidTransform.of(r, t, "tool0", "laser")
        for r, t in zip(right.mount_rotations, right.mount_translations, strict=True)
    )
    off = (one.inverse() @ other).difference(RigidTransform.from_rounded(found.matrix, "laser", "laser"))
    assert np.linalg.norm(off[3:]) > 1.0
    assert off @ np.linalg.solve(np.array(found.covariance), off) < 1.0


def chain_of(scenario: str) -> dict[str, Any]:
    return cc.simulate(scenario, 1)[0].run()["chain"].to_json()


@pytest.mark.thorough
def test_a_plate_that_an_axis_leans_is_not_said_to_be_at_one_height() -> None:
    assert "one-height" not in {finding["code"] for finding in chain_of("plate-on-positioner")["findings"]}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("reach_deg", "seed", "verdict"), [(180.0, 3, "pass"), (30.0, 2, "warn")])
def test_heights_before_a_scanner_that_stands_still_are_those_that_its_light_meets(
    reach_deg: float, seed: int, verdict: str
) -> None:
    fixed = TOPOLOGY_SCENARIOS["fixed-scanner-turntable"]
    axes, cell = (replace(fixed.axes[0], low=-reach_deg, high=reach_deg),), replace(fixed.cell, point_sigma_mm=0.1)
    session, files, _ = simulate_topology(replace(fixed, axes=axes, cell=cell), "", seed)
    result = in_memory(session, files).run("turntable")["turntable"]
    told = [one.to_do for one in result.findings if one.code == "one-height"]
    assert result.verdict == verdict
    if verdict == "pass":  # 16 mm apart, but the scanner knows the axis to some thousandths of a degree
        assert told == []
    else:
        assert "as the scanner's light still meets it" in "".join(told)


@pytest.mark.thorough
def test_a_linear_axis_errs_in_mm_and_has_no_angles() -> None:
    result = chain_of("slide")
    assert result["reading_sigma_mm"] == pytest.approx(0.02)  # as told
    assert result["angle_sigma_deg"] == result["angle_rms_deg"] == 0.0
    assert {row.get("table_deg") for row in result["residuals"]} == {None}


@pytest.mark.thorough
def test_of_several_axes_the_one_with_the_ball_tells_how_its_readings_err() -> None:
    result = chain_of("rail-positioner")
    assert result["angle_sigma_deg"] == pytest.approx(np.rad2deg(5e-5), rel=0.01)
    assert result["reading_sigma_mm"] is None


SLIDE = AxisOptions("slide", "linear", "object", None, (1.0, 0.0, 0.0), low=0.0, high=120.0, sigma=0.02)
FLOOR = (BallOptions("one"), BallOptions("two", at_mm=(830.0, 60.0, 470.0)))
HELD = BallOptions("held", "tool0", (25.0, -40.0, 130.0))
GATE = ScannerOptions("gate", "base")


@pytest.mark.thorough
def test_a_slide_before_two_scanners_of_nearly_one_plane_of_light_is_told_from_its_mirror_image() -> None:
    ball = BallOptions("carried", "slide", (1035.0, -240.0, 440.0), mount="carried")
    scanners = (GATE, ScannerOptions("other", "base"))
    cell = TopologyScenario("", scanners, (HELD, ball), (SLIDE,), TcpScenario(window_x_mm=100.0), on_axes=14)
    session, files, truth = simulate_topology(cell, "", 1)
    result = in_memory(session, files).run()["chain"]
    *_, (name, squared, freedom, error_deg) = distances(result, truth)
    assert (name, result.verdict) == ("slide", "pass")
    assert squared < CHI2[freedom]
    assert error_deg < 0.1  # it was 2.3°
    assert not {"axis-place-undetermined", "axis-mirrored"} & {one.code for one in result.findings}


@pytest.mark.parametrize("told", [True, False])
def test_a_ball_on_a_slide_may_be_on_the_other_side_of_the_plane_of_light(told: bool) -> None:
    axes, arrangement = [{"name": "slide", "kind": "linear"}], "sphere-on-robot"
    cell = {"arrangement": arrangement, "axes": axes, "sphere_diameter_mm": 40.0}
    made = simulate_described(DescribedCell.model_validate(cell), "slide", 12)
    captures = [one if told else one.model_copy(update={"side": None}) for one in made.session.captures]
    result = in_memory(made.session.model_copy(update={"captures": captures}), made.files).run("chain")["chain"]
    frame = next(one for one in result.frames if one.outof == "turntable")
    ball = next(one for one in made.truth["spheres"] if one["name"] == "ball2")
    off = np.array(frame.matrix)[:3, 3] - ball["center_mm"]
    assert off @ np.linalg.solve(np.array(frame.covariance)[3:, 3:], off) < CHI2[6]
    assert (np.linalg.norm(off) < 1.0) == told  # mirrored it lies 15 mm elsewhere, and leans by 0.5° only
    assert result.verdict == ("pass" if told else "fail")
    to_do = "".join(one.to_do for one in result.findings if one.code == "axis-mirrored")
    assert ("side: 1" in to_do, "direction" in to_do) == (not told, False)


def test_a_slide_read_far_from_zero_starts_on_the_side_that_one_capture_tells() -> None:
    layout = Layout((("", "base"),), (("slide", "ball"),), (MovedAxis("slide", "linear"),))
    readings = 600.0 + np.linspace(0, 60, 17)
    still, place, way = RigidTransform.identity("base", "tool0"), np.array([435.0, -236.0, 454.0]), np.eye(3)[0]
    each = np.zeros(17, dtype=int)
    walk = ways(layout, [still] * 17, [Carriers("base", "slide")] * 17, each, each, readings[:, None])
    own = place + readings[:, None] * way
    either = np.stack([own, own - [0.0, 0.0, 27.0]], axis=1)  # the plane of light lies level
    either[5, 1] = either[5, 0]
    at, misfit = axes_start(walk, either, (np.eye(3)[None], np.zeros((1, 3))), {})
    assert misfit.max() < 0.01  # readings were held against zero: 27 mm of the one that was told
    assert at.axes[0].rotation[:, 2] == pytest.approx(way, abs=1e-6)


@pytest.mark.thorough
def test_balls_before_a_robot_on_rails_are_told_apart_by_how_another_scanner_sees_one() -> None:
    cell = TopologyScenario(
        "", (ScannerOptions("arm"), GATE), (*FLOOR, HELD), (RAIL,), TcpScenario(window_x_mm=100.0), "names"
    )
    session, files, truth = simulate_topology(cell, "", 1)
    result = in_memory(session, files).run()["tcp"]
    assert (result.verdict, len(result.spheres)) == ("pass", 3)
    for name, squared, freedom, _ in distances(result, truth):
        assert squared < CHI2[freedom], name


@pytest.mark.thorough
def test_axes_under_the_robot_are_found_by_the_scanner_that_shows_them_best() -> None:
    rails = tuple(
        replace(RAIL, name=f"along-{name}", direction_in_base=way, high=120.0)
        for name, way in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)))
    )
    cell = TopologyScenario(
        "", (GATE, ScannerOptions("arm")), (FLOOR[0], HELD), rails, TcpScenario(window_x_mm=100.0), "names"
    )
    session, files, truth = simulate_topology(cell, "drawn", 11)
    result = in_memory(session, files).run("tcp")["tcp"]
    assert result.verdict == "pass"
    for name, squared, freedom, _ in distances(result, truth):
        assert squared < CHI2[freedom], name


def test_a_verification_asks_which_of_several_sizes_it_sees() -> None:
    made = TopologyScenario("sizes", (ScannerOptions(),), (LARGE, MIDDLE, SMALL), (), told="names")
    session, files, _ = simulate_topology(made, "drawn", 1)
    last = {one.id for one in session.captures[-4:]}
    captures = [one.model_copy(update={"step": "verify"}) if one.id in last else one for one in session.captures]
    opened = in_memory(session.model_copy(update={"captures": captures}), files)
    with pytest.raises(cc.CalibrationError, match="by its name in the capture's field 'mount'"):
        opened.run("verify")


@pytest.mark.parametrize("off_mm", [0.0, pytest.param(4.0, marks=pytest.mark.thorough)])
def test_spheres_of_two_sizes_verify_each_by_its_own(off_mm: float) -> None:
    captures, spheres, files = list[Any](), list[Any](), dict[str, bytes]()
    for ball in (LARGE, SMALL):  # one after the other before one scanner
        session, own, _ = simulate_topology(TopologyScenario("sizes", balls=(ball,), told="names"), "drawn", 1)
        record = session.to_json()
        for capture in record["captures"]:
            capture |= {"id": f"{ball.name}-{capture['id']}", "mount": ball.name}
            files |= {f"{ball.name}-{name}": own[name] for name in capture["files"]}
            capture["files"] = [f"{ball.name}-{name}" for name in capture["files"]]
        captures, spheres = [*captures, *record["captures"]], [*spheres, *record["cell"]["spheres"]]
    held_out = captures[::3]
    for capture in held_out:
        capture["step"] = "verify"
        shifted(capture, np.array([off_mm, 0.0, 0.0]))
    record["captures"], record["cell"]["spheres"] = captures, spheres
    told = in_memory(Session.model_validate(record), files).run("verify")["verify"]
    assert told.verdict == ("fail" if off_mm else "pass")
    assert off_mm or told.surface_rms_mm < 0.1  # by the other's radius it would be millimetres
    assert {row.capture for row in told.residuals if row.used} == {capture["id"] for capture in held_out}
