"""Which captures of tables belong together.

It is not their fault that a table was pushed in between: the few before or after it would be left out, and the
answer would be sure of where the table stood for the others.  Where a push explains every one, all are heard.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.encoder_scales import SCALE_SIGMAS, EncoderScales, judge_scales
from calib_core.chain.model import ChainState
from calib_core.chain.observations import SphereObservation
from calib_core.chain.rejection import Judged, judge_these
from calib_core.chain.table_errors import table_errors_of
from calib_core.chain.table_moves import FAR_MM
from calib_core.chain.variance import GivenSigmas, with_averaged_covariance

_PUSHED = 1e-4
"""So far below what may be said falsely: that a capture is wrong is likelier before any capture than a push."""


def judge_table(
    observations: list[SphereObservation],
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    sigmas: GivenSigmas,
    asked: Callable[[int], bool | None],
) -> tuple[Judged, EncoderScales]:
    """Return captures as `judge_scales` does, and all of those of tables where a push explains each left out."""
    # Of a smaller doubt an eccentric encoder may be the reason as well, which a scale would hide.
    judged, data, scales = judge_scales(observations, data, state, core, sigmas, asked, SCALE_SIGMAS)
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
