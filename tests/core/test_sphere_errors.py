"""Clouds without a usable sphere: each says what is wrong and what to do."""

import numpy as np
import pytest

from calib_core.errors import MeasurementError
from calib_core.frames import FloatArray
from calib_core.sphere.cloud import fit_sphere


def ball(radius_mm: float = 20.0, count: int = 2000) -> FloatArray:
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(2 * count, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    unit = unit[unit[:, 2] < -0.2][:count]
    return np.array([5.0, 6.0, 300.0]) + unit * (radius_mm + rng.normal(0, 0.02, len(unit)))[:, None]


def plane(sigma_mm: float, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-50, 50, (3000, 3))
    points[:, 2] = 300 + 0.2 * points[:, 0] + rng.normal(0, sigma_mm, 3000)
    return points


@pytest.mark.parametrize(
    ("points", "says"),
    [
        (np.zeros((0, 3)), "empty"),
        (np.full((100, 3), np.nan), "0 points and 100 blanks"),
        (ball()[:15], "15 points"),
        (ball()[:, :2], "shape"),
        (np.vstack([ball(), [[np.inf, 1.0, 2.0]]]), "infinity"),
    ],
)
def test_clouds_that_hold_too_little(points: FloatArray, says: str) -> None:
    with pytest.raises(MeasurementError, match=says):
        fit_sphere(points, 40.0)


@pytest.mark.parametrize("diameter_mm", [40.0, None])
@pytest.mark.parametrize("seed", range(3))
def test_planes_cylinders_and_scatter_are_no_sphere(diameter_mm: float | None, seed: int) -> None:
    rng = np.random.default_rng(seed)
    turn = rng.uniform(0, np.pi, 3000)
    cylinder = np.column_stack([20 * np.cos(turn), 20 * np.sin(turn), rng.uniform(0, 200, 3000)])
    cylinder += rng.normal(0, 0.05, cylinder.shape)
    scatter = rng.uniform(-50, 50, (3000, 3))
    # Of a pipe alone a short stretch passes for a sphere of free radius; a known one tells them apart.
    none = [plane(0.02, seed), plane(0.5, seed), scatter] + ([cylinder] if diameter_mm else [])
    for points in none:
        with pytest.raises(MeasurementError, match="a sphere in the cloud"):
            fit_sphere(points, diameter_mm)


def test_one_stripe_alone_does_not_say_the_radius() -> None:
    turn = np.linspace(0, 2, 500)
    stripe = np.column_stack([15 * np.cos(turn), np.zeros(500), 300 + 15 * np.sin(turn)])
    with pytest.raises(MeasurementError, match="several stripes"):
        fit_sphere(stripe + np.random.default_rng(1).normal(0, 0.01, stripe.shape), None)


@pytest.mark.parametrize(("radius_mm", "larger"), [(20.0, "larger"), (7.0, "smaller")])
def test_a_sphere_of_another_size_than_the_cell_says(radius_mm: float, larger: str) -> None:
    with pytest.raises(MeasurementError, match=rf"radius 12\.7 mm .*{larger} than stated") as error:
        fit_sphere(ball(radius_mm), 25.4)
    measured = float(error.value.got.split()[-2])
    assert measured == pytest.approx(radius_mm, abs=0.02)


def test_metres_for_millimetres_are_named() -> None:
    with pytest.raises(MeasurementError, match="points look like metres"):
        fit_sphere(ball() / 1000, 40.0)
    with pytest.raises(MeasurementError, match=r"diameter looks like metres.*40"):
        fit_sphere(ball(), 0.04)


def test_the_radius_given_for_the_diameter_is_named() -> None:
    with pytest.raises(MeasurementError, match=r"may be the sphere's radius.*40 mm wide"):
        fit_sphere(ball(), 20.0)


@pytest.mark.parametrize("diameter_mm", [0.0, -1.0, np.nan])
def test_impossible_diameters(diameter_mm: float) -> None:
    with pytest.raises(MeasurementError, match="positive diameter"):
        fit_sphere(ball(), diameter_mm)
