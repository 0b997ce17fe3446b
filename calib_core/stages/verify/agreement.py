"""Held-out captures that do not agree with the others: each is predicted from all others, whatever the tool is."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from calib_core.chain.observations import SphereObservation
from calib_core.estimation import chance_of, covariance_of
from calib_core.frames import FloatArray
from calib_core.stages.verify.held_out import Tool, linearised

_FALSE_ALARM: Final = 0.004  # of a verification whose captures are right
_LEAST: Final = 6  # fewer do not tell which of them is wrong
_MOST_SHARE: Final = 0.25  # of the captures may be named; beyond that nobody knows who is right
_PRIOR_RAD, _PRIOR_MM = (
    0.5,
    300.0,
)  # of the tool, as in its stated error


def disagreeing(
    observations: Sequence[SphereObservation], radius_mm: float, center: FloatArray, tool: Tool
) -> dict[str, float]:
    """Return the captures that the others contradict, the worst first, each with its distance in sigmas.

    Parameters
    ----------
    observations : K captures of a sphere that stands still, none of which helped to find the tool
    radius_mm : float
    center : (3,)
        The sphere in base, about which is linearised.
    tool : Tool
        Its covariance is not used: that the tool is off makes nobody disagree.

    Notes
    -----
    Tool and sphere are fitted to all captures but one, which is then predicted.  Its squared distance is of three
    degrees of freedom, in units of the others' scatter where that is above its expectation; the odds are for the
    worst of K.  The worst is taken out, and the rest are looked at again.
    """
    found: dict[str, float] = {}
    rest = list(observations)
    while len({o.capture for o in rest}) >= _LEAST and len(found) < _MOST_SHARE * len(observations):
        worst = _worst(rest, radius_mm, center, tool)
        if worst is None:
            break
        name, distance = worst
        found[name] = distance
        rest = [o for o in rest if o.capture != name]
    return found


def _worst(
    observations: Sequence[SphereObservation], radius_mm: float, center: FloatArray, tool: Tool
) -> tuple[str, float] | None:
    """Return the capture that lies furthest off its prediction, None where chance explains it."""
    residuals, covariances, by_center, by_tool, _ = linearised(observations, radius_mm, center, tool)
    design = np.concatenate([by_center, by_tool], axis=2)
    weighed = np.linalg.inv(covariances)
    turned = np.swapaxes(design, 1, 2) @ weighed
    prior = np.diag([0.0] * 3 + [1 / _PRIOR_RAD**2] * 3 + [1 / _PRIOR_MM**2] * 3)
    covariance = covariance_of((turned @ design).sum(axis=0) + prior)
    left = residuals - design @ (covariance @ (turned @ residuals[..., None]).sum(axis=0)[:, 0])
    whole = float(np.einsum("ki,kij,kj->", left, weighed, left))
    captures = [o.capture for o in observations]
    names = list(dict.fromkeys(captures))
    ranked: list[tuple[float, str, float]] = []
    for name in names:
        own = [k for k, capture in enumerate(captures) if capture == name]
        rows, error = design[own].reshape(-1, design.shape[2]), left[own].ravel()
        noise = np.zeros((len(error), len(error)))
        for place, k in enumerate(own):
            noise[3 * place : 3 * place + 3, 3 * place : 3 * place + 3] = covariances[k]
        squared = float(error @ np.linalg.solve(noise - rows @ covariance @ rows.T, error))
        freedom = max(len(left.ravel()) - design.shape[2] - len(error), 1)
        scale = max(1.0, (whole - squared) / freedom)
        ranked.append((chance_of(squared / scale, len(error)), name, squared / scale))
    chance, name, squared = min(ranked)
    return (name, float(np.sqrt(squared))) if chance * len(names) < _FALSE_ALARM else None
