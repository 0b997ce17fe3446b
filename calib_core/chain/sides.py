"""Profiles near a great circle have two sides close together: try the other one before believing the first."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from calib_core.chain.likelihood import ChainLinearisation, fit, without_scanner_errors
from calib_core.chain.model import ChainData, ChainState
from calib_core.chain.variance import ChainFit

if TYPE_CHECKING:
    from calib_core.chain.rejection import WithoutOne

_NEAR = 0.2  # of the radius: farther from the middle the robust start has decided rightly
_BETTER = 0.5  # log-likelihood; less is no reason to change


def with_better_sides(data: ChainData, found: ChainFit, without: "WithoutOne") -> ChainState | None:
    """Return a state that is more likely with some profiles' spheres on the other side; None if there is none.

    Each profile whose sphere's centre is within a fifth of the radius of the plane of light is settled on
    either side, as the other captures expect it; those that are better off on the other one are changed, and all
    is fitted again with the same sigmas.

    Parameters
    ----------
    data : ChainData
        The captures of the fit.
    found : ChainFit
    without : WithoutOne
        What the unknowns become without each capture.
    """
    best, at = found.state, found.minimum.at
    near = np.abs(at.centers_in_laser[:, 1]) < _NEAR * data.radius_mm
    candidates = np.flatnonzero(near & (np.diff(data.offsets) > 0) & (data.weights > 0))
    gains = np.array([_gain(data, best, at, without, int(k)) for k in candidates])
    order = candidates[np.argsort(-gains)][: int((gains > _BETTER).sum())]
    for some in [order] if len(order) == 1 else [order, order[:1]]:
        if len(some) == 0:
            continue
        own = at.centers_in_laser.copy()
        own[some, 1] *= -1
        trial = fit(data, replace(best, centers_in_laser=own), found.sigmas)
        if trial.at.cost < at.cost - _BETTER:
            return replace(trial.state, centers_in_laser=trial.at.centers_in_laser)
    return None


def _gain(
    data: ChainData, state: ChainState, at: ChainLinearisation, without: "WithoutOne", capture: int
) -> float:
    """Return by how much a capture is likelier with its sphere on the other side, by what the others expect."""
    from calib_core.kernels.chain import settle_centers

    only = np.zeros(data.count, dtype=bool)
    only[capture] = True
    one = data.chosen(only)
    points, shifts = without_scanner_errors(one, state)
    expected = (at.centers_in_laser + at.offset + without.moved)[[capture]]
    spread = np.linalg.inv(at.precision[[capture]]) + without.spread[[capture]]
    precision = np.asarray(np.linalg.inv(spread), dtype=float)
    costs: list[float] = []
    for side in (1, -1):
        own = at.centers_in_laser[[capture]] * [1.0, side, 1.0]
        costs.append(
            settle_centers(
                points, shifts, one.counts, one.offsets, one.weights, one.effective, one.anchors,
                np.zeros((1, 3, 3)), np.zeros((1, 3)), state.radius_mm, expected, precision, own,
            )
        )  # fmt: skip
    return costs[0] - costs[1]
