"""Profiles of real spheres on real backgrounds: every arc is found, and where the labels say."""

from pathlib import Path

import numpy as np
import pytest

from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit, fit_arc


def plain_circle(points: FloatArray) -> FloatArray:
    """Least squares of the geometric distance, written here on its own: x, z, r."""
    solution = np.linalg.lstsq(
        np.column_stack([2 * points, np.ones(len(points))]), (points**2).sum(1), rcond=None
    )[0]
    x, z = solution[:2]
    r = np.sqrt(solution[2] + x**2 + z**2)
    for _ in range(30):
        distance = np.hypot(points[:, 0] - x, points[:, 1] - z)
        jacobian = np.column_stack([(points - [x, z]) / distance[:, None], np.ones(len(points))])
        x, z, r = np.array([x, z, r]) + np.linalg.lstsq(jacobian, distance - r, rcond=None)[0]
    return np.array([x, z, r])


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("diameter_mm", [38.1, None], ids=["known", "free"])
def test_all_profiles_give_the_circle_of_their_labels(data_folder: Path, diameter_mm: float | None) -> None:
    files = sorted((data_folder / "sphere-profiles").glob("*.csv"))
    assert len(files) == 260
    errors: dict[str, float] = {}
    for file in files:
        rows = np.loadtxt(file, delimiter=",")
        on_sphere = rows[:, 2] == 1
        reference = plain_circle(rows[on_sphere, :2])
        fit = fit_arc(rows[:, :2], diameter_mm)
        errors[file.name] = float(np.hypot(*(fit.center_mm - reference[:2])))
        assert fit.visible_side == -1, file.name
        distance = np.abs(np.hypot(*(rows[:, :2] - reference[:2]).T) - reference[2])
        assert distance[fit.inliers].max() < 0.3, file.name
        assert fit.inliers[on_sphere].mean() > 0.85, file.name
    assert max(errors.values()) < 0.1, max(errors, key=errors.__getitem__)


@pytest.mark.parametrize(
    ("folder", "diameter_mm", "sigma_mm"), [("tcp-sphere-80mm", 80.0, 0.015), ("tcp-sphere-25mm", 25.4, 0.15)]
)
@pytest.mark.parametrize("known", [True, False])
def test_every_tcp_capture_has_a_clean_arc(
    data_folder: Path, folder: str, diameter_mm: float, sigma_mm: float, known: bool
) -> None:
    files = sorted((data_folder / folder / "captures").glob("*.csv"))
    assert len(files) == (15 if folder == "tcp-sphere-80mm" else 10)
    for file in files:
        points = np.genfromtxt(file, delimiter=",", skip_header=1)[:, :2]
        fit = fit_arc(points, diameter_mm if known else None)
        assert 0.6 * diameter_mm / 2 < fit.radius_mm < diameter_mm / 2, file.name
        assert fit.rms_mm < sigma_mm, file.name
        assert fit.visible_side == -1, file.name
        assert np.rad2deg(fit.extent_rad) > 70, file.name
        assert points[fit.inliers, 1].min() > fit.center_mm[1] - 0.03 * diameter_mm, file.name


def test_a_great_circle_stays_within_the_sphere(data_folder: Path) -> None:
    points = np.genfromtxt(data_folder / "tcp-sphere-80mm/captures/p01.csv", delimiter=",", skip_header=1)[:, :2]
    fit: ArcFit = fit_arc(points, 80.0, z_axis="toward")
    assert fit.radius_mm == pytest.approx(39.945, abs=0.01)
    assert fit.lag1_correlation > 0.7  # this sensor smooths along the stripe
