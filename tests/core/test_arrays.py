"""A cloud's noise pulls at no nuisance, whichever way it acts: `chain.arrays`."""

import numpy as np
import pytest

from calib_core.chain.arrays import chain_data
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.scanner import NAMES, ScannerPriors
from calib_core.frames import RigidTransform

_RADIUS_MM, _SIGMA_MM, _CLOUDS = 20.0, 0.02, 600


def cloud(rng: np.random.Generator, along: str) -> SphereObservation:
    """A sphere's near side by an area scanner on a grid in x and y, its noise along the normal or along z."""
    grid = np.stack(np.meshgrid(np.arange(-14.0, 15.0), np.arange(-14.0, 15.0)), axis=-1).reshape(-1, 2)
    grid = grid[np.hypot(*grid.T) <= 15]
    error = rng.standard_normal(len(grid)) * _SIGMA_MM
    radius = _RADIUS_MM + (error if along == "normal" else 0.0)
    depth = -np.sqrt(radius**2 - np.sum(grid**2, axis=1)) + (error if along == "z" else 0.0)
    center = np.array([*rng.uniform(-20, 20, 2).round(), rng.uniform(200, 240)])
    return SphereObservation(
        capture="c", kind="cloud", base_from_tool0=RigidTransform.identity("base", "tool0"),
        center_in_laser_mm=center, center_covariance=np.eye(3) * 1e-6, circle_radius_mm=None,
        points_in_laser_mm=np.column_stack([grid, depth]) + center, point_sigma_mm=_SIGMA_MM,
    )  # fmt: skip


@pytest.mark.parametrize("along", ["normal", "z"])
def test_noise_pulls_at_no_error_of_the_scanner(along: str) -> None:
    rng = np.random.default_rng(7)
    clouds = [cloud(rng, along) for _ in range(_CLOUDS)]
    data = chain_data(clouds, SphereSize(2 * _RADIUS_MM, 0.04), None, ScannerPriors())
    # Each capture's own centre is free: what is left of the slopes is the nuisances', in their own deviations.
    inner = data.anchor_information[:, :3, :3]
    across = np.linalg.solve(inner, data.anchor_information[:, :3, 3:])
    slope = data.anchor_gradient[:, 3:] - np.einsum("kij,ki->kj", across, data.anchor_gradient[:, :3])
    information = data.anchor_information[:, 3:, 3:] - np.einsum(
        "kij,kil->kjl", data.anchor_information[:, :3, 3:], across
    )
    deviation = slope.sum(axis=0) / np.sqrt(np.diagonal(information.sum(axis=0)))
    assert len(deviation) == len(NAMES)
    assert np.abs(deviation).max() < 3


def test_a_diameter_known_beyond_all_measure_is_known() -> None:
    clouds = [cloud(np.random.default_rng(7), "z")]
    told, exact = (
        chain_data(clouds, SphereSize(2 * _RADIUS_MM, sigma_mm), None, ScannerPriors())
        for sigma_mm in (1e-300, 0.0)
    )
    assert NAMES[0] not in [NAMES[n] for n in told.active]
    np.testing.assert_array_equal(told.active, exact.active)
