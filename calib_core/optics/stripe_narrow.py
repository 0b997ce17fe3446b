"""The standard deviation of a narrow stripe's centres, from the frame's own residuals about them.

Peaks narrower than a pixel leave so few lit pixels that the quick estimate of how the noise grows with the light
counts their sampling as noise.  Here background, height, place and width are fitted to each peak's pixels, and
what that fit takes away from the residuals is counted back in.
"""

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

NARROW_PX = 0.9
"""Below this width (standard deviation) the centres' deviations come from here."""

_REACH = 3.2
_RIDGE = 1e-9
_LOSS, _LOSS_BEGINS_PX = 0.08, 0.1  # against the bound, of a centre measured with a width that is a little off
# By how much the place on the pixels moves the centre, RMS: 0.02 px at a width of 0.53 px, 0.001 px at 0.7 px.
_SAMPLING_PX, _SAMPLED_WIDTH_PX, _SAMPLING_FALL_PX = 0.006, 0.6, 0.06


def narrow_sigmas(
    image: NDArray[np.uint8 | np.uint16], columns: FloatArray, rows: FloatArray, width_px: float, variance: float
) -> FloatArray:
    """Return the standard deviation (N,) of centres, px: the bound at the noise that is there, and the sampling.

    Parameters
    ----------
    image : (H, W)
    columns, rows : (N,)
        Where the centres are; columns are whole.
    width_px : float
        Of the stripe.
    variance : float
        Of the surroundings' noise.
    """
    half = int(np.ceil(_REACH * width_px)) + 1
    taps = np.arange(-half, half + 1)
    top = np.clip(np.rint(rows).astype(int), half, image.shape[0] - half - 1)
    seen = image[top[:, None] + taps, columns.astype(int)[:, None]].astype(float)
    u = (top[:, None] + taps - rows[:, None]) / width_px
    shape = np.exp(-0.5 * u**2)
    slope = u * shape / width_px
    height = _height(seen, shape)
    basis = np.stack([np.ones_like(shape), shape, height[:, None] * slope], axis=2)
    wider = np.concatenate([basis, (height[:, None] * u**2 * shape)[:, :, None]], axis=2)
    crossed = np.einsum("nij,nik->njk", wider, wider) + _RIDGE * np.eye(4)
    projected = np.linalg.solve(crossed, wider.transpose(0, 2, 1))
    free = 1.0 - np.einsum("nij,nji->ni", wider, projected)  # what of each pixel's noise the fit leaves over
    residuals = seen - np.einsum("nij,nj->ni", wider, np.einsum("nji,ni->nj", projected, seen))
    lit = np.maximum(height, 0.0)[:, None] * shape
    squares = (residuals**2).sum(axis=1)
    usual = squares <= 4.0 * np.median(squares)  # a hot pixel or an edge is none of the light's noise
    growth = (squares[usual].sum() - variance * free[usual].sum()) / max((free * lit)[usual].sum(), 1e-9)
    noise = variance + max(float(growth), 0.0) * lit
    information = np.einsum("nij,ni,nik->njk", basis, 1.0 / noise, basis)
    by_noise = np.linalg.inv(information + _RIDGE * np.eye(3))[:, 2, 2]
    sampled = _SAMPLING_PX * np.exp(-(width_px - _SAMPLED_WIDTH_PX) / _SAMPLING_FALL_PX)
    loss = 1 + _LOSS * min(1.0, (NARROW_PX - width_px) / _LOSS_BEGINS_PX)
    return np.asarray(loss * np.sqrt(by_noise + sampled**2), dtype=float)


def _height(seen: FloatArray, shape: FloatArray) -> FloatArray:
    """Return each peak's height above its background by least squares, (N,)."""
    form = shape - shape.mean(axis=1, keepdims=True)
    return (form * seen).sum(axis=1) / (form**2).sum(axis=1)
