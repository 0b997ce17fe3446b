"""A verification at other poses of an arm that errs by half a millimetre, told or solved with the tool."""

from functools import cache

import pytest

from calib_core.stages.pipeline import solve_stage
from calib_core.stages.verify.record import VerifyResult
from tests.arm_cell import later_on_an_arm

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


def test_the_scatter_that_is_expected_is_that_which_such_arms_show() -> None:
    every = [verified(kind, seed, None) for kind, seed in RIGHT]
    freedom = sum(one.degrees_of_freedom for one in every)
    assert 0.5 < sum(one.chi_squared or 0.0 for one in every) / freedom < 1.5


@pytest.mark.parametrize("errors", [None, "apply"])
def test_a_scanner_that_moved_is_told_on_such_an_arm(errors: str | None) -> None:
    result = verified("small", 8000, errors, tool_mm=1.0)
    assert result.chance is not None
    assert result.chance < 1e-4
    assert result.verdict in ("warn", "fail")
