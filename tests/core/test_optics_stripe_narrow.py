"""Stripes from half a pixel wide: what their centres state of themselves is true, or a little cautious."""

import numpy as np
import pytest
from scipy.special import erf

from calib_core.optics.stripe import find_stripe

WIDTH, HEIGHT = 1000, 200
CENTER = 60 + 0.0713 * np.arange(WIDTH)


def frame(width_px: float, peak: float, seed: int, whole_pixels: bool) -> np.ndarray:
    """A slanting stripe with read and photon noise; pixels gather light over their area, or at their middle."""
    rng = np.random.default_rng(seed)
    u = np.arange(HEIGHT)[:, None] - CENTER
    if whole_pixels:
        edge = np.sqrt(2) * width_px
        shape = np.sqrt(np.pi / 2) * width_px * (erf((u + 0.5) / edge) - erf((u - 0.5) / edge))
    else:
        shape = np.exp(-0.5 * (u / width_px) ** 2)
    mean = 10 + peak * shape
    noisy = mean + np.sqrt(4.0 + 0.02 * peak * shape) * rng.standard_normal(mean.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


@pytest.mark.parametrize("whole_pixels", [False, True])
@pytest.mark.parametrize("peak", [40.0, 100.0, 200.0])
@pytest.mark.parametrize("width_px", [0.5, 0.6, 0.7, 0.8, 1.0, 1.5, 2.0, 4.0])
def test_centres_of_narrow_and_wide_stripes_err_as_they_state(
    width_px: float, peak: float, whole_pixels: bool
) -> None:
    normed: list[np.ndarray] = []
    for seed in range(2):
        found = find_stripe(frame(width_px, peak, seed, whole_pixels))
        assert len(found.row_px) > 0.6 * WIDTH  # of the narrowest and faintest some are left out
        normed.append((found.row_px - CENTER[found.column_px.astype(int)]) / found.sigma_px)
    # 2000 centres know the RMS to 1.6 %.  A sixth is left to what the place on the pixels does to the narrowest.
    assert 0.8 < np.sqrt(np.mean(np.concatenate(normed) ** 2)) < 1.18
