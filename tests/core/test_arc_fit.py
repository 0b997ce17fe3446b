"""The arc in a profile: truth, covariance, invariance, visible side, backgrounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.frames import FloatArray
from calib_core.sphere.arc import fit_arc

SIGMA_MM = 0.02


def arc(
    center: tuple[float, float] = (3.0, 180.0),
    radius: float = 15.0,
    half_extent_deg: float = 60.0,
    count: int = 300,
    side: int = 1,
    sigma_mm: float = SIGMA_MM,
    seed: int = 0,
    middle_deg: float = 0.0,
) -> FloatArray:
    rng = np.random.default_rng(seed)
    angle = np.deg2rad(np.linspace(-half_extent_deg, half_extent_deg, count) + middle_deg)
    r = radius + rng.normal(0, sigma_mm, count)
    return np.column_stack([center[0] + r * np.sin(angle), center[1] - side * r * np.cos(angle)])


def table(z: float = 230.0, slope: float = 0.05, sigma_mm: float = SIGMA_MM, seed: int = 1) -> FloatArray:
    rng = np.random.default_rng(seed)
    x = np.concatenate([np.arange(-60, -12, 0.1), np.arange(18, 70, 0.1)])
    return np.column_stack([x, z + slope * x + rng.normal(0, sigma_mm, len(x))])


def scene(**of_arc: float) -> FloatArray:
    """A sphere above a table: the profile runs over the table, the sphere and the table again."""
    ground, ball = table(), arc(**of_arc)  # type: ignore[arg-type]
    return np.concatenate([ground[ground[:, 0] < 0], ball, ground[ground[:, 0] > 0]])


def test_stray_points_blanks_and_table_do_not_move_the_center() -> None:
    rng = np.random.default_rng(5)
    stray = rng.uniform([-60, 100], [60, 240], (500, 2))
    points = np.concatenate([scene(), np.full((40, 2), np.nan), stray])
    fit = fit_arc(points, 40.0, "away")
    # 3.5 σ of the free parameters, with the covariance as stated
    error = np.array([*fit.center_mm, fit.radius_mm]) - [3, 180, 15]
    assert error @ np.linalg.solve(fit.covariance, error) < 21
    assert fit.inliers.shape == (len(points),)
    assert not fit.inliers[np.isnan(points[:, 0])].any()
    assert fit.visible_side == 1
    assert np.rad2deg(fit.extent_rad) == pytest.approx(120, abs=4)
    assert fit.point_sigma_mm == pytest.approx(SIGMA_MM, rel=0.15)


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("half_extent_deg", [25.0, 65.0])
def test_covariance_is_true_for_white_noise(half_extent_deg: float) -> None:
    truth = np.array([3.0, 180.0, 15.0])
    runs = 150
    nees = np.empty(runs)
    for seed in range(runs):
        fit = fit_arc(arc(half_extent_deg=half_extent_deg, count=250, seed=seed), 40.0)
        error = np.array([*fit.center_mm, fit.radius_mm]) - truth
        nees[seed] = error @ np.linalg.solve(fit.covariance, error)
    # χ² of 3 degrees of freedom: mean 3, variance 6; three standard deviations of the mean
    assert abs(nees.mean() - 3) < 3 * np.sqrt(6 / runs)


def test_lag1_correlation_tells_smoothed_from_white_noise() -> None:
    white = fit_arc(arc(count=1000), None)
    noise = np.convolve(np.random.default_rng(3).normal(0, SIGMA_MM, 1008), np.ones(9) / 3, mode="valid")
    exact = arc(count=1000, sigma_mm=0.0)
    outward = (exact - [3, 180]) / 15
    smoothed = fit_arc(exact + outward * noise[:, None], None)
    assert abs(white.lag1_correlation) < 0.12
    assert smoothed.lag1_correlation == pytest.approx(8 / 9, abs=0.1)


@settings(max_examples=20, deadline=None)
@given(
    shift=st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
    turn_rad=st.floats(-0.6, 0.6),
    scale=st.floats(0.05, 20),
)
def test_moving_turning_and_scaling_the_profile_does_the_same_to_the_circle(
    shift: tuple[float, float], turn_rad: float, scale: float
) -> None:
    points = scene()
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turn = np.array([[cos, -sin], [sin, cos]])
    plain, moved = fit_arc(points, None), fit_arc(scale * points @ turn.T + shift, None)
    # Single points may change sides of the cut by rounding: each moves the circle by about σ/n.
    tolerance = 2e-3 * scale
    np.testing.assert_allclose(moved.center_mm, scale * turn @ plain.center_mm + shift, atol=tolerance)
    assert moved.radius_mm == pytest.approx(scale * plain.radius_mm, abs=tolerance)


def test_order_and_duplicates_do_not_matter() -> None:
    points = scene()
    shuffled = np.random.default_rng(2).permutation(len(points))
    plain, mixed = fit_arc(points, 40.0), fit_arc(points[shuffled], 40.0)
    np.testing.assert_allclose(mixed.center_mm, plain.center_mm, atol=2e-3)
    assert (plain.inliers[shuffled] == mixed.inliers).mean() > 0.995
    twice = fit_arc(np.repeat(points, 2, axis=0), 40.0)
    np.testing.assert_allclose(twice.center_mm, plain.center_mm, atol=1e-9)
    np.testing.assert_allclose(twice.covariance, plain.covariance, rtol=1e-6)
    np.testing.assert_array_equal(twice.inliers, np.repeat(plain.inliers, 2))


def test_the_same_profile_gives_the_same_numbers() -> None:
    points = scene(seed=9)
    assert np.array_equal(fit_arc(points, 40.0).center_mm, fit_arc(points, 40.0).center_mm)


@pytest.mark.parametrize(("side", "z_axis"), [(1, "away"), (-1, "toward")])
def test_the_side_follows_the_data_with_or_without_being_told(side: int, z_axis: str) -> None:
    points = arc(side=side)
    assert fit_arc(points, 40.0).visible_side == side
    assert fit_arc(points, 40.0, z_axis).visible_side == side  # type: ignore[arg-type]


def test_a_half_hidden_arc_and_one_with_a_gap_are_found() -> None:
    clipped = arc(middle_deg=45, half_extent_deg=40)
    np.testing.assert_allclose(fit_arc(clipped, 40.0, "away").center_mm, [3, 180], atol=0.05)
    whole = arc()
    angle = np.linspace(-60, 60, len(whole))
    gap = whole[(angle < -10) | (angle > 5)]
    fit = fit_arc(gap, 40.0)
    np.testing.assert_allclose(fit.center_mm, [3, 180], atol=0.02)
    assert fit.inliers.sum() > 0.9 * len(gap)


def test_the_known_diameter_chooses_the_sphere_beside_a_larger_pipe() -> None:
    pipe = arc(center=(120.0, 230.0), radius=60.0, count=900, seed=4)
    points = np.concatenate([arc(), pipe])
    assert fit_arc(points, 40.0).radius_mm == pytest.approx(15, abs=0.05)
    assert fit_arc(points, 130.0).radius_mm > 14  # both are possible: the one determined best is taken
    assert fit_arc(pipe, 130.0).radius_mm == pytest.approx(60, abs=0.1)


def test_mixed_points_at_the_border_are_left_out() -> None:
    ball = arc()
    last = ball[-1]
    mixed = np.column_stack([np.linspace(last[0], last[0] + 1, 15), np.linspace(last[1], 230, 15)])
    fit = fit_arc(np.concatenate([ball, mixed]), 40.0)
    np.testing.assert_allclose(fit.center_mm, [3, 180], atol=0.02)
    assert not fit.inliers[len(ball) + 1 :].any()
