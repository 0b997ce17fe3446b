"""Captures that all have another one's pose fit nowhere, or are handed out rightly: never are two swapped."""

import numpy as np
import pytest

from calib_core.records import Session
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import all_troubles, troubled


def mixed(session: Session, seed: int) -> Session:
    """Return a session in which no capture keeps its own pose."""
    captures, rng = session.captures, np.random.default_rng(seed)
    order = rng.permutation(len(captures))
    while (order == np.arange(len(captures))).any():
        order = rng.permutation(len(captures))
    given = [one.model_copy(update={"pose": captures[k].pose}) for one, k in zip(captures, order, strict=True)]
    return session.model_copy(update={"captures": given})


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(
    ("name", "seed"), [("seven captures", 9), ("seven captures", 0), ("half of 14 poses alike", 4)]
)
def test_poses_that_are_all_mixed_are_no_two_that_are_swapped(name: str, seed: int) -> None:
    cell = troubled(all_troubles()[f"books: {name}"], seed)
    result = solve_stage(mixed(cell.session, seed), "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert result.verdict == "fail"
    assert result.findings[0].code == "poses-do-not-fit"
    assert "swapped-poses" not in {one.code for one in result.findings}  # "p001 and p006", once
    assert result.confidence_95 == {}  # what is not believed is not stated


@pytest.mark.thorough
def test_a_mixed_order_of_few_that_fits_to_the_arm_is_handed_out() -> None:
    cell = troubled(all_troubles()["books: seven captures"], 4)
    result = solve_stage(mixed(cell.session, 4), "tcp", cell.files.__getitem__)
    assert result.findings[0].code == "pose-list-order"


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("seed", [0, 3])
def test_a_lag_along_one_axis_of_the_flange_is_said_and_in_the_uncertainty(seed: int) -> None:
    cell = troubled(all_troubles()["arms: lags by 0.3 mm along one axis of its flange"], seed)
    result = solve_stage(cell.session, "tcp", cell.files.__getitem__)
    assert isinstance(result, TcpResult)
    assert "poses-lag" in {one.code for one in result.findings}  # it passed
    off = np.array(result.tool0_from_laser)[:3, 3] - cell.tool0_from_laser[:3, 3]
    assert np.all(np.abs(off) < 1.5 * 1.96 * np.sqrt(np.diag(np.array(result.covariance))[3:]))
