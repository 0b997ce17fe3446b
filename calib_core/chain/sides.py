"""Profiles near a great circle have two sides close together: try the other one before believing the first."""

from dataclasses import replace

import numpy as np

from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainData, ChainState
from calib_core.chain.variance import ChainFit

_NEAR = 0.2  # of the radius: farther from the middle the robust start has decided rightly
_BETTER = 0.5  # log-likelihood; less is no reason to change


def with_better_sides(data: ChainData, found: ChainFit) -> ChainState | None:
    """Return a state that is more likely with some profiles' spheres on the other side; None if there is none.

    Each profile whose sphere's centre is within a fifth of the radius of the plane of light is mirrored in turn,
    everything is fitted again from there with the same sigmas, and the better of the two is kept.

    Parameters
    ----------
    data : ChainData
        The captures of the fit.
    found : ChainFit
    """
    best, best_at = found.state, found.minimum.at
    lengths = np.diff(data.offsets)
    near = np.abs(best_at.centers_in_laser[:, 1]) < _NEAR * data.radius_mm
    improved = False
    for k in np.flatnonzero(near & (lengths > 0)):
        own = best_at.centers_in_laser.copy()
        own[k, 1] *= -1
        trial = fit(data, replace(best, centers_in_laser=own), found.sigmas)
        if trial.at.cost < best_at.cost - _BETTER:
            best, best_at, improved = trial.state, trial.at, True
    return replace(best, centers_in_laser=best_at.centers_in_laser) if improved else None
