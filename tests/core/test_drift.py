"""Drift over a cell's sessions: control charts, what is flagged, and which sessions do not count."""

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import bench_drift
import numpy as np
import pytest
from scipy.stats import kstest

from calib_core.errors import InputError
from calib_core.frames import FloatArray, RigidTransform, rotation_from_vector
from calib_core.records.policy import Environment
from calib_core.review.between_sessions import Measured, SolvedSession
from calib_core.review.drift import CellDrift, cell_drift, charted
from calib_core.review.drift_trend import _slope_by_scatter

SPREAD = np.diag([1e-4, 1e-4, 1e-4, 0.03, 0.02, 0.05]) ** 2


@pytest.mark.thorough
def test_steps_are_found_at_once_and_false_alarms_are_rare() -> None:
    rng = np.random.default_rng(9)
    turns = [rotation_from_vector(rng.normal(size=3)) for _ in range(6)]
    kinds = [turn @ np.diag([0.03, 0.05, 0.1]) ** 2 @ turn.T for turn in turns]
    rows = bench_drift.drawn(60, kinds)
    assert [f"{r.what}: {r.measured}, target {r.target}" for r in rows if not r.holds] == []


def session(
    number: int, off: tuple[float, ...] = (0.0,) * 6, table_off: float = 0.0, **more: Any
) -> SolvedSession:
    rng = np.random.default_rng([number, 5])
    noise = rng.normal(size=6) * np.sqrt(np.diag(SPREAD))
    tool = RigidTransform.of(rotation_from_vector([0.3, 0.1, -1.2]), [35.0, -120.0, 140.0], "tool0", "laser")
    table = RigidTransform.of(rotation_from_vector([0.01, 0.02, 0.5]), [900.0, 100.0, 50.0], "base", "turntable")
    moved = np.array([0.0, 0.0, 0.0, table_off, 0.0, 0.0]) + rng.normal(size=6) * np.sqrt(np.diag(SPREAD))
    result = {
        "verdict": "pass",
        "tool0_from_laser": tool.perturbed(noise + np.array(off)).to_rows(),
        "covariance": SPREAD.tolist(),
        "base_from_turntable": table.perturbed(moved).to_rows(),
        "turntable_covariance": SPREAD.tolist(),
        "workpiece": {"point_in_laser_mm": [0.0, 0.0, 190.0], "covariance": np.eye(3).tolist()},
    }
    checked = {"checks": [{"name": "tool", "value_mm": 0.1, "uncertainty_mm": 0.05}]}
    return SolvedSession(f"s{number}", f"week {number}", "", {"chain": {**result, **more}, "verify": checked})


def flagged(found: CellDrift) -> dict[str, list[str]]:
    return {one.figure: [p.session for p in one.points if p.flagged] for one in found.series}


def test_a_bumped_scanner_is_flagged_once_and_begins_a_new_level() -> None:
    bumped = (0.0, 0.0, 0.0, 0.0, 0.5, 0.0)
    found = cell_drift([session(k, bumped if k >= 8 else (0.0,) * 6) for k in range(12)])
    assert flagged(found) == {
        "tool": ["s8"], "tool-orientation": [], "axis": [], "axis-direction": [], "verification": [],
    }  # fmt: skip
    tool = found.series[0]
    assert [p.level for p in tool.points] == [1] * 8 + [2] * 4
    # One session against the mean of eight, along y: the tool's own error and that of its turn at 190 mm.
    sigma = np.sqrt((1 + 1 / 8) * (SPREAD[4, 4] + 190.0**2 * SPREAD[0, 0]))
    assert tool.points[8].change == pytest.approx(0.5, abs=4 * sigma)
    assert len(found.flags) == 1
    assert re.search(r"0\.\d\d ± 0\.\d\d mm with session week 8", found.flags[0])


