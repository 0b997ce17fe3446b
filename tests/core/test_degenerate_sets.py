"""A solve is never thrown away: whatever few captures show, there is a result or a sentence on what to capture."""

from typing import Any

import bench_degenerate
import numpy as np
import pytest

from calib_core.exports.workpiece import at_workpiece
from calib_core.records import Session


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("name", ["tcp-spoiled", "turntable"])
def test_random_sets_of_few_captures_end_with_a_result_or_a_sentence(name: str) -> None:
    (row,) = bench_degenerate.rows(name, range(3))
    assert row.holds, row.measured


def test_mountings_of_two_angles_each_end_with_what_to_capture() -> None:
    session, read = bench_degenerate.of_name("turntable")
    ends = [*bench_degenerate.ended(bench_degenerate.drawn(session, 11), read)]
    assert ends[1:] == ["MotionError", "MotionError"], ends


@pytest.mark.thorough
def test_a_tool_that_is_known_to_kilometres_says_nothing_of_the_workpiece(
    turntable_results: tuple[Session, dict[str, dict[str, Any]]],
) -> None:
    """Five captures of a real set gave variances of 7.6e11 mm² beside 1.1, and rounding errors in proportion."""
    session, results = turntable_results
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(6, 6)))[0]
    stated = turn @ np.diag([7.6e11, 3.9e5, 2.3e5, 8.4, 3.8, 1.1]) @ turn.T
    rounded = stated + 1e-6 * np.diag([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0]) * 1e3
    known = {key: value for key, value in results["tcp"].items() if key != "workpiece"}
    assert at_workpiece(session, known)
    assert at_workpiece(session, {**known, "covariance": rounded.tolist()}) == []
