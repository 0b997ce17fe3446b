"""Both real cells through the pipeline: nothing is told but the sphere's diameter and the convention."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from calib_core.frames import RigidTransform
from calib_core.records import parse_session
from calib_core.robots import to_pose
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult

# Distances of left-out captures, and the independent solvers' tool as x y z W P R (mm, degrees).  Plain least
# squares on the points leaves 0.187 and 0.458 mm; the arm's and the scanner's errors cost the second set some.
# Nothing but these sets says how large they may be: the limits are 5 to 10 % above what was seen (0.172 and
# 0.563 mm), to notice a change, and no target.
CELLS = {
    "tcp-sphere-80mm": (0.19, (-149.6, 709.5, 487.2, 179.5, 0.45, -91.8)),
    "tcp-sphere-25mm": (0.60, (79.0, -11.6, 263.4, -178.1, -0.16, 131.3)),
}
CELL = pytest.mark.parametrize("name", CELLS)


@cache
def solved(folder: Path, tell_z_axis: bool = True) -> TcpResult:
    data = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    if not tell_z_axis:
        del data["cell"]["scanner"]["z_axis"]
    result = solve_stage(parse_session(data), "tcp", lambda name: (folder / name).read_bytes())
    assert isinstance(result, TcpResult)
    return result


@CELL
def test_left_out_captures_and_the_tool_are_near_the_reference(data_folder: Path, name: str) -> None:
    left_out_mm, reference = CELLS[name]
    result = solved(data_folder / name)
    assert result.leave_one_out_surface_rms_mm is not None
    assert result.leave_one_out_surface_rms_mm <= left_out_mm
    assert [row.reason for row in result.residuals if not row.used] == []
    tool = RigidTransform(np.array(result.tool0_from_laser), "tool0", "laser")
    numbers = np.array(to_pose("fanuc", RigidTransform(tool.matrix, "base", "tool0")))
    np.testing.assert_allclose(numbers[:3], reference[:3], atol=2)
    np.testing.assert_allclose((numbers[3:] - reference[3:] + 180) % 360 - 180, 0, atol=2)
    assert result.verdict in ("pass", "warn")
    assert result.undetermined == []


def test_the_spheres_are_on_the_sides_where_they_fit(data_folder: Path) -> None:
    """A great circle's own side is nobody's to say."""
    sides = {
        name: {
            row.side for row in solved(data_folder / name).residuals if row.zone is not None and row.zone < 0.99
        }
        for name in CELLS
    }
    assert len(sides["tcp-sphere-80mm"]) == 1
    assert len(sides["tcp-sphere-25mm"]) == 1
    assert sides["tcp-sphere-80mm"] != sides["tcp-sphere-25mm"]


@pytest.mark.thorough(keep=1)
@CELL
def test_the_sense_of_z_need_not_be_told(data_folder: Path, name: str) -> None:
    told, found = solved(data_folder / name), solved(data_folder / name, tell_z_axis=False)
    np.testing.assert_allclose(found.tool0_from_laser, told.tool0_from_laser, atol=1e-6)
    np.testing.assert_allclose(found.covariance, told.covariance, rtol=1e-6)


@CELL
def test_the_robots_scatter_is_that_of_such_arms(data_folder: Path, name: str) -> None:
    components = solved(data_folder / name).variance_components
    # Each pose's own part and what poses share.
    together = np.hypot(components.position_sigma_mm, components.alike_position_sigma_mm)
    # Below the 0.05 mm to which the best of such arms are true something else was taken for the poses' errors.
    assert 0.04 < together < 1.0
    assert components.orientation_sigma_rad < 5e-4
    assert components.estimated == ["point_sigma_mm", "position_sigma_mm", "orientation_sigma_rad"]


def test_leave_one_out_is_of_the_references_size(data_folder: Path) -> None:
    """Sensible sigmas cost some of it against plain least squares on the points: never a multiple."""
    result = solved(data_folder / "tcp-sphere-80mm")
    worst = max(result.residuals, key=lambda row: row.leave_one_out_rms_mm or 0.0)
    assert result.leave_one_out_surface_rms_mm is not None
    assert result.surface_rms_mm < result.leave_one_out_surface_rms_mm < 3 * result.surface_rms_mm
    assert (worst.leave_one_out_rms_mm or 0.0) < 1.5


@pytest.mark.thorough
def test_a_great_circle_does_not_hurt(data_folder: Path) -> None:
    """Without the first capture, which is almost one, the answer is the same within its uncertainty."""
    folder = data_folder / "tcp-sphere-80mm"
    data = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    data["captures"][0]["excluded"] = True
    without = solve_stage(parse_session(data), "tcp", lambda name: (folder / name).read_bytes())
    assert isinstance(without, TcpResult)
    whole = solved(folder)
    here = RigidTransform(np.array(whole.tool0_from_laser), "tool0", "laser")
    there = RigidTransform(np.array(without.tool0_from_laser), "tool0", "laser")
    sigmas = np.sqrt(np.diag(np.array(without.covariance)))
    assert np.abs(here.difference(there) / sigmas).max() < 1.5
    # The sigmas are estimated anew without it, which moves the variances by a quarter or so.
    assert (np.diag(np.array(whole.covariance)) <= 1.5 * np.diag(np.array(without.covariance))).all()


_ACCUSES = {
    "poses-do-not-fit", "swapped-poses", "shifted-poses", "pose-list-order", "pose-reading", "sphere-diameter",
            "scaled-profile", "moved-sphere", "changed-tool"}  # fmt: skip
# Few captures, most of them alike: the first four are translations.  In each of them something was accused once.
FEW = {
    "tcp-sphere-80mm": [
        ("p01", "p02", "p03", "p04", "p06", "p11", "p12"),
        ("p01", "p02", "p03", "p04", "p06", "p10", "p15"),
    ],
    "tcp-sphere-25mm": [("p02", "p03", "p04", "p05", "p06", "p08", "p09")],
}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("name", "captures"), [(name, some) for name in FEW for some in FEW[name]])
def test_few_right_captures_are_not_accused_of_anything(
    data_folder: Path, name: str, captures: tuple[str, ...]
) -> None:
    folder = data_folder / name
    data = json.loads((folder / "session.json").read_text(encoding="utf-8"))
    data["captures"] = [c for c in data["captures"] if c["id"] in captures]
    result = solve_stage(parse_session(data), "tcp", lambda file: (folder / file).read_bytes())
    assert isinstance(result, TcpResult)
    assert {finding.code for finding in result.findings} & _ACCUSES == set()
    assert [row.reason for row in result.residuals if not row.used] == []
    here, there = np.array(result.tool0_from_laser), np.array(solved(folder).tool0_from_laser)
    assert np.arccos((np.trace(here[:3, :3].T @ there[:3, :3]) - 1) / 2) < np.deg2rad(2)
    # The first of these turn about one axis alone: nothing is stated of the place then.
    if np.isfinite(here[:3, 3]).all():
        sigma_mm = np.sqrt(np.diag(np.array(result.covariance))[3:].max())
        assert np.linalg.norm(here[:3, 3] - there[:3, 3]) < 3.5 * sigma_mm
    else:
        assert "tool-position-without-turns" in {finding.code for finding in result.findings}


@pytest.mark.thorough
def test_six_captures_of_which_one_alone_tells_a_direction_are_judged(
    data_folder: Path,
) -> None:
    data = json.loads((data_folder / "tcp-sphere-80mm" / "session.json").read_text(encoding="utf-8"))
    some = {"p01", "p02", "p03", "p04", "p07", "p15"}
    data["captures"] = [capture for capture in data["captures"] if capture["id"] in some]
    result = solve_stage(
        parse_session(data), "tcp", lambda name: (data_folder / "tcp-sphere-80mm" / name).read_bytes()
    )
    assert isinstance(result, TcpResult)
    assert result.verdict == "fail"
    assert all(np.isfinite(row.mahalanobis) for row in result.residuals)