def test_a_moved_table_and_a_turned_scanner_are_told_apart() -> None:
    turned = (0.0, 0.003, 0.0, 0.0, 0.0, 0.0)
    drift = cell_drift([session(k, turned if k == 5 else (0.0,) * 6, 0.5 * (k >= 3)) for k in range(6)])
    assert any(re.search(r"orientation changed by 0\.\d{3} ± 0\.\d{3} ° with", said) for said in drift.flags)
    found = flagged(drift)
    assert found["axis"] == ["s3"]
    assert found["axis-direction"] == []
    assert found["tool-orientation"] == ["s5"]


def test_sessions_without_a_good_answer_are_left_out_with_the_reason() -> None:
    empty = SolvedSession("e", "", "", {})
    found = cell_drift([empty, session(1), session(2, verdict="fail"), session(3, undetermined=[{}])])
    assert found.left_out == {
        "e": "not solved", "s2": "its answer failed", "s3": "directions of its answer are not determined",
    }  # fmt: skip
    assert [len(one.points) for one in found.series] == [1] * 5
    assert cell_drift([empty]).series == []


def test_an_answer_that_is_out_of_date_does_not_count_and_the_tool_stands_in_for_its_chain() -> None:
    outdated = [replace(session(k), stale=frozenset({"chain", "verify"})) for k in (1, 2)]
    outdated[1] = replace(outdated[1], results={**outdated[1].results, "tcp": outdated[1].results["chain"]})
    found = cell_drift([session(0), *outdated])
    assert found.left_out == {"s1": "out of date: solve it again"}
    counted = {one.figure: [point.session for point in one.points] for one in found.series}
    assert counted == {
        "tool": ["s0", "s2"], "tool-orientation": ["s0", "s2"], "axis": ["s0"], "axis-direction": ["s0"],
        "verification": ["s0"],
    }  # fmt: skip


def test_a_session_that_is_named_twice_is_refused() -> None:
    with pytest.raises(InputError, match="s1 2 times"):
        cell_drift([session(0), session(1), session(1)])


def test_a_session_that_was_off_alone_is_an_outlier_and_its_level_goes_on() -> None:
    off = (0.0, 0.0, 0.0, 0.0, 0.5, 0.0)
    found = cell_drift([session(k, off if k == 6 else (0.0,) * 6) for k in range(12)])
    points = found.series[0].points
    assert [p.session for p in points if p.flagged] == [p.session for p in points if p.outlier] == ["s6"]
    assert [p.level for p in points] == [1] * 6 + [2] + [1] * 5
    assert "an outlier" in found.flags[0]
    trend = found.series[0].trend
    assert trend is not None
    assert trend.sessions == 11


def test_a_creep_is_told_with_its_sum_and_the_day_on_which_it_meets_the_limit() -> None:
    off = [(0.0, 0.0, 0.0, 0.0, 0.005 * k, 0.0) for k in range(20)]
    dates = [f"2026-05-{k + 1:02}T06:00:00.000Z" for k in range(20)]
    cells = [replace(session(k, off[k]), date=dates[k], limit_mm=0.3) for k in range(20)]
    found = cell_drift(cells)
    trend = found.series[0].trend
    assert trend is not None
    assert trend.found
    assert trend.cusum > 0
    assert trend.forecast is not None
    assert trend.per_session == pytest.approx(0.005, abs=1.5 * trend.uncertainty)  # of k = 2: three sigmas
    assert trend.uncertainty < 0.005
    assert trend.forecast.sessions == np.ceil(0.3 / trend.per_session) - 19
    assert trend.forecast.earliest_sessions == np.ceil(0.3 / (trend.per_session + trend.uncertainty)) - 19
    assert trend.forecast.date is not None
    day = datetime(2026, 5, 20, tzinfo=UTC) + timedelta(days=trend.forecast.sessions)  # one session a day
    assert trend.forecast.date[:10] == day.date().isoformat()
    (said,) = (one for one in found.trends if one.startswith("Scanner at"))
    assert "reaches the limit of 0.3 mm" in said
    quiet = cell_drift([replace(session(k), limit_mm=0.5) for k in range(12)])
    assert quiet.trends == []
    assert quiet.series[0].trend is not None
    assert quiet.series[0].trend.forecast is None


