"""Which captures of the table belong together, and whether its encoder counts as it should.

An encoder that counts three parts in a thousand too much moves a sphere 90 mm off the axis by more than a
millimetre after most of a turn: that is no fault of the captures that show it.  So where captures are rejected, or
the scale is doubtful, they are judged once more with the scale as an unknown.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainData, ChainState
from calib_core.chain.observations import SphereObservation
from calib_core.chain.rejection import Judged, judge_from, judge_these
from calib_core.chain.variance import GivenSigmas
from calib_core.estimation import covariance_of

SCALE_SIGMAS = 4.0
"""From so many standard deviations on an encoder's scale error is believed."""

_WORTH_SAYING = 1e-4


@dataclass(frozen=True)
class EncoderScale:
    """The table turns by 1 + error for each unit that is read; `applied` where the answer has it."""

    error: float
    sigma: float
    applied: bool

    @property
    def significant(self) -> bool:
        """Whether the error is beyond chance, and large enough to matter."""
        return abs(self.error) > max(SCALE_SIGMAS * self.sigma, _WORTH_SAYING)


def judge_table(
    observations: list[SphereObservation],
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    sigmas: GivenSigmas,
    exact: bool,
) -> tuple[Judged, EncoderScale]:
    """Return the captures that belong together, as `judge_from`, and the encoder's scale as they want it.

    A scale that is beyond doubt is an unknown of the fit that is returned, unless the encoder is said to be exact.

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays; `data.held` says whether the scale is sought.
    state, core, sigmas
        As in `judge_from`.
    exact : bool
        Whether the encoder is to be believed whatever the captures say.
    """
    judged = judge_from(observations, data, state, core, sigmas)
    scale = encoder_scale(judged)
    column = data.walk.layout.scale(data.walk.layout.table)
    if scale.applied or (judged.used.all() and not scale.significant):
        return judged, scale
    free = judge_from(observations, data.holding(column, held=False), state, core, sigmas)
    found = encoder_scale(free)
    if not found.significant or free.used.sum() < judged.used.sum():
        return judged, scale
    if not exact:
        return free, found
    return judge_these(observations, data, state, free.used, sigmas), replace(found, applied=False)


def encoder_scale(judged: Judged) -> EncoderScale:
    """Return the encoder's scale error as the captures want it, whether it was sought or held."""
    column = judged.data.walk.layout.scale(judged.data.walk.layout.table)
    free = fit(judged.data.holding(column, held=False), judged.fit.state, judged.fit.sigmas)
    sigma = float(np.sqrt(covariance_of(free.at.hessian)[column, column] * judged.excess))
    return EncoderScale(free.state.table.scale - 1, sigma, not judged.data.held[column])
