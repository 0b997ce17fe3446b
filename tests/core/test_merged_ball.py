"""A ball on the table, scanned from around by a chain with its ordinary errors: `scancell bench ball` in short."""

from dataclasses import replace

import bench_ball
import numpy as np
import pytest

from calib_core.simulation import simulate_table
from calib_core.simulation.whole_cell import WHOLE_SCENARIOS, with_scans

SEEDS = range(1)


@pytest.fixture(scope="module")
def runs():
    whole = WHOLE_SCENARIOS["ball"]
    scanner = replace(whole.part.scanner, pitch_mm=0.6)
    coarse = replace(whole, part=replace(whole.part, scanner=scanner))
    simulated = (with_scans(simulate_table(seed, coarse.table, "ball"), coarse, seed) for seed in SEEDS)
    return [bench_ball.one(seed, cell) for seed, cell in zip(SEEDS, simulated, strict=True)]


@pytest.mark.thorough
def test_scans_lie_apart_as_the_chains_covariance_predicts_before_any_registration(runs):
    # One seed's overlap scatters by a tenth about what is predicted: errors that scans share are drawn once.
    ratio = np.sqrt(sum(run.overlap_mm2 for run in runs) / sum(run.expected_overlap_mm2 for run in runs))
    assert ratio == pytest.approx(1.0, abs=2 * 0.1 / np.sqrt(len(runs)))


@pytest.mark.thorough
def test_the_ball_is_where_and_as_large_as_stated(runs):
    for run in runs:
        assert abs(run.before.diameter_error_mm) < 3.3 * run.before.diameter_sigma_mm
        assert run.before.nees < 16.3  # 99.9 % of χ² with 3
        assert run.after.nees < 16.3


@pytest.mark.thorough
def test_registration_takes_away_the_chains_part_of_the_diameters_error(runs):
    for run in runs:
        assert abs(run.after.diameter_error_mm) <= 0.02
        assert run.after.diameter_sigma_mm < 0.1 * run.before.diameter_sigma_mm
        assert np.trace(run.after.center_covariance) < np.trace(run.before.center_covariance)