def test_what_follows_the_temperature_of_the_arm_is_told_beside_it() -> None:
    warm = [float(20 + (7 * k) % 10) for k in range(10)]
    cells = [
        replace(session(k, (0.0, 0.0, 0.0, 0.0, 0.016 * (t - 20), 0.0)), environment=Environment(arm_c=t))
        for k, t in enumerate(warm)
    ]
    found = cell_drift(cells)
    tool = found.series[0]
    assert [p.environment.arm_c if p.environment else None for p in tool.points] == warm
    assert tool.temperature is not None
    assert tool.temperature.per_k == pytest.approx(0.016, abs=tool.temperature.uncertainty)
    assert any("follows the arm's temperature: 0.0" in said for said in found.trends)
    assert found.series[2].temperature is not None
    assert not found.series[2].temperature.found


def at(poses: int, off_mm: float = 0.0) -> FloatArray:
    """Return a program of poses, the last one off by so much."""
    program = np.tile(np.eye(4), (poses, 1, 1))
    program[:, 0, 3] = 100.0 * np.arange(poses)
    program[-1, 1, 3] = off_mm
    return program


def nightly(number: int, shift_mm: float = 0.0, program: FloatArray | None = None) -> SolvedSession:
    """Return a night whose tool scatters by a tenth of its stated ±."""
    rng = np.random.default_rng([number, 6])
    found = session(number)
    tool = RigidTransform.of(rotation_from_vector([0.3, 0.1, -1.2]), [35.0, -120.0, 140.0], "tool0", "laser")
    noise = 0.1 * rng.normal(size=6) * np.sqrt(np.diag(SPREAD)) + [0, 0, 0, 0, shift_mm, 0]
    chain = {**found.results["chain"], "tool0_from_laser": tool.perturbed(noise).to_rows()}
    return replace(found, results={"chain": chain}, program=at(14) if program is None else program)


def test_nights_at_the_same_poses_tell_a_step_that_their_stated_uncertainty_hides() -> None:
    nights = [nightly(k, 0.06 * (k == 8)) for k in range(9)]
    found = cell_drift(nights)
    last = found.series[0].points[-1]
    assert (last.flagged, last.like) == (True, 8)
    assert last.limit is not None
    assert last.change < last.uncertainty  # it is less than the stated ± of the difference
    assert "the 8 sessions before it at the same poses scatter" in found.flags[0]
    # At other poses the arm errs otherwise: there only the stated ± counts.
    elsewhere = [*nights[:8], nightly(8, 0.06, at(14, off_mm=40.0))]
    assert flagged(cell_drift(elsewhere))["tool"] == []
    unknown = [replace(night, program=None) for night in nights]
    assert flagged(cell_drift(unknown))["tool"] == []
    # Less than half the stated ± is no step, however well the nights agree.
    small = cell_drift([nightly(k, 0.01 * (k == 8)) for k in range(9)])
    assert small.flags == []


def test_nights_at_the_same_poses_tell_a_creep_early() -> None:
    creeping = [nightly(k, 0.01 * k) for k in range(8)]
    trend = cell_drift(creeping).series[0].trend
    assert trend is not None
    assert trend.found
    assert trend.per_session == pytest.approx(0.01, abs=1.5 * trend.uncertainty)
    by_stated = cell_drift([replace(night, program=None) for night in creeping]).series[0].trend
    assert by_stated is not None
    assert by_stated.uncertainty > 3 * trend.uncertainty
    assert not by_stated.found


SCALE, SCALE_SIGMA = 0.004, 0.003


