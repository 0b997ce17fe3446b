"""Machines of few axes: what is determined is solved, what is not has no number."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.archive.folder import result_data
from calib_core.cell.found import placed_scanner, placed_table
from calib_core.errors import ConflictError, InputError
from calib_core.guidance.part_budget import budget_at
from calib_core.library.opened import in_memory
from calib_core.review.answer import answer_of_folder
from calib_core.simulation import TOPOLOGY_SCENARIOS
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.simulation.topology_more import simulate_with_scans
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import solve_stage
from server.cli import main
from tests.topology_errors import distances

CHI2 = {2: 18.4, 3: 21.1}  # 99.99 %


def turned_apart(true: Any, found: Any) -> np.ndarray:
    """Return the small turn (3,), rad, of a found pose (4, 4) from the true one, in its own frame."""
    turn = np.array([row[:3] for row in true[:3]]).T @ np.array([row[:3] for row in found[:3]])
    return 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])


def test_a_gantry_knows_the_scanners_rotation_and_has_no_number_for_its_position() -> None:
    simulated, truth = cc.simulate("gantry", 1)
    data = result_data(simulated.run()["tcp"])
    json.dumps(data, allow_nan=False)
    assert data["verdict"] == "warn"
    assert [row[3] for row in data["tool0_from_laser"]] == [None, None, None, 1.0]
    assert data["sphere_center_in_base_mm"] is None
    assert data["workpiece"] is None
    assert len(data["undetermined"]) == 3
    off = turned_apart(truth["tool0_from_laser"], data["tool0_from_laser"])
    covariance = np.array([row[:3] for row in data["covariance"][:3]], dtype=float)
    assert off @ np.linalg.solve(covariance, off) < CHI2[3]
    (turned,) = [block["text"] for block in data["evidence"] if block.get("title") == "Scanner on the flange"]
    w, *xyz = (float(one.replace("−", "-")) for one in re.findall(r"q\d = (\S+) ±", turned))
    stated = float(re.findall(r"q1 = \S+ ± ([\d.]+)", turned)[0])
    assert w**2 + np.square(xyz).sum() == pytest.approx(1.0, abs=1e-3)
    assert stated == pytest.approx(np.sqrt(xyz @ covariance @ xyz), rel=0.05)  # half of the turn, k = 2


def test_a_gantry_with_a_table_knows_the_scanner_in_the_tables_frame() -> None:
    simulated, truth = cc.simulate("gantry-turntable", 1)
    result = simulated.run()["chain"]
    assert result.verdict == "pass"
    data = result_data(result)
    assert data["axis_point_in_base_mm"] == [None, None, None]
    *_, (name, squared, freedom, _) = distances(result.model_copy(update={"frames": []}), truth)
    assert name == "table"
    assert squared < CHI2[freedom]
    scanner, table = placed_scanner(data), placed_table(data)
    assert scanner is not None
    true_table, true_tool = np.array(truth["base_from_turntable"]), np.array(truth["tool0_from_laser"])
    rotation = simulated_orientation(simulated)
    axis_off = (rotation @ scanner.translation_mm - table.translation_mm) - (
        rotation @ true_tool[:3, 3] - true_table[:3, 3]
    )
    axis = true_table[:3, 2]
    assert np.linalg.norm(np.cross(axis, axis_off)) < 0.5  # along it the origin is a matter of rule


@pytest.mark.thorough
def test_a_scanner_on_one_linear_axis_knows_the_table_but_not_its_turn_about_the_travel() -> None:
    simulated, truth = cc.simulate("linear-turntable", 1)
    results = simulated.run()
    assert {stage: results[stage].verdict for stage in results} == {
        "tcp": "warn",
        "turntable": "pass",
        "chain": "pass",
    }
    data = result_data(results["chain"])
    json.dumps(data, allow_nan=False)
    assert "tool-place-not-needed" in {one["code"] for one in data["findings"]}
    assert {value for row in data["tool0_from_laser"][:3] for value in row} == {None}
    assert data["axis_direction_in_base"] == [None, None, None]
    assert len(data["undetermined"]) == 4
    scanner, table, turned = placed_scanner(data), placed_table(data), simulated_orientation(simulated)
    assert scanner is not None
    true_table, true_tool = np.array(truth["base_from_turntable"]), np.array(truth["tool0_from_laser"])
    seen = (turned @ scanner.rotation).T @ table.rotation[:, 2]
    true = (turned @ true_tool[:3, :3]).T @ true_table[:3, 2]
    assert np.linalg.norm(np.cross(seen, true)) < np.deg2rad(0.2)  # a mirrored one leans by 14°
    scale = np.abs(data["up_to_shift"]["turntable_covariance"])
    assert np.isfinite(np.array(scale, dtype=float)).all()
    answer = answer_of_folder(simulated.record, {"chain": data}, simulated.read)
    assert answer is not None
    assert (
        json.loads(json.dumps(answer.to_json(), allow_nan=False))["rotation_sigma_deg"] is None
    )  # was not packed


def untold(scenario: str) -> cc.OpenSession:
    """Return a simulated session in which no capture's side is told."""
    simulated, _ = cc.simulate(scenario, 1)
    captures = [one.model_copy(update={"side": None}) for one in simulated.captures]
    return cc.OpenSession(simulated.record.model_copy(update={"captures": captures}), simulated.read)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("scenario", "stage", "code"),
    [("linear-turntable", "tcp", "tool-mirrored"), ("fixed-scanner-turntable", "turntable", "axis-mirrored")],
)
def test_a_mirrored_answer_is_named_with_the_side_to_tell(scenario: str, stage: str, code: str) -> None:
    result = untold(scenario).run(stage)[stage]
    assert result.verdict == "fail"
    named = next(one for one in result.findings if one.code == code)
    assert "side" in named.to_do


