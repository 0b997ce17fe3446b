"""The sphere in a cloud: truth, covariance, invariance, backgrounds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.frames import FloatArray, rotation_from_vector
from calib_core.sphere.cloud import fit_sphere

CENTER_MM = np.array([12.0, -8.0, 400.0])
RADIUS_MM = 20.0
SIGMA_MM = 0.03


def cap(count: int, half_angle_deg: float = 65.0, seed: int = 0, sigma_mm: float = SIGMA_MM) -> FloatArray:
    """Points of the sphere's cap that looks at the scanner (−z), evenly over its area."""
    rng = np.random.default_rng(seed)
    down = rng.uniform(np.cos(np.deg2rad(half_angle_deg)), 1, count)
    turn = rng.uniform(0, 2 * np.pi, count)
    across = np.sqrt(1 - down**2)
    unit = np.column_stack([across * np.cos(turn), across * np.sin(turn), -down])
    return CENTER_MM + unit * (RADIUS_MM + rng.normal(0, sigma_mm, count))[:, None]


def scene(seed: int = 0) -> FloatArray:
    """The sphere on a stand above a table, with stray points: under half of all points are on the sphere."""
    rng = np.random.default_rng(seed + 100)
    turn, height = rng.uniform(0, np.pi, 500), rng.uniform(20, 80, 500)
    stand = CENTER_MM + np.column_stack([4 * np.cos(turn), 4 * np.sin(turn), height])
    table = np.column_stack([rng.uniform(-100, 100, (2500, 2)), np.full(2500, 480.0)])
    table[:, 2] += rng.normal(0, SIGMA_MM, 2500)
    stray = rng.uniform([-100, -100, 300], [100, 100, 500], (400, 3))
    points = np.concatenate([cap(3000, seed=seed), stand, table, stray])
    return points[rng.permutation(len(points))]


@pytest.mark.parametrize("diameter_mm", [2 * RADIUS_MM, None], ids=["known", "free"])
def test_stand_table_and_stray_points_do_not_move_the_center(diameter_mm: float | None) -> None:
    for seed in range(5):
        points = scene(seed)
        fit = fit_sphere(points, diameter_mm)
        error = np.array([*fit.center_mm, fit.radius_mm]) - [*CENTER_MM, RADIUS_MM]
        size = len(fit.covariance)
        assert size == (3 if diameter_mm else 4)
        assert error[:size] @ np.linalg.solve(fit.covariance, error[:size]) < 25  # χ² of 4: 5e-5 a run
        assert fit.point_sigma_mm == pytest.approx(SIGMA_MM, rel=0.06)
        on_sphere = np.abs(np.linalg.norm(points - CENTER_MM, axis=1) - RADIUS_MM) < 3 * SIGMA_MM
        assert (fit.inliers == on_sphere).mean() > 0.995


@pytest.mark.parametrize("known", [True, False])
def test_covariance_is_true_for_white_noise(known: bool) -> None:
    runs, unknowns = 150, 3 if known else 4
    nees = np.empty(runs)
    for seed in range(runs):
        fit = fit_sphere(cap(800, half_angle_deg=50, seed=seed), 2 * RADIUS_MM if known else None)
        error = (np.array([*fit.center_mm, fit.radius_mm]) - [*CENTER_MM, RADIUS_MM])[:unknowns]
        nees[seed] = error @ np.linalg.solve(fit.covariance, error)
    # χ² of k degrees of freedom: mean k, variance 2k; three standard deviations of the mean
    assert abs(nees.mean() - unknowns) < 3 * np.sqrt(2 * unknowns / runs)


def test_large_clouds_reach_the_statistical_bound() -> None:
    """Beyond the sample's size one pass over all points must give what all points know."""
    squared = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        stray = CENTER_MM + rng.uniform(-60, 60, (8000, 3))
        fit = fit_sphere(np.concatenate([cap(32000, seed=seed), stray])[rng.permutation(40000)], 2 * RADIUS_MM)
        error = fit.center_mm - CENTER_MM
        squared.append(error @ np.linalg.solve(fit.covariance, error) / 3)
    # mean of χ²/3 over 60 degrees of freedom: 1 ± 0.18; three standard deviations
    assert np.mean(squared) < 1 + 3 * np.sqrt(2 / 60)


@settings(max_examples=15, deadline=None)
@given(
    shift=st.tuples(*[st.floats(-3000, 3000)] * 3),
    turn=st.tuples(*[st.floats(-3, 3)] * 3),
    scale=st.floats(0.05, 20),
)
def test_moving_turning_and_scaling_the_cloud_does_the_same_to_the_sphere(
    shift: tuple[float, float, float], turn: tuple[float, float, float], scale: float
) -> None:
    points, rotation = scene(), rotation_from_vector(turn)
    plain = fit_sphere(points, 2 * RADIUS_MM)
    moved = fit_sphere(scale * points @ rotation.T + shift, 2 * RADIUS_MM * scale)
    np.testing.assert_allclose(moved.center_mm, scale * rotation @ plain.center_mm + shift, atol=1e-3 * scale)
    assert moved.rms_mm == pytest.approx(scale * plain.rms_mm, rel=5e-3)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_order_of_the_points_does_not_matter(seed: int) -> None:
    points = scene()
    order = np.random.default_rng(seed).permutation(len(points))
    plain, mixed = fit_sphere(points), fit_sphere(points[order])
    np.testing.assert_allclose(mixed.center_mm, plain.center_mm, atol=1e-3)
    assert (mixed.inliers == plain.inliers[order]).mean() > 0.999


def test_the_same_cloud_gives_the_same_numbers() -> None:
    assert np.array_equal(fit_sphere(scene()).center_mm, fit_sphere(scene()).center_mm)


def test_blanks_of_an_organised_cloud_are_passed_over() -> None:
    points = np.full((40000, 3), np.nan)
    points[::40] = cap(1000)
    fit = fit_sphere(points)
    np.testing.assert_allclose(fit.center_mm, CENTER_MM, atol=0.02)
    assert fit.inliers.sum() > 950
    assert not fit.inliers[np.isnan(points[:, 0])].any()


def test_a_small_sphere_in_a_wide_scene_is_found() -> None:
    rng = np.random.default_rng(8)
    table = np.column_stack([rng.uniform(-300, 300, (20000, 2)), 480 + rng.normal(0, SIGMA_MM, 20000)])
    for diameter_mm in (2 * RADIUS_MM, None):
        fit = fit_sphere(np.concatenate([table, cap(1200)]), diameter_mm)
        np.testing.assert_allclose(fit.center_mm, CENTER_MM, atol=0.02)
