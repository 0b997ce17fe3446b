"""The offset between robot and scanner clocks: found within its own uncertainty, 37 ms within 1 ms."""

import numpy as np
import pytest

from calib_core.clock_offset import clock_offset
from calib_core.errors import MeasurementError, MotionError


def move(
    offset_s: float, seed: int, noise_mm: float = 0.01, way: tuple[float, float, float] = (20.0, 8.0, 5.0)
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a robot's track at 125 Hz with jitter, and arcs at 30 Hz by a clock that tells `offset_s` more."""
    rng = np.random.default_rng(seed)
    robot_s = np.sort(np.arange(0, 6, 0.008) + rng.uniform(-0.001, 0.001, 750))
    phase = lambda t: np.sin(2 * np.pi * 0.7 * t)  # noqa: E731
    positions = np.array([600.0, 100.0, 400.0]) + phase(robot_s)[:, None] * np.array(way)
    true_s = np.arange(0.6, 5.4, 1 / 30) + rng.uniform(-0.005, 0.005, 145)
    s = phase(true_s)
    y = 10.0 + 5.0 * s  # the sphere's distance from the plane of light: the radius is no straight function of it
    arcs = np.column_stack([3.0 + 18.0 * s, 180.0 - 7.0 * s, np.sqrt(20.0**2 - y**2)])
    arcs += rng.normal(0, noise_mm, arcs.shape)
    return robot_s, positions, true_s + offset_s, arcs


@pytest.mark.parametrize("offset_s", [0.037, -0.12, 0.0])
def test_an_offset_is_found_within_a_millisecond(offset_s: float) -> None:
    found = clock_offset(*move(offset_s, 1))
    assert abs(found.offset_s - offset_s) < 0.001
    assert 1e-6 < found.sigma_s < 0.001


@pytest.mark.thorough
def test_its_uncertainty_is_true() -> None:
    """Over fifty moves the errors in standard deviations scatter by one: 0.7 to 1.35 in 99.9 % of cases."""
    found = [clock_offset(*move(0.037, seed, noise_mm=0.2)) for seed in range(50)]
    errors = np.array([(one.offset_s - 0.037) / one.sigma_s for one in found])
    assert 0.7 < np.sqrt(np.mean(errors**2)) < 1.35


def test_a_move_along_the_light_or_across_it_will_do() -> None:
    robot_s, positions, seen_s, arcs = move(0.037, 4)
    arcs[:, :2] = [3.0, 180.0]  # across the plane of light the radius alone tells
    arcs[:, :2] += np.random.default_rng(1).normal(0, 0.01, (len(arcs), 2))
    assert abs(clock_offset(robot_s, positions, seen_s, arcs).offset_s - 0.037) < 0.001


def test_what_is_no_move_back_and_forth_is_refused() -> None:
    robot_s, positions, seen_s, arcs = move(0.037, 2)
    still = positions[:1] + np.zeros_like(positions)
    with pytest.raises(MotionError, match="at least"):
        clock_offset(robot_s, still, seen_s, arcs)
    with pytest.raises(MotionError, match="back and forth"):
        clock_offset(robot_s, positions[:1] + robot_s[:, None] * [10.0, 0, 0], seen_s, arcs)
    with pytest.raises(MeasurementError, match="exposures"):
        clock_offset(robot_s, positions, seen_s[:10], arcs[:10])
    with pytest.raises(MeasurementError, match="end"):
        clock_offset(*move(0.3, 3), largest_s=0.2)