def simulated_orientation(simulated: cc.OpenSession) -> np.ndarray:
    """Return the one orientation (3, 3) in which a gantry holds its flange."""
    from calib_core.captures.content import pose_of

    return pose_of(simulated.record.cell, simulated.record.captures[0]).rotation


def test_an_open_position_is_no_tool_of_a_controller_and_no_tilt_is_asked_for() -> None:
    simulated, _ = cc.simulate("scara", 1)
    asked = guide(simulated.record, [], {}).current
    assert asked.action == "solve"
    assert "cannot" in asked.why
    result = simulated.run()["tcp"]
    asked = guide(simulated.record, [], {"tcp": result}).current
    assert asked.action == "review"
    assert "tilt the flange if the machine can" in asked.why
    assert result.tool0_from_laser is not None
    assert sum(np.isnan(row[3]) for row in result.tool0_from_laser) == 2
    with pytest.raises(ConflictError, match="motions leave open"):
        simulated.export("fanuc", allow=["stale", "fail", "not-replayed"])
    told = json.loads(simulated.export("json", allow=["stale", "fail", "not-replayed"]))
    assert "conventions" not in told
    assert told["up_to_shift"]["tool0_from_laser"][3] == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.thorough
def test_a_gantrys_scanner_and_table_are_used_together(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    simulated, truth = cc.simulate("gantry-turntable", 2)
    simulated.run()
    folder, capture = str(simulated.save(tmp_path / "session")), simulated.record.captures[-1]
    with pytest.raises(InputError, match="a place that the captures leave open"):
        budget_at(simulated.record, {name: result_data(one) for name, one in simulated.results.items()})
    assert main(["check", folder]) == 0
    assert main(["export", folder, "--format", "json", "--allow", "not-replayed"]) == 0
    assert main(["report", folder, "--out", str(tmp_path / "report.html")]) == 0
    assert main(["archive", "pack", folder, "--out", str(tmp_path / "a.zip")]) == 0
    assert main(["archive", "replay", str(tmp_path / "a.zip")]) == 0
    capsys.readouterr()
    assert main(["frames", folder, "tool0", "laser"]) != 0
    assert "leave open" in capsys.readouterr().err
    assert main(["frames", folder, "turntable", "laser", "--capture", capture.id, "--json"]) == 0
    asked = json.loads(capsys.readouterr().out)["asked"]
    turn = simulated_orientation(simulated) @ np.array(truth["tool0_from_laser"])[:3, :3]
    true = np.array(truth["base_from_turntable"])[:3, :3].T @ turn
    found, sigmas = np.array(asked["matrix"])[:3, :3], np.sqrt(np.diag(asked["covariance"]))
    off = np.arccos(np.clip((found[2] * true[2]).sum(), -1, 1))  # the axis in the scanner's frame
    assert off < 5 * np.linalg.norm(sigmas[:3])
    assert (sigmas > 0).all()


@pytest.mark.thorough
@pytest.mark.parametrize("carried", ["scanner", "ball"])
def test_a_gantry_whose_lever_is_not_told_counts_with_the_flanges_small_turns(carried: str) -> None:
    scenario = TOPOLOGY_SCENARIOS["gantry"]
    scenario = replace(scenario, cell=replace(scenario.cell, orientation_sigma_rad=1e-3))
    if carried == "ball":
        fixed = TOPOLOGY_SCENARIOS["fixed-scanner-turntable"]
        scenario = replace(scenario, scanners=fixed.scanners, balls=fixed.balls[:1])
    squared: list[float] = []
    for seed in range(1, 21):
        session, files, truth = simulate_topology(scenario, "gantry", seed)
        result = solve_stage(session, "tcp", files.__getitem__)
        found = result.tool0_from_laser if carried == "scanner" else result.base_from_laser
        off = turned_apart(truth["frames"][0]["matrix"], found)
        squared.append(float(off @ np.linalg.solve(np.array(result.covariance, dtype=float)[:3, :3], off)))
    assert 1.5 < np.mean(squared) < 3 + 3 * np.sqrt(6 / len(squared))


def test_a_gantry_has_no_number_for_either_of_two_scanners_and_both_are_shown_and_merged() -> None:
    scenario = replace(TOPOLOGY_SCENARIOS["scanners-on-flange-and-base"], machine="gantry")
    scenario = replace(scenario, cell=TOPOLOGY_SCENARIOS["gantry"].cell, scans=3)
    session, files, _ = simulate_with_scans(scenario, "gantry", 1)
    opened = in_memory(session, files)
    results = opened.run()
    data = result_data(results["tcp"])
    for frame in data["frames"]:
        assert [row[3] for row in frame["matrix"]] == [None, None, None, 1.0], frame["scanner"]
    assert [ball["center_mm"] for ball in data["spheres"]] == [[None] * 3] * 2
    told = {stage: result_data(result) for stage, result in results.items()}
    answer = answer_of_folder(opened.record, told, opened.read)
    assert answer is not None
    assert {frame.scanner for frame in answer.frames if frame.outof == "laser"} == {"arm", "gate"}
    merged = results["merge"]
    assert "merge-place-open" in {one.code for one in merged.findings}
    assert merged.overlap_rms_mm < 0.3
    assert merged.surface_sigma_mm is None
