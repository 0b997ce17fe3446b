"""How many of a scan's points say as much as one that errs by itself: neighbours err alike.

A scanner smooths along its stripe, its speckle is wider than a pixel, and no sphere is round to a micrometre.
What counts for a circle is how the residuals scatter over long waves, which a variance of single points does not
show. Along a profile the waves' power is taken by cosine transform; the three longest are not, since the
circle's own fit removes them (so that the estimate is restricted).  A white part and one that falls off beyond
some frequency are fitted to all profiles together by Whittle's likelihood, and carried on to the long waves.  In
a cloud patches take the place of waves.
"""

from collections.abc import Sequence

import numpy as np

from calib_core.frames import FloatArray

_FIRST_WAVE = 3
_SIGNIFICANT = 4.0  # log-likelihood: a white spectrum gains 1 by chance from two more parameters
_LARGEST_POWER = 12.0  # of a wave in units of the mean: beyond it is a scratch, not noise
_FORM_SHARE = 2e-5  # of the diameter: the form error of a good sphere
_FORM_MM = 1e-3
_FORM_LENGTH_MM = 10.0
_PATCHES = 6  # across a cloud
_LEAST_IN_PATCH = 4


def along_profiles(
    arcs: Sequence[tuple[FloatArray, FloatArray]], sigmas_mm: FloatArray, shapes: Sequence[FloatArray]
) -> float:
    """Return how many points of these profiles say as much as an independent one, at least 1.

    Parameters
    ----------
    arcs : sequence of (angle, residual), (N,) each
        Of every profile: the points' angles about their circle, rad, ascending, and their distances from it, mm.
    sigmas_mm : (K,)
        Each profile's residuals' standard deviation.
    shapes : sequence of (N, s)
        Errors that are known by their shape and estimated elsewhere: they are taken out.
    """
    good = [k for k, (angle, _) in enumerate(arcs) if len(angle) >= 30 and sigmas_mm[k] > 0]
    if not good:
        return 1.0
    residuals = _without_shapes([arcs[k] for k in good], [shapes[k] for k in good])
    waves: list[FloatArray] = []
    powers: list[FloatArray] = []
    for residual in residuals:
        count = len(residual)
        transform = np.fft.rfft(np.concatenate([residual, residual[::-1]]))
        power = np.abs(transform[_FIRST_WAVE:count]) ** 2 / (2 * count)
        power /= max(float(power.mean()), 1e-300)
        waves.append(np.arange(_FIRST_WAVE, count) / count)
        powers.append(np.minimum(power, _LARGEST_POWER * np.sqrt(count)))
    wave, power = np.concatenate(waves), np.concatenate(powers)
    counts, wave, power = _in_bands(wave, power)
    length = float(np.median([len(r) for r in residuals]))
    return max(1.0, _long_wave_power(counts, wave, power, np.arange(_FIRST_WAVE) / length))


def form_floor(points: int, sigma_mm: float, arc_length_mm: float, diameter_mm: float) -> float:
    """Return what the sphere's form adds to the points per independent one: short arcs do not average it."""
    form_mm = max(_FORM_MM, _FORM_SHARE * diameter_mm)
    return points * (form_mm / sigma_mm) ** 2 / (1 + arc_length_mm / _FORM_LENGTH_MM) if sigma_mm > 0 else 0.0


def in_cloud(offsets_mm: FloatArray, residuals_mm: FloatArray, sigma_mm: float) -> float:
    """Return how many points of a cloud say as much as an independent one: by the means over patches.

    Parameters
    ----------
    offsets_mm : (N, 3)
        From the sphere's centre.
    residuals_mm : (N,)
        Distances to the sphere.
    sigma_mm : float
    """
    if len(residuals_mm) < 100 or sigma_mm <= 0:
        return 1.0
    low, span = offsets_mm[:, :2].min(axis=0), np.maximum(np.ptp(offsets_mm[:, :2], axis=0), 1e-9)
    cell = np.minimum((offsets_mm[:, :2] - low) / span * _PATCHES, _PATCHES - 1).astype(int)
    patch = cell[:, 0] * _PATCHES + cell[:, 1]
    counts = np.bincount(patch, minlength=_PATCHES**2)
    sums = np.bincount(patch, residuals_mm, minlength=_PATCHES**2)
    filled = counts >= _LEAST_IN_PATCH
    if filled.sum() < 12:
        return 1.0
    squares = sums[filled] ** 2 / counts[filled] / sigma_mm**2
    return max(1.0, float(squares.sum()) / (int(filled.sum()) - 4))


def _without_shapes(
    arcs: Sequence[tuple[FloatArray, FloatArray]], shapes: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the residuals without what known shapes, alike in all profiles, explain beside the circles."""
    columns: list[FloatArray] = []
    rests: list[FloatArray] = []
    for (angle, residual), shape in zip(arcs, shapes, strict=True):
        own = np.column_stack([np.ones_like(angle), np.cos(angle), np.sin(angle)])
        both = np.column_stack([shape, residual])
        both = both - own @ np.linalg.lstsq(own, both, rcond=None)[0]
        columns.append(both[:, :-1])
        rests.append(both[:, -1])
    known = np.linalg.lstsq(np.concatenate(columns), np.concatenate(rests), rcond=1e-8)[0]
    return [rest - column @ known for rest, column in zip(rests, columns, strict=True)]


def _in_bands(wave: FloatArray, power: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return counts, mean waves and mean powers in bands that grow by a fifth."""
    edges = np.geomspace(wave.min() * 0.999, 1.001, 40)
    band = np.searchsorted(edges, wave)
    counts = np.bincount(band, minlength=42).astype(float)
    full = counts > 0
    means = [np.bincount(band, values, minlength=42)[full] / counts[full] for values in (wave, power)]
    return counts[full], means[0], means[1]


def _long_wave_power(counts: FloatArray, wave: FloatArray, power: FloatArray, long: FloatArray) -> float:
    """Return the power at long waves over the mean one, by the likeliest of white and falling spectra."""
    corners, shares = np.geomspace(wave.min(), 0.7, 14), np.geomspace(0.2, 1e4, 24)
    falling = 1 / (1 + (wave / corners[:, None]) ** 2)
    shapes = np.concatenate([np.ones((1, len(wave))), *(1 + shares[:, None] * one for one in falling)])
    levels = np.sum(counts * power / shapes, axis=1) / counts.sum()
    expected = levels[:, None] * shapes
    values = -0.5 * np.sum(counts * (np.log(expected) + power / expected), axis=1)
    best = 1 + int(np.argmax(values[1:]))
    if not values[best] > values[0] + _SIGNIFICANT:
        return 1.0
    corner, share = divmod(best - 1, len(shares))
    at_long = levels[best] * (1 + shares[share] / (1 + (long / corners[corner]) ** 2))
    return float(at_long.mean()) / float(levels[0])
