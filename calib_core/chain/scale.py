"""Whether the scanner's own scale is right: an error of x or z can hide in the TCP."""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.likelihood import fit
from calib_core.chain.rejection import Judged

_PROBE = 0.002
_SIGNIFICANT = 5.0
# Point noise alone bends short arcs by some tenths of a per cent (a bias of second order); scanners that are wrong
# are wrong by more.
_WORTH_SAYING = 0.005


@dataclass(frozen=True)
class ScaleError:
    """A significant scale error of one axis of the scanner: measured lengths should be multiplied by 1 + error."""

    axis: str
    error: float
    sigma: float


def scale_errors(judged: Judged) -> list[ScaleError]:
    """Return the axes (x, z) of profiles whose scale differs significantly from one.

    The likelihood is maximised again with the points stretched a little either way; its parabola gives the most
    likely scale and that one's standard deviation.  Neither the arcs alone nor the poses alone decide: both do.
    """
    data, state, sigmas = judged.data, judged.fit.state, judged.fit.sigmas
    if len(data.points) == 0:
        return []
    middle = fit(data, state, sigmas).at.cost
    found: list[ScaleError] = []
    for axis, name in ((0, "x"), (2, "z")):
        costs: list[float] = []
        for stretch in (-_PROBE, _PROBE):
            factors = np.ones(3)
            factors[axis] += stretch
            costs.append(fit(replace(data, points=data.points * factors), state, sigmas).at.cost)
        low, high = costs
        curvature = (low + high - 2 * middle) / _PROBE**2
        if curvature <= 0:
            continue
        error = (low - high) / (2 * _PROBE) / curvature
        sigma = float(np.sqrt(judged.excess / curvature))
        if abs(error) > max(_SIGNIFICANT * sigma, _WORTH_SAYING):
            found.append(ScaleError(name, float(error), sigma))
    return found
