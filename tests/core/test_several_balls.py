"""Several balls in one view: arcs told apart, each ball found, told distances used as measurements."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import calib_core as cc
from calib_core.chain.balls import by_distances
from calib_core.records.results import FoundFrame, ScannerFound
from calib_core.stages.tcp.record import TcpResult
from tests.topology_errors import distances

CHI2 = {3: 21.1, 6: 27.9}  # 99.99 %


def within(result: TcpResult, truth: dict[str, Any]) -> Iterator[tuple[str, str]]:
    assert {ball.carrier for ball in result.spheres} == {"base"}
    for ball in result.spheres:
        off = [np.array(ball.center_mm) - one["center_mm"] for one in truth["spheres"]]
        nearest = int(np.argmin(np.linalg.norm(off, axis=1)))
        squared = off[nearest] @ np.linalg.solve(np.array(ball.covariance), off[nearest])
        assert squared < CHI2[3], ball.name
        yield ball.name, truth["spheres"][nearest]["name"]


def test_balls_of_a_plate_are_told_apart_without_being_named() -> None:
    simulated, truth = cc.simulate("plate", 2)
    result = simulated.run()["tcp"]
    assert result.verdict == "pass"
    assert all(row.used and row.profiles is None for row in result.residuals)
    assert sorted(true for _, true in within(result, truth)) == ["a", "b", "c"]
    assert {ball.name for ball in result.spheres} == {"sphere-1", "sphere-2", "sphere-3"}
    ((_, squared, _, _),) = distances(with_frame(result), truth)
    assert squared < CHI2[6]


def with_frame(result: TcpResult) -> TcpResult:
    """Return a result of one scanner with its pose among its frames."""
    frame = {"into": "tool0", "outof": "laser", "matrix": result.tool0_from_laser, "covariance": result.covariance}
    return result.model_copy(update={"frames": [FoundFrame.model_validate(frame)]})


def test_told_distances_name_the_balls_and_find_the_scale() -> None:
    simulated, truth = cc.simulate("plate-distances", 2)
    result = simulated.run()["tcp"]
    assert dict(within(result, truth)) == {"a": "a", "b": "b", "c": "c"}
    assert isinstance(result.scanner, ScannerFound)
    found = dict(zip(result.scanner.names, result.scanner.values, strict=True))
    assert found["scale_x"] == pytest.approx(1 / 1.003 - 1, abs=0.001)


def test_distances_that_fit_two_ways_name_nothing() -> None:
    corners = np.array([[0.0, 0, 0], [60, 0, 0], [0, 60, 0]])
    told = [("a", "b", 60.0, 0.01), ("a", "c", 60.0, 0.01)]
    assert by_distances(corners, ["a", "b", "c"], told) is None
    assert (
        by_distances(corners, ["a", "b", "c"], [*told[:1], ("b", "c", 84.85, 0.01), ("a", "c", 70.0, 0.1)]) is None
    )
    far = corners * [1, 1.5, 1]
    assert by_distances(far, ["c", "b", "a"], [("a", "b", 60.0, 0.01), ("a", "c", 90.0, 0.01)]) == ["a", "b", "c"]


def test_one_ball_stays_one() -> None:
    simulated, _ = cc.simulate("tcp", 1)
    (ball,) = simulated.run()["tcp"].spheres
    assert (ball.name, len(ball.captures)) == ("sphere", 14)
