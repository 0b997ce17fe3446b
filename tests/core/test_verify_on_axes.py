"""A verification and a recheck take the robot where its rail, and the ball where its axis, brought it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.records import Session
from calib_core.simulation import TOPOLOGY_SCENARIOS, SimulatedSession
from calib_core.simulation.motion import pose
from calib_core.simulation.profile_cell import pose_numbers
from calib_core.simulation.scenarios import TcpScenario
from calib_core.simulation.topology import ScannerOptions
from calib_core.simulation.topology_cell import simulate_topology
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.recheck.record import RecheckResult
from calib_core.stages.verify.record import VerifyResult
from tests.core.test_simulation import matrix_from_abb
from tests.core.test_simulation_topology import moved

RAIL = replace(TOPOLOGY_SCENARIOS["rail"], cell=TcpScenario(translations=6, orientations=24))
GANTRY = replace(
    TOPOLOGY_SCENARIOS["gantry"],
    scanners=(ScannerOptions("left", "tool0", 0.0), ScannerOptions("right", "tool0", 0.3)),
)
POSITIONER = replace(TOPOLOGY_SCENARIOS["positioner"], told="names", on_axes=24)


def simulated_cell(scenario: Any, seed: int) -> SimulatedSession:
    return SimulatedSession(*simulate_topology(scenario, "drawn", seed), None)


def shifted(capture: dict[str, Any], by_mm: FloatArray) -> None:
    """Let the flange be told elsewhere, along its own axes."""
    capture["pose"] = pose_numbers(matrix_from_abb(capture["pose"]) @ pose(np.eye(3), by_mm))


def verified(cell: SimulatedSession, step: str, off_mm: float = 0.0) -> VerifyResult:
    """Return what every third capture of a step says of what the others say, the scanner moved since then."""
    record = cell.session.to_json()
    for capture in [one for one in record["captures"] if one["step"] == step][::3]:
        capture["step"] = "verify"
        shifted(capture, np.array([off_mm, 0.0, 0.0]))
    result = solve_stage(Session.model_validate(record), "verify", cell.files.__getitem__)
    assert isinstance(result, VerifyResult)
    return result


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(1, 4))
def test_a_cell_on_a_rail_is_verified_where_the_rail_brought_it(seed: int) -> None:
    cell = simulated_cell(RAIL, seed)
    good = verified(cell, "tcp")
    assert good.verdict == "pass", good.warnings
    assert good.held_out_scatter_rms_mm is not None
    assert good.held_out_scatter_rms_mm < 1.0
    assert verified(cell, "tcp", 4.0).verdict == "fail"


@pytest.mark.thorough
@pytest.mark.parametrize("seed", [1])
def test_a_told_ball_on_a_positioner_is_verified_where_its_axes_brought_it(seed: int) -> None:
    cell = simulated_cell(POSITIONER, seed)
    good = verified(cell, "turntable")
    assert good.verdict != "fail", good.warnings
    assert good.held_out_scatter_rms_mm is not None
    assert good.held_out_scatter_rms_mm < 1.0
    assert verified(cell, "turntable", 4.0).verdict == "fail"


@pytest.mark.thorough
def test_a_ball_on_an_axis_that_carries_every_ball_told_needs_no_name() -> None:
    cell = simulated_cell(POSITIONER, 1)
    record = cell.session.to_json()
    riding = [ball for ball in record["cell"]["spheres"] if ball.get("on", "base") != "base"]
    record["cell"]["spheres"] = riding
    assert len({ball["on"] for ball in riding}) == 1
    for capture in [one for one in record["captures"] if one.get("mount") == riding[0]["name"]][::3]:
        capture["step"] = "verify"
        del capture["mount"]
    result = solve_stage(Session.model_validate(record), "verify", cell.files.__getitem__)
    assert isinstance(result, VerifyResult)
    assert sum(row.used for row in result.residuals) >= 4
    assert result.verdict != "fail", result.warnings


def rechecked(cell: SimulatedSession, rail_mm: float, back: bool) -> RecheckResult:
    """Return what captures say that see the same as before with the robot further along its rail, or not."""
    record, files = cell.session.to_json(), dict(cell.files)
    along = moved(cell.truth["axes"][0], rail_mm)
    for capture in record["captures"][8:14]:
        own = {
            **capture,
            "id": f"r-{capture['id']}",
            "step": "recheck",
            "files": [f"captures/r-{capture['id']}.csv"],
        }
        text = files[capture["files"][0]].decode()
        files[own["files"][0]] = noisy(text)
        own["axes_mm"] = {"rail": capture["axes_mm"]["rail"] + rail_mm}
        if back:
            own["pose"] = pose_numbers(np.linalg.inv(along) @ matrix_from_abb(capture["pose"]))
        record["captures"].append(own)
    result = solve_stage(Session.model_validate(record), "recheck", files.__getitem__)
    assert isinstance(result, RecheckResult)
    return result


def noisy(text: str) -> bytes:
    """Return a profile with every point a little elsewhere."""
    rng, lines = np.random.default_rng(1), text.splitlines()
    for k, line in enumerate(lines[1:], start=1):
        x, z = line.split(",")
        lines[k] = line if not z else f"{x},{float(z) + 0.02 * rng.standard_normal():.4f}"
    return "\n".join(lines).encode()


@pytest.mark.thorough
def test_a_recheck_takes_the_robot_where_its_rail_brought_it() -> None:
    cell = simulated_cell(RAIL, 1)
    assert rechecked(cell, 4.0, back=True).holds
    wrong = rechecked(cell, 4.0, back=False)
    assert not wrong.holds
    assert wrong.change_mm == pytest.approx(4.0, abs=1.0)
    with pytest.raises(MotionError):  # another place of the rail is another pose
        rechecked(cell, 60.0, back=False)


def test_each_capture_is_verified_by_its_own_scanners_mount() -> None:
    simulated, _ = cc.simulate("scanners-on-flange-and-base", 1)
    own: dict[str | None, list[str]] = {}
    for capture in simulated.captures:
        own.setdefault(capture.scanner, []).append(capture.id)
    held = {name for names in own.values() for name in names[3::4]}
    captures = [one.model_copy(update={"step": "verify"}) if one.id in held else one for one in simulated.captures]
    record = simulated.record.model_copy(update={"captures": captures})
    result = cc.OpenSession(record, simulated.read).run("verify")["verify"]
    assert {row.capture for row in result.residuals if row.used} == held
    assert result.verdict != "fail"
    assert result.chance > 0.001
    assert result.held_out_scatter_rms_mm < 0.3


def verified_gantry(scenario: Any, seed: int, turned_rad: float = 0.0) -> VerifyResult:
    """Return what every other capture of each scanner says of what the others say, scanners turned since then."""
    cell = simulated_cell(scenario, seed)
    record, files = cell.session.to_json(), dict(cell.files)
    record["cell"]["verification"] = {"tool_mm": 1.0}
    cosine, sine = np.cos(turned_rad), np.sin(turned_rad)
    for name in record["cell"]["scanners"]:
        for capture in [one for one in record["captures"] if one["scanner"] == name][::2]:
            capture["step"] = "verify"
            rows = files[capture["files"][0]].decode().splitlines()
            points = [[float(v) for v in row.split(",")[:2]] for row in rows[1:] if row.split(",")[1]]
            turned = [f"{cosine * x - sine * z:.4f},{sine * x + cosine * z:.4f}" for x, z in points]
            files[capture["files"][0]] = "\n".join(["x_mm,z_mm", *turned]).encode()
    result = solve_stage(Session.model_validate(record), "verify", files.__getitem__)
    assert isinstance(result, VerifyResult)
    return result


def test_scanners_on_a_gantry_are_verified_by_what_it_determines() -> None:
    tool = verified_gantry(GANTRY, 2).checks[0]
    assert tool.uncertainty_mm < 1.0  # their places, which it leaves open, are needed nowhere: 700 mm with them
    assert tool.value_mm < 1.0 + tool.uncertainty_mm
    turned = verified_gantry(GANTRY, 2, 0.03)
    assert turned.checks[0].value_mm > 3.0  # 0.03 rad at 190 mm
    assert turned.decision == "fail"


def test_scanners_at_both_ends_of_a_gantry_are_verified() -> None:
    scenario = replace(TOPOLOGY_SCENARIOS["scanners-on-flange-and-base"], machine="gantry", cell=GANTRY.cell)
    tool = verified_gantry(scenario, 1).checks[0]
    assert tool.uncertainty_mm < 10.0
