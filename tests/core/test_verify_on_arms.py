"""A verification at other poses of an arm that errs by half a millimetre, told or solved with the tool."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.verify.record import VerifyResult
from tests.arm_cell import ARM_KINDS, later_before_a_tracker, later_on_an_arm, simulate_arm

RIGHT = [("small", 8000), ("cobot", 8001), ("medium", 8002)]


@cache
def verified(kind: str, seed: int, errors: str | None, tool_mm: float = 0.0) -> VerifyResult:
    session = later_on_an_arm(kind, seed, "verify", tool_mm=tool_mm, errors=errors)
    result = solve_stage(session, "verify", lambda _name: b"")
    assert isinstance(result, VerifyResult)
    return result


@pytest.mark.parametrize("errors", [None, "apply"])
@pytest.mark.parametrize(("kind", "seed"), RIGHT)
def test_a_right_answer_explains_captures_at_other_poses(kind: str, seed: int, errors: str | None) -> None:
    result = verified(kind, seed, errors)
    assert result.chance is not None
    assert result.chance > 0.01
    assert result.verdict == "pass"


@pytest.mark.parametrize(
    ("kind", "seed", "errors"),
    [("desktop", 96000, None), ("medium", 96003, None), ("rough", 96001, "apply")],
)
def test_few_captures_of_a_ball_on_an_arm_alarm_of_no_right_answer(
    kind: str, seed: int, errors: str | None
) -> None:
    rough = replace(ARM_KINDS["small"], ripple_rad=7e-4, backlash_rad=3e-4, cable_mm=0.15)
    made, swing = (rough, "wide") if kind == "rough" else (kind, "usual")
    session = later_before_a_tracker(made, seed, 15, swing=swing, errors=errors)
    result = solve_stage(session, "verify", lambda _name: b"")
    assert isinstance(result, VerifyResult)
    assert result.chance is not None
    assert result.chance > 0.01
    assert "verify-scatter-large" not in {finding.code for finding in result.findings}


def test_the_scatter_that_is_expected_is_that_which_such_arms_show() -> None:
    every = [verified(kind, seed, None) for kind, seed in RIGHT]
    freedom = sum(one.degrees_of_freedom for one in every)
    assert 0.5 < sum(one.chi_squared or 0.0 for one in every) / freedom < 1.5


@pytest.mark.parametrize(("tool_mm", "chance"), [(0.6, 0.01), (1.0, 1e-4)])
@pytest.mark.parametrize("errors", [None, "apply"])
def test_a_scanner_that_moved_is_told_on_such_an_arm(errors: str | None, tool_mm: float, chance: float) -> None:
    result = verified("small", 8000, errors, tool_mm=tool_mm)
    assert result.moved_chance is not None
    assert result.moved_chance < chance
    assert result.verdict in ("warn", "fail")
    assert "verify-tool-moved" in {finding.code for finding in result.findings}


@pytest.mark.parametrize(("kind", "errors"), [("small", "apply"), ("desktop", "apply"), ("medium", None)])
def test_a_tracker_that_moved_is_told_and_one_that_stood_still_is_not(kind: str, errors: str | None) -> None:
    for mm in (0.0, 0.6):
        session = later_before_a_tracker(kind, 97000, 30, errors=errors, mm=mm)
        result = solve_stage(session, "verify", lambda _name: b"")
        codes = {finding.code for finding in result.findings}
        assert ("verify-tool-moved" in codes) == (mm > 0)


def test_what_a_few_captures_know_of_the_scatter_is_told() -> None:
    few, many = (simulate_arm("small", 8000, count, held=0).session for count in (8, 60))
    known = [solve_stage(session, "tcp", lambda _name: b"") for session in (few, many)]
    degrees = [one.variance_components.degrees_of_freedom or np.inf for one in known if isinstance(one, TcpResult)]
    assert degrees[0] < 3 * 8
    assert degrees[0] < degrees[1]
