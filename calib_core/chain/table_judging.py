"""Which captures of tables belong together, and whether each one's encoder counts as it should.

An encoder that counts three parts in a thousand too much moves a sphere 90 mm off the axis by more than a
millimetre after most of a turn: that is no fault of the captures that show it.  So where captures are rejected, or
the scale is doubtful, they are judged once more with the scale as an unknown.

Nor is it their fault that a table was pushed in between: the few before or after it would be left out, and the
answer would be sure of where the table stood for the others.  Where a push explains every one, all are heard.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.likelihood import fit
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereObservation
from calib_core.chain.rejection import Judged, judge_from, judge_these
from calib_core.chain.table_errors import table_errors_of
from calib_core.chain.table_moves import FAR_MM
from calib_core.chain.variance import GivenSigmas, with_averaged_covariance
from calib_core.estimation import covariance_of

SCALE_SIGMAS = 4.0
"""From so many standard deviations on an encoder's scale error is believed."""

_WORTH_SAYING = 1e-4
_PUSHED = 1e-4
"""So far below what may be said falsely: that a capture is wrong is likelier before any capture than a push."""


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
"""Of each axis that carries a ball, by its number."""


def judge_table(
    observations: list[SphereObservation],
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    sigmas: GivenSigmas,
    asked: Callable[[int], bool | None],
) -> tuple[Judged, EncoderScales]:
    """Return the captures that belong together, as `judge_from`, and the encoders' scales as they want them.

    A scale that is beyond doubt is an unknown of the fit that is returned, unless the encoder is said to be exact.

    Parameters
    ----------
    observations, data
        All captures, and the same as arrays; `data.held` says whether the scale is sought.
    state, core, sigmas
        As in `judge_from`.
    asked : callable
        Gives what is asked of an axis's encoder: False where it is to be believed whatever the captures say.
    """
    judged = judge_from(observations, data, state, core, sigmas)
    scales = encoder_scales(judged)
    for axis in sorted(scales, key=lambda one: -scales[one].size):
        own = scales[axis]
        if own.applied or (judged.used.all() and not own.significant):
            continue
        opened = data.holding(data.walk.layout.scale(axis), held=False)
        free = judge_from(observations, opened, state, core, sigmas)
        found = encoder_scales(free)
        if not found[axis].significant or free.used.sum() < judged.used.sum():
            continue
        if asked(axis) is False:
            judged = judge_these(observations, data, state, free.used, sigmas)
            return judged, {**found, axis: replace(found[axis], applied=False)}
        data, judged, scales = opened, free, found
    return _heard_where_pushed(observations, data, judged), scales


def _heard_where_pushed(observations: list[SphereObservation], data: ChainData, judged: Judged) -> Judged:
    """Return the fit to all captures of tables where a push explains each that was left out, else as it was."""
    layout = data.walk.layout
    on_tables = np.isin(data.walk.place, [place for a in layout.carrying for place in layout.on_axis(a)])
    left_out = np.flatnonzero(on_tables & ~judged.used)
    if len(left_out) == 0:
        return judged
    before = int(np.argmax(on_tables))
    every = judge_these(observations, data, judged.fit.state, judged.used | on_tables, judged.given, judged.fit)
    move = table_errors_of(every, data.count - before).move
    if move is None or move.kind != "table-pushed" or move.rarity > _PUSHED or move.shift_mm > FAR_MM:
        return judged
    after = np.isin(left_out, np.array(move.captures) + before)
    if after.any() and not after.all():
        return judged
    averaged = with_averaged_covariance(every.data, every.fit, every.given)
    return replace(every, fit=averaged, excess=judged.excess, inflation=every.excess)


def encoder_scales(judged: Judged) -> EncoderScales:
    """Return the encoders' scale errors as the captures want them, each whether it was sought or held."""
    return {axis: _encoder_scale(judged, axis) for axis in judged.data.walk.layout.carrying}


def _encoder_scale(judged: Judged, axis: int) -> EncoderScale:
    column = judged.data.walk.layout.scale(axis)
    free = fit(judged.data.holding(column, held=False), judged.fit.state, judged.fit.sigmas)
    sigma = float(np.sqrt(covariance_of(free.at.hessian)[column, column] * judged.excess))
    return EncoderScale(free.state.position.axes[axis].scale - 1, sigma, not judged.data.held[column])
