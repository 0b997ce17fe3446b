"""How the answer would move if one capture were excluded, before anything is solved again.

One Gauss–Newton step from the minimum, with the capture's rows taken out of the information: a downdate of the
covariance (Woodbury), as in Cook's distance (Cook and Weisberg, Residuals and Influence in Regression, 1982).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.chain.held import Held
from calib_core.chain.leave_one_out import WithoutOne
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, skew, vector_from_rotation


@dataclass(frozen=True, eq=False)
class Influence:
    """What excluding each capture would do to the tool; NaN for captures that are not used.

    Attributes
    ----------
    shift_mm : (K,)
        How far a point that is measured at the workpiece would move.
    turn_rad : (K,)
        By how much the scanner's orientation would turn.
    growth : (K,)
        By which factor that point's uncertainty in its worst direction would grow.
    """

    shift_mm: FloatArray
    turn_rad: FloatArray
    growth: FloatArray


def influence_of(
    held: Held, without: WithoutOne, used: Sequence[bool] | np.ndarray, point_in_laser_mm: FloatArray
) -> Influence:
    """Return how the tool would move without each of K captures, at a point of the plane of light (3,), mm."""
    state = held.state
    before = state.tool_rotation @ point_in_laser_mm + state.tool_translation
    count = len(used)
    shift_mm, turn_rad = np.full(count, np.nan), np.full(count, np.nan)
    for k in np.flatnonzero(used):
        moved = state.moved(without.steps[k])
        shift_mm[k] = np.linalg.norm(moved.tool_rotation @ point_in_laser_mm + moved.tool_translation - before)
        turn_rad[k] = np.linalg.norm(vector_from_rotation(state.tool_rotation.T @ moved.tool_rotation))
    rows = np.hstack([-state.tool_rotation @ skew(point_in_laser_mm), np.eye(3)])
    known = rows @ covariance_of(held.at.hessian)[:6, :6] @ rows.T
    wider = known + without.wider(rows)[:count]
    growth = np.sqrt(np.linalg.eigvalsh(wider)[:, -1] / np.linalg.eigvalsh(known)[-1])
    return Influence(shift_mm, turn_rad, np.where(np.isfinite(shift_mm), growth, np.nan))
