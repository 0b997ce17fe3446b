"""Terrestrial scans of 100 mm spheres with their stands, raw: the centres of a hand-made segmentation."""

from pathlib import Path

import numpy as np
import pytest

from calib_core.sphere.cloud import fit_sphere

REFERENCE_MM = {
    "SPH101": (-5895.833, 3628.938, -1561.256),
    "SPH102": (-4510.113, -6758.342, -1576.505),
    "SPH103": (-3508.772, 5865.925, -1570.919),
    "SPH104": (-2336.470, 6968.346, 35.413),
    "SPH105": (-3502.200, 5863.329, 28.275),
    "SPH106": (-4686.988, 4753.641, 31.329),
}


@pytest.mark.parametrize("name", REFERENCE_MM)
@pytest.mark.parametrize("diameter_mm", [100.0, None], ids=["known", "free"])
def test_the_raw_cloud_gives_the_reference_center(data_folder: Path, name: str, diameter_mm: float | None) -> None:
    points_mm = 1000 * np.loadtxt(data_folder / "sphere-clouds" / f"{name}.xyz")
    fit = fit_sphere(points_mm, diameter_mm)
    assert np.linalg.norm(fit.center_mm - REFERENCE_MM[name]) < 0.6
    assert abs(fit.radius_mm - 50) < 0.4
    # The stand is not the sphere: what lies far from the reference surface is no inlier.
    distance = np.abs(np.linalg.norm(points_mm - REFERENCE_MM[name], axis=1) - 50)
    assert distance[fit.inliers].max() < 2.0
    assert fit.inliers.sum() > 0.9 * np.count_nonzero(distance < fit.rms_mm)
