"""Drift within a session: found with its size and its course where there is one, and not where there is none."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

import calib_core as cc
from calib_core.chain.warm_up import _drift, _largest_step, _Said, _Scores
from calib_core.records import Session
from calib_core.review.between_sessions import SolvedSession
from calib_core.review.drift import cell_drift
from calib_core.simulation.motion import FloatArray, pose
from calib_core.stages.pipeline import run, stage_input
from calib_core.stages.tcp.record import SessionDrift, TcpResult
from calib_core.stages.tcp.result import solution_findings
from calib_core.stages.tcp.solve import solve_tcp_captures
from calib_core.stages.tcp.warm_up import session_drift
from tests.trouble import Trouble, Troubled, all_troubles, troubled


def warming(drift_mm: float, constant: float | None, seed: int) -> Troubled:
    """Return a session whose scanner shifts on the flange, with time constant in session lengths; None: a line."""

    def change(plan: Any, rng: np.random.Generator) -> None:
        way = rng.standard_normal(3)
        way *= drift_mm / np.linalg.norm(way)
        last = plan.shifts + plan.tilts - 1
        share = np.arange(last + 1) / last
        course = 1 - share if constant is None else np.exp(-share / constant)

        def mounting(k: int) -> FloatArray:
            return pose(np.eye(3), way * course[k])

        plan.mounting = mounting

    return troubled(Trouble("warms up", change), seed)


@cache
def solved(drift_mm: float, constant: float | None, seed: int, every_s: float | None = None) -> TcpResult:
    cell = warming(drift_mm, constant, seed)
    record = cell.session.to_json()
    for number, capture in enumerate(record["captures"]):
        if every_s is not None:
            capture["device_time_s"] = 1000.0 + every_s * number
    result = run(Session.model_validate(record), cell.files.__getitem__, "tcp")["tcp"]
    assert isinstance(result, TcpResult)
    return result


def drift(result: TcpResult) -> SessionDrift:
    assert result.warm_up is not None
    return result.warm_up


@pytest.mark.parametrize("seed", range(2))
def test_a_scanner_that_warms_up_is_found_with_how_far_and_until_when(seed: int) -> None:
    found = drift(solved(0.6, 0.2, seed, 60.0))
    assert found.found
    assert found.settled
    true_mm = 0.6 * (1 - np.exp(-1 / 0.2))
    assert found.drift_mm == pytest.approx(true_mm, abs=2 * found.uncertainty_mm)
    assert found.uncertainty_mm < 0.4
    assert found.over_s == pytest.approx(14 * 60.0)
    assert 2 * 60 < (found.settling_s or 0) < 7 * 60
    assert found.again[0] == "p000"
    assert 2 <= len(found.again) <= 8
    assert f"± {found.uncertainty_mm:.2f} mm. Most of it was in the first" in found.sentence
    assert "minutes" in found.sentence


def test_one_that_goes_on_to_the_end_has_not_settled_and_is_no_sudden_move() -> None:
    result = solved(1.5, None, 1)
    assert drift(result).found
    assert not drift(result).settled
    assert drift(result).over_s is None
    assert "over 15 captures, to the end" in drift(result).sentence
    assert result.verdict != "pass"
    assert drift(result).sentence in result.warnings
    assert [cause.kind for cause in result.causes] == []


def test_a_drift_that_the_uncertainty_covers_is_a_note() -> None:
    result = solved(0.3, None, 2)
    assert drift(result).found
    assert drift(result).sentence in result.notes
    assert result.verdict == "pass"


def test_it_is_not_said_of_captures_that_do_not_fit_together() -> None:
    cell = warming(0.6, 0.2, 0)
    given = stage_input(cell.session, "tcp", cell.files.__getitem__)
    solution = solve_tcp_captures(given).solution
    assert {"drift-in-session", "drift-covered"} & {one.code for one in solution_findings(solution)}
    hopeless = replace(solution, joint=replace(solution.joint, center_scatter_rms_mm=30.0))
    said = {one.code for one in solution_findings(hopeless)}
    assert "poses-do-not-fit" in said
    assert not {"drift-in-session", "drift-covered", "poses-lag"} & said


def test_its_plot_is_over_time_where_captures_have_one() -> None:
    plots = {block.id: block for block in solved(0.6, 0.2, 0, 60.0).evidence if block.kind == "plot"}
    assert plots["drift"].x.unit == "min"
    assert plots["drift"].series[0].x[-1] == pytest.approx(14.0)
    plots = {block.id: block for block in solved(0.3, None, 2).evidence if block.kind == "plot"}
    assert plots["drift"].x.label == "Capture"


def test_captures_of_two_scanners_at_one_stop_lie_off_a_drift_by_what_the_pose_errs() -> None:
    result = cc.simulate("two-scanners", 3)[0].run("tcp")["tcp"]
    points = result.warm_up.points
    off = np.array([(one.offset_mm - one.course_mm) / one.sigma_mm for one in points])
    assert 0.3 < np.mean(off**2) < 2.0  # it was 0.0: each lay on the line
    assert 0.03 < np.median([one.sigma_mm for one in points]) < 0.1
    assert np.corrcoef(off[::2], off[1::2])[0, 1] > 0.5  # both saw the same pose's error


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    "name", ["arms: clean", "arms: joints, gears and sag", "books: tool changed midway by 0.5 mm"]
)
def test_nothing_else_is_taken_for_it(name: str) -> None:
    for seed in range(2):
        cell = troubled(all_troubles()[name], seed, told=bool(seed % 2))
        solution = solve_tcp_captures(stage_input(cell.session, "tcp", cell.files.__getitem__)).solution
        told = session_drift(solution)
        assert told is not None
        assert not told.found
        assert told.sentence == ""


def test_the_drift_of_a_cell_tells_it_of_each_session() -> None:
    results = {"tcp": solved(1.5, None, 1).to_json()}
    told = cell_drift([SolvedSession("a", "cold start", "2026-01-01", results)])
    assert [(one.name, one.found, one.settled) for one in told.within] == [("cold start", True, False)]
    assert told.within[0].sentence.startswith("The scanner")


def scores_of(off_mm: FloatArray, sigma_mm: float) -> _Scores:
    """What independent captures (K, 3) say of a drift, each as noisy as all."""
    count = len(off_mm)
    said = off_mm / sigma_mm**2, np.tile(np.eye(3) / sigma_mm**2, (count, 1, 1)), np.zeros((count, 3, 1))
    misfit = float((off_mm**2).sum()) / sigma_mm**2
    return _Scores(*said, "scanner", _Said(*said), np.zeros((1, 1)), np.zeros(1), misfit)


@pytest.mark.parametrize("after", [2, 3, 7, 12, 13])
def test_the_likeliest_sudden_shift_is_that_of_the_best_of_all_splits(after: int) -> None:
    """Independent captures of one noise: a split takes off χ² what the mean before it is off, by least squares."""
    rng, sigma_mm, count = np.random.default_rng(after), 0.05, 15
    off = rng.normal(0, sigma_mm, (count, 3)) + np.where(np.arange(count) < after, 0.4, 0.0)[:, None]
    scores = scores_of(off, sigma_mm)
    gains = []
    for first in range(2, count - 1):
        left = off.copy()
        left[:first] -= off[:first].mean(axis=0)
        gains.append(float((off**2).sum() - (left**2).sum()) / sigma_mm**2)
    assert _largest_step(scores) == pytest.approx(max(gains), rel=1e-3)


def test_how_rarely_chance_gives_as_much_is_as_stated_whatever_the_sigmas() -> None:
    """Chances of what does not drift are spread evenly from 0 to 1, also where the noise is thrice as told."""
    rng, weights = np.random.default_rng(8), np.linspace(1, 0, 80)
    chances = [
        _drift(scores_of(rng.normal(0, told * 0.05, (80, 3)), 0.05), None, weights).chance
        for told in (1.0, 3.0)
        for _ in range(200)
    ]
    assert kstest(chances, "uniform").pvalue > 1e-3
    drifting = rng.normal(0, 0.05, (80, 3)) + 0.1 * weights[:, None]
    assert _drift(scores_of(drifting, 0.05), None, weights).chance < 1e-6
