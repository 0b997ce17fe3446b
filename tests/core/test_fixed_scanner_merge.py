"""Scans of a scanner that stands still before a turntable become one cloud."""

import numpy as np
import pytest

from calib_core.library.opened import in_memory
from calib_core.records import Session
from calib_core.records.described import DescribedCell
from calib_core.simulation import simulate_described
from calib_core.simulation.motion import pose, turn
from calib_core.simulation.part import build_part
from calib_core.simulation.part_cell import PartScenario, ScanCell, simulate_part, take_scans
from calib_core.simulation.part_scan import PartScanner, view_poses
from calib_core.stages.pipeline import solve_stage


@pytest.mark.thorough
def test_a_fixed_scanners_scans_fit_and_need_no_pose() -> None:
    options = PartScenario(scans=6, position_sigma_mm=0.0, orientation_sigma_rad=0.0)
    session, _, _ = simulate_part(options, "part", 1)
    record = session.to_json()
    known = record["cell"]["known"]
    tool, table = np.array(known.pop("tool0_from_laser")), np.array(known["base_from_turntable"])
    view = view_poses(6)[0]
    stops = [(pose(turn([0, 0, -np.deg2rad(d)]), [0, 0, 0]) @ view, float(d)) for d in range(0, 360, 60)]
    part = PartScanner(build_part(), options.scanner)
    rng = np.random.default_rng(1)
    captures, files = take_scans(options, part, ScanCell(tool, table), stops, rng)
    for capture in captures:
        del capture["pose"]
    known["base_from_laser"] = (table @ view).tolist()
    record["cell"]["arrangement"] = "sphere-on-robot"
    made = Session.model_validate({**record, "captures": captures})
    result = solve_stage(made, "merge", files.__getitem__)
    assert result.verdict != "fail", result.warnings
    assert result.base_from_laser is not None
    assert result.tool0_from_laser is None
    assert [row.used for row in result.residuals] == [True] * 6
    assert result.overlap_rms_mm < 0.2


@pytest.mark.thorough
def test_a_part_that_the_robot_holds_is_merged_in_the_flanges_frame() -> None:
    gates = {"left": {"on": "base"}, "right": {"on": "base"}}
    rail = {"name": "rail", "kind": "linear", "carries": "robot"}
    told = DescribedCell.model_validate({"scanners": gates, "axes": [rail], "scans": 5})
    simulated = simulate_described(told, "held", 3)
    results = in_memory(simulated.session, simulated.files).run()
    merged = results["merge"]
    assert merged.verdict != "fail", merged.warnings
    assert merged.frame == "tool0"
    told = {block.label: block.text for block in merged.evidence if block.kind == "figure"}
    assert told["Calibration from"] == "Scanner in base"
    assert all(row.used for row in merged.residuals)
    assert merged.overlap_rms_mm < 2 * merged.expected_overlap_rms_mm
    low, high = np.array(merged.low_mm), np.array(merged.high_mm)
    center, radius = np.array(simulated.truth["part_center_mm"]), simulated.truth["part_diameter_mm"] / 2
    assert np.all(low > center - radius - 1.0)
    assert np.all(high < center + radius + 1.0)