def of_scanner(number: int, off_mm: float = 0.0, applied: bool = False, serial: str = "1") -> SolvedSession:
    """Return a session of a scanner whose scale is off, which moves its tool by 50 or 70 mm times that."""
    follows, rng = np.zeros(6), np.random.default_rng([number, 8])
    follows[3] = 60 + 10 * (-1) ** number
    found = SCALE + SCALE_SIGMA * rng.normal()
    stated = SPREAD + SCALE_SIGMA**2 * np.outer(follows, follows)
    scanner = {
        "names": ["scale_x"], "values": [found], "covariance": [[SCALE_SIGMA**2]], "applied": applied,
        "covariance_with_tool": (SCALE_SIGMA**2 * follows)[:, None].tolist(),
    }  # fmt: skip
    off = follows * ((found if applied else 0.0) - SCALE) + np.array([0, 0, 0, off_mm, 0, 0])
    made = session(number, tuple(off), scanner=scanner, covariance=stated.tolist())
    return replace(made, equipment=("40.0", f"scanner {serial}"))


@pytest.mark.parametrize("applied", [False, True])
def test_what_all_sessions_of_one_scanner_share_hides_no_step(applied: bool) -> None:
    found = cell_drift([of_scanner(k, 0.3 * (k == 8), applied) for k in range(9)])
    assert flagged(found)["tool"] == ["s8"]
    step = found.series[0].points[-1]
    assert step.change == pytest.approx(0.3, abs=1.5 * step.uncertainty)
    assert step.uncertainty < SCALE_SIGMA * 50  # far below the stated ±
    quiet = cell_drift([of_scanner(k, 0.0, applied) for k in range(20)])
    assert (quiet.flags, quiet.trends) == ([], [])
    # Another scanner errs otherwise: against it only the whole ± counts.
    other = [*(of_scanner(k, 0.0, applied) for k in range(8)), of_scanner(8, 0.3, applied, "2")]
    assert flagged(cell_drift(other))["tool"] == []


def test_a_creep_below_the_stated_uncertainty_is_told_of_one_scanner() -> None:
    trend = cell_drift([of_scanner(k, 0.009 * k) for k in range(16)]).series[0].trend
    assert trend is not None
    assert trend.found
    assert trend.per_session == pytest.approx(0.009, abs=1.5 * trend.uncertainty)
    by_stated = cell_drift([of_scanner(k, 0.009 * k, serial=f"{k}") for k in range(16)]).series[0].trend
    assert by_stated is not None
    assert not by_stated.found


@pytest.mark.thorough
def test_the_step_that_a_night_finds_at_once_is_stated() -> None:
    covariance = np.diag([0.01, 0.004, 0.002])
    rng, found = np.random.default_rng(12), {1.0: 0, 0.6: 0}
    for _ in range(400):
        nights = [
            bench_drift.measured(rng.multivariate_normal(np.zeros(3), covariance), covariance) for _ in range(12)
        ]
        stated = charted(nights)[-1].finds
        assert stated is not None
        for share in found:
            there = [share * stated, 0.0, 0.0]  # in the direction that is known least
            found[share] += charted([*nights[:-1], bench_drift.moved(nights[-1], np.array(there))])[-1].flagged
    assert 0.92 * 400 <= found[1.0] <= 0.98 * 400
    assert found[0.6] < 0.5 * 400


def test_the_slope_by_scatter_is_within_its_uncertainty_and_chance_within_its_own() -> None:
    """Sessions that scatter by half of what is stated: ± of two sigmas holds 95 of 100, and chances are even."""
    rng, places = np.random.default_rng(4), np.arange(20.0) - 9.5
    one = nightly(1)
    held, chances = [], []
    for _ in range(200):
        off = rng.normal(0, 0.05, 20)
        figures = [
            Measured(one, np.array([0.2 * x + y]), np.eye(1) * 0.1**2) for x, y in zip(places, off, strict=True)
        ]
        slope, uncertainty, _ = _slope_by_scatter(figures, places)
        held.append(abs(slope - 0.2) <= uncertainty)
        quiet = [Measured(one, np.array([y]), np.eye(1) * 0.1**2) for y in off]
        chances.append(_slope_by_scatter(quiet, places)[2])
    assert 0.9 < np.mean(held) < 0.99
    assert kstest(chances, "uniform").pvalue > 1e-3
