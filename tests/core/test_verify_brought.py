"""Verifying a tool that the user brings without an uncertainty: its own error is no reason for wrong sides."""

import pytest

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.verify.record import VerifyResult
from tests.verified import brought_tool


def verified(off_mm: float, shuffled: bool = False, seed: int = 5, wrong: str = "") -> VerifyResult:
    cell = brought_tool(seed, off_mm, shuffled)
    for capture in cell.session.captures:
        if capture.id == wrong and capture.pose is not None:
            capture.pose[0] += 1.0
    result = solve_stage(cell.session, "verify", cell.files.__getitem__)
    assert isinstance(result, VerifyResult)
    return result


def test_a_tool_off_by_less_than_the_limit_passes_and_by_more_fails() -> None:
    good, bad = verified(0.3), verified(1.6)
    assert (good.decision, good.verdict) == ("pass", "pass"), good.warnings  # undecided: error 23.7 mm, before
    assert good.checks[0].value_mm == pytest.approx(0.3, abs=good.checks[0].uncertainty_mm)
    assert bad.decision == "fail"
    assert bad.checks[0].value_mm == pytest.approx(1.6, abs=bad.checks[0].uncertainty_mm)


def test_points_that_no_tool_brings_onto_the_ball_are_told_before_any_figure() -> None:
    result = verified(0.3, shuffled=True)
    assert result.findings[0].code == "verify-points-off-ball"
    assert (result.decision, result.verdict) == ("undecided", "warn")


def test_right_captures_agree_where_nothing_is_told_of_the_robot_and_a_wrong_one_is_named() -> None:
    """Weighed by the profiles' noise alone, one of these was 6 sigmas off."""
    assert verified(0.3, seed=16).verdict == "pass"
    named = verified(0.3, seed=16, wrong="p005").findings[0]
    assert (named.code, list(named.captures)) == ("verify-captures-disagree", ["p005"])
