"""Scans of several scanners, and of parts that named axes move, become one cloud: each scan by its own way."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.frames import FloatArray
from calib_core.records import Session
from calib_core.simulation.motion import ON_FLANGE, back, pose, turn
from calib_core.simulation.part import build_part
from calib_core.simulation.part_cell import PartScenario, ScanCell, take_scans
from calib_core.simulation.part_scan import PartScanner, view_poses
from calib_core.simulation.profile_cell import pose_numbers
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import solve_stage
from tests.core.test_few_axes import simulated_orientation
from tests.core.test_late_scanner import seen_by
from tests.core.test_simulation_topology import moved

OPTIONS = PartScenario(scans=6, position_sigma_mm=0.0, orientation_sigma_rad=0.0, angle_sigma_rad=0.0)
LEFT = pose(turn([0.35, 0.0, 0.0]), [35.0, -120.0, 140.0])
RIGHT = pose(turn([-0.3, 0.2, 1.0]), [-60.0, 90.0, 120.0])


def scans(
    mount: FloatArray, views: Sequence[FloatArray], base_from_part: FloatArray, name: str
) -> tuple[list[dict[str, Any]], dict[str, bytes]]:
    """Return scans of a part at rest by a scanner on `mount`, named apart."""
    part = PartScanner(build_part(), OPTIONS.scanner)
    stops = [(view, 0.0) for view in views]
    captures, files = take_scans(OPTIONS, part, ScanCell(mount, base_from_part), stops, np.random.default_rng(1))
    for capture in captures:
        del capture["table_deg"]
        capture["id"], own = f"{name}-{capture['id']}", capture["files"][0]
        capture["files"] = [own.replace("captures/", f"captures/{name}-")]
    return captures, {file.replace("captures/", f"captures/{name}-"): data for file, data in files.items()}


def merged(record: Mapping[str, Any], files: Mapping[str, bytes]) -> MergeResult:
    result = solve_stage(Session.model_validate(record), "merge", files.__getitem__)
    assert isinstance(result, MergeResult)
    return result


@pytest.mark.thorough
def test_each_scanners_scans_go_by_its_own_mount_sense_and_noise() -> None:
    at = pose(np.eye(3), [900.0, 100.0, 50.0])
    views = view_poses(8)
    left, files = scans(LEFT, views[::2], at, "left")
    standing = [at @ views[1], at @ views[3]]
    right, more = scans(RIGHT, views[5::2], at, "right")
    fixed, most = scans(np.eye(4), views[1:4:2], at, "gate")
    captures = [*left, *right, *fixed]
    for own, scanner in ((left, "left"), (right, "right")):
        for capture in own:
            capture["scanner"] = scanner
    for n, capture in enumerate(fixed):
        capture["scanner"] = f"gate{n + 1}"
        del capture["pose"]
    noise = {"kind": "cloud", "point_sigma_mm": OPTIONS.scanner.point_sigma_mm, "z_axis": "away"}
    known = {"left": ("tool0", LEFT), "right": ("tool0", RIGHT)}
    known |= {f"gate{n + 1}": ("base", view) for n, view in enumerate(standing)}
    frames = [
        {"into": on, "outof": "laser", "scanner": name, "matrix": mount.tolist()}
        for name, (on, mount) in known.items()
    ]
    cell = {
        "pose_convention": "abb",
        "scanners": {name: {**noise, "on": on} for name, (on, _) in known.items()},
        "known": {ON_FLANGE: LEFT.tolist(), "frames": frames},
    }
    record = {"format": "scancell-session/1", "cell": cell, "captures": captures}
    result = merged(record, {**files, **more, **most})
    assert result.verdict != "fail", result.warnings
    assert all(row.used for row in result.residuals)
    assert result.overlap_rms_mm is not None
    assert result.overlap_rms_mm < 0.2


@pytest.mark.thorough
def test_a_part_on_a_positioner_is_merged_by_all_its_axes() -> None:
    simulated, truth = cc.simulate("positioner", 1)
    axes = {axis["name"]: axis for axis in truth["axes"]}
    at = pose(np.eye(3), [1000.0, -250.0, 460.0])
    record = simulated.record.to_json()
    files = {name: simulated.read(name) for capture in simulated.captures for name in capture.files}
    stops = [{"tilt": -30.0 + 12.0 * k, "turn": 60.0 * k} for k in range(6)]
    motions = [moved(axes["tilt"], stop["tilt"]) @ moved(axes["turn"], stop["turn"]) for stop in stops]
    looking = at @ view_poses(2)[1]
    views = [back(at) @ back(motion) @ looking for motion in motions]
    captures, more = scans(np.array(truth[ON_FLANGE]), views, at, "part")
    for capture, stop, motion in zip(captures, stops, motions, strict=True):
        capture["axes_deg"] = stop
        capture["pose"] = pose_numbers(looking @ back(np.array(truth[ON_FLANGE])))
        assert np.isfinite(motion).all()
    record["captures"] += captures
    result = merged(record, {**files, **more})
    assert result.verdict != "fail", result.warnings
    assert all(row.used for row in result.residuals)
    assert result.overlap_rms_mm is not None
    assert result.overlap_rms_mm < 0.4


@pytest.mark.thorough
@pytest.mark.parametrize("scenario", ["gantry-turntable", "linear-turntable"])
def test_scans_of_a_part_on_a_table_by_a_machine_of_few_axes_are_merged(scenario: str) -> None:
    simulated, truth = cc.simulate(scenario, 1)
    record = simulated.record.to_json()
    files = {name: simulated.read(name) for capture in simulated.captures for name in capture.files}
    tool, table = np.array(truth[ON_FLANGE]), np.array(truth["base_from_turntable"])
    rotation = simulated_orientation(simulated)
    part = PartScanner(build_part(), OPTIONS.scanner)
    place = table @ pose(np.eye(3), [0.0, 0.0, 60.0])
    laser = pose(rotation @ tool[:3, :3], [0.0, 0.0, 0.0])
    laser[:3, 3] = place[:3, 3] + [0.0, 0.0, 25.0] - 200.0 * laser[:3, 2]
    if scenario == "linear-turntable":  # where its one line leads past the part
        first, last = (np.array(truth["base_from_tool0"][name]) @ tool for name in ("p01", "p20"))
        travel, off = (last - first)[:3, 3], place[:3, 3] - first[:3, 3]
        laser[:3, 3] = first[:3, 3] + (laser[:3, 1] @ off) / (laser[:3, 1] @ travel) * travel
    stops = [(pose(turn([0, 0, -np.deg2rad(d)]), [0, 0, 0]) @ back(place) @ laser, d) for d in range(0, 360, 60)]
    captures, more = take_scans(
        OPTIONS, part, ScanCell(tool, place), [(v, float(d)) for v, d in stops], np.random.default_rng(1)
    )
    record["captures"] += captures
    result = merged(record, {**files, **more})
    assert result.verdict != "fail", result.warnings
    assert all(row.used for row in result.residuals)
    assert result.overlap_rms_mm is not None
    assert result.overlap_rms_mm < 0.4


def test_scans_of_a_scanner_that_is_not_placed_are_left_out_and_named() -> None:
    session, _ = seen_by("two-scanners", lambda one: one.scanner == "left")
    patch = "".join(f"{x} {y} 190\n" for x in range(-20, 21) for y in range(-20, 21)).encode()
    scan = {"step": "scan", "kind": "cloud", "files": ["captures/patch.xyz"]}

    def merge(*scanners: str) -> MergeResult:
        captures = [*session.record.captures]
        for name in scanners:
            captures.append(captures[0].model_copy(update={**scan, "id": f"scan-{name}", "scanner": name}))
        record = session.record.model_copy(update={"captures": captures})
        read = {file: session.read(file) for one in session.record.captures for file in one.files}
        result = solve_stage(record, "merge", (read | {"captures/patch.xyz": patch}).__getitem__)
        assert isinstance(result, MergeResult)
        return result

    both, alone = merge("left", "right"), merge("left")
    assert both.points == alone.points > 0
    told = next(one for one in both.findings if one.code == "scanner-not-placed")
    assert told.captures == ["scan-right"]
    assert told.text == "Not merged: scan-right. Nothing says where the scanner 'right' is."
    assert both.verdict == "warn"
    assert "scanner-not-placed" not in {one.code for one in alone.findings}
    reasons = {row.capture: (row.used, row.reason) for row in both.residuals}
    assert reasons == {
        "scan-left": (True, None),
        "scan-right": (False, "by 'right', whose place is not determined"),
    }
    with pytest.raises(cc.CalibrationError, match="where the scanner 'right' is"):
        merge("right")
