"""Which side of the plane of light the sphere is on, where that is not clear at first sight.

Of few captures the sphere's centres alone can agree better on wrong sides: the likelihood of all points decides.
Profiles near a great circle have two sides close together: the other one is tried before the first is believed.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import lgamma

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.leave_one_out import WithoutOne
from calib_core.chain.likelihood import ChainLinearisation, fit, spheres_of, without_scanner_errors
from calib_core.chain.model import ChainState
from calib_core.chain.start import Start
from calib_core.chain.variance import ChainFit, GivenSigmas, fit_with_sigmas, is_settled, log_probability
from calib_core.frames import FloatArray

_NEAR = 0.2  # of the radius: farther from the middle the robust start has decided rightly
_BETTER = 0.5  # log-likelihood; less is no reason to change

_FEW = 16  # of more captures the medians of their centres' misfits decide rightly
_MOST_RIVALS = 7
_PLAUSIBLE_MM = 2.0  # arms that scatter more are told to be looked at first
_LOST = 6.0  # scatters of a start: beyond them a capture has no vote


@dataclass(frozen=True, eq=False)
class ChosenSides:
    """The start whose sides all points find likeliest.

    Attributes
    ----------
    start : Start
    log_odds : float or None
        By how much (natural logarithm) its sides are likelier than others; None: not in doubt.
    spread : (P, P)
        Covariance of the edges' unknowns by what other sides would make them, weighted by how likely those are.
    """

    start: Start
    log_odds: float | None
    spread: FloatArray


def likeliest_sides(data: ChainData, starts: Sequence[Start], sigmas: GivenSigmas) -> ChosenSides:
    """Return the likeliest of several starts with different sides.

    Beforehand any share of a session's captures may be on either side: then n of K on one side have the
    probability 1 / ((K + 1) binomial(K, n)), so that captures that are all on one side are likelier than any other
    single choice.

    Parameters
    ----------
    data : ChainData
    starts : sequence of Start
        The one on which the captures' own centres agree best first.
    sigmas
        As given, see `fit_with_sigmas`.
    """
    best = starts[0]
    rivals = [s for s in starts[1:] if s.scatter_mm < _PLAUSIBLE_MM][:_MOST_RIVALS]
    if data.count > _FEW or not rivals:
        return ChosenSides(best, None, np.zeros((data.unknowns, data.unknowns)))
    # A capture that is far off whatever the sides has another fault, and no vote.
    nearest = np.min([s.misfit_mm for s in (best, *rivals)], axis=0)
    voting = data.silent(nearest <= max(_LOST * best.scatter_mm, 2 * _PLAUSIBLE_MM))
    found: dict[bytes, tuple[float, Start, ChainState]] = {}
    for start in (best, *rivals):
        state = ChainState.predicted(data, start.rotation, start.translation, start.center)
        fitted = fit_with_sigmas(voting, state, sigmas, rounds=2)
        if start is not best and not is_settled(fitted):
            continue
        sides = fitted.minimum.at.centers_in_laser[:, 1] > 0
        likely = log_probability(voting, fitted, sigmas) - _log_binomial(data.count, int(sides.sum()))
        # Of starts that end alike the one on which the centres agree best is kept.
        if sides.tobytes() not in found or likely > found[sides.tobytes()][0] + _BETTER:
            found[sides.tobytes()] = likely, start, fitted.state
    ranked = sorted(found.values(), key=lambda one: -one[0])
    likely, start, state = ranked[0]
    chances = np.exp([other - likely for other, _, _ in ranked])
    offsets = np.array([state.step_to(other) for _, _, other in ranked])
    spread = np.einsum("n,ni,nj->ij", chances / chances.sum(), offsets, offsets)
    return ChosenSides(start, likely - ranked[1][0] if len(ranked) > 1 else None, spread)


def _log_binomial(count: int, some: int) -> float:
    return lgamma(count + 1) - lgamma(some + 1) - lgamma(count - some + 1)


def with_better_sides(data: ChainData, found: ChainFit, without: WithoutOne) -> ChainState | None:
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
    near = np.abs(at.centers_in_laser[:, 1]) < _NEAR * data.radii_mm
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


def _gain(data: ChainData, state: ChainState, at: ChainLinearisation, without: WithoutOne, capture: int) -> float:
    """Return by how much a capture is likelier with its sphere on the other side, by what the others expect."""
    from calib_core.kernels.chain import settle_centers

    only = np.zeros(data.count, dtype=bool)
    only[capture] = True
    one = data.chosen(only)
    points, shifts = without_scanner_errors(one, state)
    radii, rays = spheres_of(one, state)
    expected = (at.centers_in_laser + at.offset + without.moved)[[capture]]
    spread = np.linalg.inv(at.precision[[capture]]) + without.spread[[capture]]
    precision = np.asarray(np.linalg.inv(spread), dtype=float)
    costs: list[float] = []
    for side in (1, -1):
        own = at.centers_in_laser[[capture]] * [1.0, side, 1.0]
        costs.append(
            settle_centers(
                points, shifts, one.counts, one.offsets, one.weights, one.effective, rays,
                one.anchors, np.zeros((1, 3, 3)), np.zeros((1, 3)), radii, expected, precision, own,
            )
        )  # fmt: skip
    return costs[0] - costs[1]
