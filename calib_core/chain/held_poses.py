"""The answer for the controller's poses as they are: what captures share of the arm's errors stays in them.

Errors that are alike over all captures look like another tool.  The likelihood calls them the arm's and keeps
them out of the tool, which is then nearer the true one; but whoever uses it with the controller's poses finds them
again in every point.  So where the tool of poses that err each by itself fits the captures better than chance
explains, the answer moves there, as far as that is more than chance, and the covariance has the way.
"""

from dataclasses import replace

import numpy as np

from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.likelihood import fit, linearised_at
from calib_core.chain.model import ChainState
from calib_core.frames import FloatArray

_CHANCE = 0.8  # of χ² for each unknown: errors that are alike over some captures alone stay below


def as_told(data: ChainData, state: ChainState, sigmas: Sigmas) -> tuple[ChainState, FloatArray] | None:
    """Return the answer that is best with the poses as told, and the step (P,) to it; None where it is this one.

    Parameters
    ----------
    data : ChainData
    state : ChainState
        The most likely one, in which captures share errors of the arm.
    sigmas : Sigmas
    """
    if not sigmas.is_alike:
        return None
    own = Sigmas(
        float(np.hypot(sigmas.position_mm, sigmas.alike_position_mm)),
        float(np.hypot(sigmas.orientation_rad, sigmas.alike_orientation_rad)),
        sigmas.axes,
    )
    alone, begin = replace(data, arm_scale_sigma=0.0, drift_sigma_mm=0.0), replace(state, shared=None)
    best = fit(alone, begin, own)
    gained = 2 * (linearised_at(alone, begin, own).cost - best.at.cost)
    share = 1 - (_CHANCE * data.free_unknowns / max(gained, 1e-12)) ** 4
    if share <= 0 or not best.converged:
        return None
    step = share * state.step_to(best.state)
    scanner = state.scanner + share * (best.state.scanner - state.scanner)
    shared = state.shared
    if data.arm_means is not None and shared is not None and best.state.shared is not None:
        many, shared = len(data.arm_means), shared.copy()  # the arm's own errors move along
        shared[-many:] += share * (best.state.shared[-many:] - shared[-many:])
    position = state.position.moved(data.walk.layout, step)
    return replace(state, position=position, scanner=scanner, shared=shared), step
