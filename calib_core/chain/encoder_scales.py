"""Whether each axis's encoder counts as it should, by the captures that it moves.

An encoder that counts three parts in a thousand too much moves a sphere 90 mm off the axis by more than a
millimetre after most of a turn: that is no fault of the captures that show it.  So where captures are rejected, or
the scale is doubtful, they are judged once more with the scale as an unknown.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainState
from calib_core.chain.observations import Observations
from calib_core.chain.rejection import Judged, judge_from, judge_these
from calib_core.chain.variance import GivenSigmas
from calib_core.estimation import covariance_of

SCALE_SIGMAS = 4.0
"""From so many standard deviations on an encoder's scale error is believed."""

DOUBTFUL_SIGMAS = 2.5
"""From so many on one that is held is tried: estimated scatters then hold what it does, and hide it."""

_WORTH_SAYING = 1e-4


@dataclass(frozen=True)
class EncoderScale:
    """The table turns by 1 + error for each unit that is read; `applied` where the answer has it."""

    error: float
    sigma: float
    applied: bool

    @property
    def size(self) -> float:
        """The error in standard deviations."""
        return abs(self.error) / self.sigma

    @property
    def significant(self) -> bool:
        """Whether the error is beyond chance, and large enough to matter."""
        return abs(self.error) > max(SCALE_SIGMAS * self.sigma, _WORTH_SAYING)


EncoderScales = dict[int, EncoderScale]
"""Of each axis that moves a ball or the robot, by its number."""


def judge_scales(
    observations: Observations,
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    sigmas: GivenSigmas,
    asked: Callable[[int], bool | None],
    doubtful: float = DOUBTFUL_SIGMAS,
) -> tuple[Judged, ChainData, EncoderScales]:
    """Return the captures that belong together, as `judge_from`, all of them, and the encoders' scales.

    A scale that is beyond doubt is an unknown of what is returned, unless the encoder is said to be exact.

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays.
    state, core, sigmas
        As in `judge_from`.
    asked : callable
        Gives what is asked of an axis's encoder: True where its scale is sought whatever the captures say, False
        where it is to be believed.
    doubtful : float
        From how many standard deviations on a scale that is held is tried as an unknown.
    """
    axes, layout = _tested(data), data.walk.layout
    for axis in filter(asked, axes):
        data = data.holding(layout.scale(axis), held=False)
    judged = judge_from(observations, data, state, core, sigmas)
    scales = _encoder_scales(judged, axes)
    for axis in sorted(scales, key=lambda one: -scales[one].size):
        own = scales[axis]
        if own.applied or (judged.used.all() and own.size < doubtful):
            continue
        opened = data.holding(layout.scale(axis), held=False)
        free = judge_from(observations, opened, state, core, sigmas)
        found = _encoder_scales(free, axes)
        if not found[axis].significant or free.used.sum() < judged.used.sum():
            continue
        if asked(axis) is False:
            judged = judge_these(observations, data, state, free.used, sigmas)
            return judged, data, {**found, axis: replace(found[axis], applied=False)}
        data, judged, scales = opened, free, found
    return judged, data, scales


def _tested(data: ChainData) -> list[int]:
    """Return the axes that carry a ball, and those under the robot that moved it and are not known."""
    walk, layout = data.walk, data.walk.layout
    readings = walk.readings[walk.over_robot != 0]
    moved = (readings != readings[:1]).any(axis=0)
    feet = [a for a, axis in enumerate(layout.axes) if axis.under_robot and moved[a]]
    return [*layout.carrying, *(a for a in feet if not data.held[layout.axis(a).start])]


def _encoder_scales(judged: Judged, axes: list[int]) -> EncoderScales:
    """Return the encoders' scale errors as the captures want them, each whether it was sought or held."""
    return {axis: _encoder_scale(judged, axis) for axis in axes}


def _encoder_scale(judged: Judged, axis: int) -> EncoderScale:
    column = judged.data.walk.layout.scale(axis)
    free = fit(judged.data.holding(column, held=False), judged.fit.state, judged.fit.sigmas)
    sigma = float(np.sqrt(covariance_of(free.at.hessian)[column, column] * judged.excess))
    return EncoderScale(free.state.position.axes[axis].scale - 1, sigma, not judged.data.held[column])
