"""Held-out captures that do not agree with the others: each is predicted from all others, whatever the tool is."""

from typing import Final

import numpy as np

from calib_core.chain.observations import Observations
from calib_core.estimation import chance_of, f_chance_of
from calib_core.stages.verify.held_out import Asked, asked_by

_FALSE_ALARM: Final = 0.004  # of a verification whose captures are right
_LEAST: Final = 6  # fewer do not tell which of them is wrong
_MOST_SHARE: Final = 0.25  # of the captures may be named; beyond that nobody knows who is right


def disagreeing(observations: Observations, radius_mm: float, asked: Asked) -> dict[str, float]:
    """Return the captures that the others contradict, the worst first, each with its distance in sigmas.

    Parameters
    ----------
    observations : K captures of a sphere that stands still, none of which helped to find the tool
    radius_mm : float
    asked : Asked
        The tool that they ask for: that the one that is verified is off makes nobody disagree.

    Notes
    -----
    Tool and sphere are fitted to all captures but one, which is then predicted.  Its squared distance is of three
    degrees of freedom, in units of the others' scatter where that is above its expectation (an F test); the odds
    are for the worst of K.  The worst is taken out, and the rest are looked at again.
    """
    found: dict[str, float] = {}
    rest = list(observations)
    while len({o.capture for o in rest}) >= _LEAST and len(found) < _MOST_SHARE * len(observations):
        worst = _worst(rest, asked)
        if worst is None:
            break
        name, distance = worst
        found[name] = distance
        rest = [o for o in rest if o.capture != name]
        asked = asked_by(rest, radius_mm, asked.mount_from_laser, asked.center_mm, asked.given)
    return found


def _worst(observations: Observations, asked: Asked) -> tuple[str, float] | None:
    """Return the capture that lies furthest off its prediction, None where chance explains it."""
    captures = [o.capture for o in observations]
    names = list(dict.fromkeys(captures))
    ranked: list[tuple[float, str, float]] = []
    for name in names:
        own = [k for k, capture in enumerate(captures) if capture == name]
        rows, error = asked.design[own].reshape(-1, asked.design.shape[2]), asked.residuals[own].ravel()
        noise = np.zeros((len(error), len(error)))
        for place, k in enumerate(own):
            noise[3 * place : 3 * place + 3, 3 * place : 3 * place + 3] = np.linalg.inv(asked.weights[k])
        squared = float(error @ np.linalg.solve(noise - rows @ asked.covariance @ rows.T, error))
        freedom = max(asked.residuals.size - asked.design.shape[2] - len(error), 1)
        scale = (asked.squared - squared) / freedom
        chance = f_chance_of(squared / scale, len(error), freedom) if scale > 1 else chance_of(squared, len(error))
        ranked.append((chance, name, squared / max(scale, 1.0)))
    chance, name, squared = min(ranked)
    return (name, float(np.sqrt(squared))) if chance * len(names) < _FALSE_ALARM else None
