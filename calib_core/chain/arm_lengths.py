"""Whether the arm counts its lengths wrongly.

About one sphere, poses that are too long look almost like a scanner whose lengths are too short: only the
sphere's size tells them apart.  A maker's promise (`model.ARM_SCALE_SIGMA`) would settle it, always against the
scanner, and on a real cell it may not hold.  So where the captures contradict lengths that are right, an arm that
may be off by as much as a scanner is tried beside a scanner that is exact: where it explains them about as well,
it is told.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainState
from calib_core.chain.rejection import Judged
from calib_core.chain.scanner import NAMES, ScannerPriors
from calib_core.estimation import covariance_of

_LENGTHS = np.isin(NAMES, ("scale_x", "scale_z"))
_BEYOND_CHANCE = 18.0  # of a logarithm of the likelihood: six standard deviations, as told sigmas may be too small
_AS_WELL = 4.0  # captures of arms that are wrong prefer the scanner by 3 at most, those of scanners by 9 and more
_WORTH_SAYING = 0.002


@dataclass(frozen=True, eq=False)
class ArmLengths:
    """Lengths of an arm that are off.

    Attributes
    ----------
    share, sigma : float
        By which they are too short, and its standard deviation.
    state : ChainState
        The answer by lengths that are right, and a scanner that is.
    """

    share: float
    sigma: float
    state: ChainState


def arm_lengths_error(judged: Judged) -> ArmLengths | None:
    """Return what is off of the arm's lengths; None if they seem right.

    Parameters
    ----------
    judged : Judged
        The captures that belong together, and their fit, in which scanner and arm err as is believed of them.
    """
    data, found, sigmas = judged.data, judged.fit.state, judged.fit.sigmas
    if data.arm_scale_sigma <= 0:
        return None
    believed = judged.fit.minimum.at.cost
    exact = replace(data, nuisance_sigmas=np.where(_LENGTHS[data.kinds], 0.0, data.nuisance_sigmas))
    neither = fit(*_held(replace(exact, arm_scale_sigma=0.0), found), sigmas).at.cost
    if neither - believed < _BEYOND_CHANCE - _AS_WELL:
        return None
    free = replace(exact, arm_scale_sigma=ScannerPriors().scale)
    arm = fit(*_held(free, found), sigmas)
    assert arm.state.shared is not None
    share = float(arm.state.shared[0]) * free.arm_scale_sigma
    if arm.at.cost - believed > _AS_WELL or neither - arm.at.cost < _BEYOND_CHANCE or abs(share) < _WORTH_SAYING:
        return None
    variance = float(covariance_of(arm.at.hessian)[free.width, free.width])
    return ArmLengths(-share, free.arm_scale_sigma * float(np.sqrt(variance)), arm.state)


def _held(data: ChainData, state: ChainState) -> tuple[ChainData, ChainState]:
    """Return captures, and a state as they see the scanner: what is exact is nothing."""
    if data.tool_prior is not None:
        kept = np.isin(state.active, data.active)
        data = replace(data, tool_prior=data.tool_prior.without(~kept))
    return data, replace(state, scanner=np.where(data.nuisance_sigmas > 0, state.scanner, 0.0))
