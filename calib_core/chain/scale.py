"""Whether the scanner's own scale is right: an error of x or z can hide in the TCP."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.likelihood import fit
from calib_core.chain.rejection import Judged
from calib_core.frames import FloatArray

_PROBE = 0.002
_FLATTEST = 0.05  # a ray that only grazes the sphere says nothing reliable
_SIGNIFICANT = 5.0
# Real arcs are bent by some tenths of a per cent for other reasons; scanners that are wrong are wrong by more.
_WORTH_SAYING = 0.005


@dataclass(frozen=True)
class ScaleError:
    """A significant scale error of one axis of the scanner: measured lengths should be multiplied by 1 + error."""

    axis: str
    error: float
    sigma: float


def scale_errors(judged: Judged, measured_point_sigma_mm: float | None) -> list[ScaleError]:
    """Return the axes (x, z) of profiles whose scale differs significantly from one.

    The likelihood is maximised again with the points stretched a little either way; its parabola gives the most
    likely scale and that one's standard deviation.  Neither the arcs alone nor the poses alone decide: both do.

    Parameters
    ----------
    judged : Judged
    measured_point_sigma_mm : float or None
        The noise that the profiles themselves show.  It decides here, not a given one: the two parts of `_cost`
        pull opposite ways and balance only at the true noise; half as much again would be told as a wrong scale.
    """
    if len(judged.data.points) == 0:
        return []
    if measured_point_sigma_mm:
        weights = np.full(judged.data.count, 1 / measured_point_sigma_mm**2)
        judged = replace(judged, data=replace(judged.data, weights=weights))
    middle = _cost(judged, np.ones(3))
    found: list[ScaleError] = []
    for axis, name in ((0, "x"), (2, "z")):
        costs: list[float] = []
        for stretch in (-_PROBE, _PROBE):
            factors = np.ones(3)
            factors[axis] += stretch
            costs.append(_cost(judged, factors))
        low, high = costs
        curvature = (low + high - 2 * middle) / _PROBE**2
        if curvature <= 0:
            continue
        error = (low - high) / (2 * _PROBE) / curvature
        sigma = float(np.sqrt(judged.excess / curvature))
        if abs(error) > max(_SIGNIFICANT * sigma, _WORTH_SAYING):
            found.append(ScaleError(name, float(error), sigma))
    return found


def _cost(judged: Judged, factors: FloatArray) -> float:
    """Return half the squares, and the log-density's other part, with the points stretched by factors (3,).

    A scanner's noise acts along its ray, z, while residuals are distances to the sphere: the density of z has the
    slope between the two as a factor.  It hardly matters to a capture, but all captures' add up in the scale.
    """
    data = judged.data
    points = data.points * factors
    at = fit(replace(data, points=points), judged.fit.state, judged.fit.sigmas).at
    offsets = points - np.repeat(at.centers_in_laser, np.diff(data.offsets), axis=0)
    slopes = np.abs(offsets[:, 2]) / np.linalg.norm(offsets, axis=1) * factors[2]
    return at.cost - float(np.sum(np.log(np.maximum(slopes, _FLATTEST))))
