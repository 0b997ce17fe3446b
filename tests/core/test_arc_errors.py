"""Profiles without a usable arc: each says what is wrong and what to do."""

import numpy as np
import pytest

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.sphere.arc import fit_arc


def arc(
    radius: float = 18.0, half_extent_deg: float = 60.0, sigma_mm: float = 0.02, count: int = 300
) -> FloatArray:
    angle = np.deg2rad(np.linspace(-half_extent_deg, half_extent_deg, count))
    r = radius + np.random.default_rng(0).normal(0, sigma_mm, count)
    return np.column_stack([r * np.sin(angle), 200 - r * np.cos(angle)])


def flat(sigma_mm: float, seed: int, count: int = 600) -> FloatArray:
    rng = np.random.default_rng(seed)
    x = np.linspace(-40, 40, count)
    return np.column_stack([x, 200 + 0.1 * x + rng.normal(0, sigma_mm, count)])


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((0, 2)), "empty"),
        (np.full((100, 2), np.nan), "all blank"),
        (arc()[:8], "8 points"),
        (np.repeat(arc()[:5], 40, axis=0), "5 points"),
        (arc()[:, :1], "shape"),
        (np.vstack([arc(), [[np.inf, 1.0]]]), "infinity in row 301"),
    ],
)
def test_profiles_that_hold_too_little(points: FloatArray, says: str) -> None:
    with pytest.raises(MeasurementError, match=says):
        fit_arc(points, 38.1)


@pytest.mark.parametrize("diameter_mm", [38.1, None])
@pytest.mark.parametrize("seed", range(6))
def test_flat_backgrounds_and_scatter_are_no_arc(diameter_mm: float | None, seed: int) -> None:
    rng = np.random.default_rng(seed)
    scatter = rng.uniform([-60, 100], [60, 200], (500, 2))
    corner = np.concatenate([flat(0.05, seed), [[40.0, z] for z in np.linspace(204, 260, 300)]])
    for points in (flat(0.02, seed), flat(0.3, seed), scatter, corner):
        with pytest.raises(MeasurementError):
            fit_arc(points, diameter_mm)


def test_a_short_arc_says_how_short() -> None:
    with pytest.raises(
        MeasurementError, match=r"an arc of 30°, .*got one of (1[6-9]|2[0-4])\.\d° that tells it to"
    ):
        fit_arc(arc(half_extent_deg=11, sigma_mm=0.03), 38.1)


def test_a_short_arc_that_tells_its_circle_is_used() -> None:
    """A ball of 150 mm seen over ± 20 mm: two of eighteen were refused at 29°."""
    off = []
    for seed in range(18):
        rng = np.random.default_rng(seed)
        radius = np.sqrt(75.0**2 - (75.0 * rng.uniform(0.2, 0.8)) ** 2)
        x = np.arange(-20, 20, 0.1) - rng.uniform(-5, 5)
        z = 200 - np.sqrt(radius**2 - x**2) + rng.normal(0, 0.02, len(x))
        fit = fit_arc(np.column_stack([x, z]), 150.0)
        off.append((fit.radius_mm - radius) / np.sqrt(fit.covariance[2, 2]))
    assert np.sqrt(np.mean(np.square(off))) < 1.6


def test_a_narrow_arc_of_a_smaller_ball_is_used_as_a_slightly_wider_one_is() -> None:
    """A ball of 80 mm seen over ± 11 mm: 17 of 18 cells were refused at 28°, and 30° was taken as it was."""
    off = []
    for seed in range(18):
        rng = np.random.default_rng(seed)
        true_radius = rng.uniform(24, 39)
        exact = arc(radius=true_radius, half_extent_deg=14.5, sigma_mm=0.0, count=180)
        fit = fit_arc(exact + rng.normal(0, 0.02, exact.shape), 80.0)
        off.append((fit.radius_mm - true_radius) / np.sqrt(fit.covariance[2, 2]))
    assert np.sqrt(np.mean(np.square(off))) < 1.6


def test_what_an_arc_tells_counts_not_its_angle() -> None:
    fit = fit_arc(arc(half_extent_deg=7.5, sigma_mm=0.002), 38.1)
    assert np.rad2deg(fit.extent_rad) < 15
    assert abs(fit.radius_mm - 18.0) < 4 * np.sqrt(fit.covariance[2, 2])
    with pytest.raises(MeasurementError, match=r"got one of 1\d\.\d° that tells it to"):
        fit_arc(arc(half_extent_deg=7.5, sigma_mm=0.01), 38.1)


def test_a_sphere_larger_than_the_cell_says() -> None:
    with pytest.raises(MeasurementError, match=r"radius ≤ 12.7 mm \(sphere diameter 25.4 mm\)") as error:
        fit_arc(arc(radius=30), 25.4)
    assert "radius 30" in error.value.got or "radius 29.9" in error.value.got
    assert "larger than stated" in error.value.to_do


def test_metres_for_millimetres_are_named() -> None:
    with pytest.raises(MeasurementError, match="points look like metres"):
        fit_arc(arc() / 1000, 38.1)
    with pytest.raises(MeasurementError, match=r"diameter looks like metres.*38\.1"):
        fit_arc(arc(), 0.0381)


def test_the_radius_given_for_the_diameter_is_named() -> None:
    with pytest.raises(MeasurementError, match=r"may be the sphere's radius.*38\.1 mm wide"):
        fit_arc(arc(), 19.05)


def test_a_diameter_a_few_per_cent_too_small_is_not_taken_for_the_radius() -> None:
    with pytest.raises(MeasurementError, match="larger than stated: correct the diameter") as error:
        fit_arc(arc(radius=16.0), 31.0)
    assert "may be the sphere's radius" not in error.value.to_do


def test_the_far_side_is_refused_where_the_side_is_known() -> None:
    with pytest.raises(MeasurementError, match="far side"):
        fit_arc(arc(), 38.1, z_axis="toward")


@pytest.mark.parametrize("diameter_mm", [0.0, -38.1, np.nan, np.inf])
def test_impossible_diameters(diameter_mm: float) -> None:
    with pytest.raises(MeasurementError, match="positive diameter"):
        fit_arc(arc(), diameter_mm)
