"""What overlapping scans say of the tool that they share: a ball's diameter, and nothing where surfaces slide."""

import runpy
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from calib_core.frames import RigidTransform
from calib_core.fusion.overlap import PoseErrors
from calib_core.fusion.solve import MergeOptions, MergeSolution, solve_merge
from calib_core.records import MergeSettings
from calib_core.simulation import simulate
from calib_core.sphere.cloud import fit_sphere
from calib_core.stages.merge.record import MergeResult
from calib_core.stages.pipeline import solve_stage
from tests.core.test_session_merge import session, solve
from tests.merged_sphere import sphere_covariance

sphere_scans = SimpleNamespace(**runpy.run_path(str(Path(__file__).with_name("sphere_scans.py"))))

TOOL = np.array([1e-5, 1e-5, 1e-5, 0.01, 0.01, 0.1])  # along the light it is known ten times worse
OWN = np.array([1e-5, 1e-5, 1e-5, 0.02, 0.02, 0.02])


def diameter(solution: MergeSolution) -> tuple[float, float]:
    """Return the error of the ball's diameter and its stated standard deviation."""
    fit = fit_sphere(solution.grid.cloud().points_mm.astype(float))
    covariance = sphere_covariance(solution.patches, solution.errors, fit.center_mm)
    return 2 * (fit.radius_mm - sphere_scans.RADIUS_MM), 2 * float(np.sqrt(covariance[3, 3]))


@pytest.mark.thorough
def test_the_tools_error_along_the_light_no_longer_makes_the_ball_larger():
    before, after = [], []
    for seed in range(3):
        scans, errors = sphere_scans.scanned(36, 0.5, seed, TOOL, OWN)
        before.append(diameter(solve_merge(scans, errors, MergeOptions(mesh="none"))))
        solution = solve_merge(scans, errors, MergeOptions(mesh="none", self_calibration=True))
        assert solution.self_calibration is not None
        assert solution.self_calibration.directions >= 1
        assert solution.registration is None
        after.append(diameter(solution))
    (wrong, stated_wrong), (left, stated) = np.transpose(before), np.transpose(after)
    assert np.sqrt(np.mean(wrong**2)) > 0.05
    assert (np.abs(left) < 3 * stated).all()
    assert stated.max() < 0.25 * stated_wrong.min()


def test_scans_that_do_not_overlap_say_nothing():
    scans, errors = sphere_scans.scanned(36, 0.5, 0, TOOL, OWN)
    first = PoseErrors(errors.common[:1], errors.own[:1])
    found = solve_merge(scans[:1], first, MergeOptions(mesh="none", self_calibration=True)).self_calibration
    assert found is not None
    assert found.directions == 0
    np.testing.assert_allclose(found.shift, 0)
    np.testing.assert_allclose(found.covariance, np.eye(len(found.shift)))


@pytest.mark.thorough
def test_a_tool_that_is_known_exactly_is_not_moved_and_that_is_said():
    result = solve(session(self_calibration=True))
    assert result.self_calibration is None
    assert any("No self-calibration" in warning for warning in result.warnings)


@pytest.mark.thorough
def test_the_tools_stated_covariance_holds_on_a_part_with_edges():
    seeds, squares = (3, 5), 0.0  # two of the worst of eight
    for seed in seeds:
        simulated = simulate("cell", seed)
        settings = MergeSettings(mesh="none", self_calibration=True)
        cell = simulated.session.cell.model_copy(update={"merge": settings})
        asked = simulated.session.model_copy(update={"cell": cell})
        result = solve_stage(asked, "merge", simulated.files.__getitem__)
        assert isinstance(result, MergeResult)
        assert result.self_calibration is not None
        assert result.self_calibration.directions >= 2
        chain, truth = (
            RigidTransform(np.array(rows), "tool0", "laser")
            for rows in (result.tool0_from_laser, simulated.truth["tool0_from_laser"])
        )
        error = chain.difference(truth) - np.array(result.self_calibration.shift)[:6]
        covariance = np.array(result.self_calibration.covariance)[:6, :6]
        squares += float(error @ np.linalg.solve(covariance, error))
    assert squares < stats.chi2.ppf(0.999, 6 * len(seeds))
