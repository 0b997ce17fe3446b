"""The TCP from sphere centres alone: the same likelihood, but with weights that never change, so it is quick.

Where every capture's likelihood is quadratic (clouds and centers), nothing has to be settled or marginalised anew
at each step: each centre simply has a covariance, its own plus its pose's.  Monte-Carlo runs and sessions of
hundreds of captures come this way.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.walk import Position
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.model import ChainState
from calib_core.estimation import Minimum, minimise
from calib_core.frames import FloatArray, rotation_from_vector

_STEP_LIMIT = np.array([0.1] * 3 + [20.0] * 6)
_TOLERANCE = 1e-4  # ends within a thousandth of a standard deviation
_NEAR = 0.1  # of the full steps: they converge quadratically, so that the damped ones end at once


@dataclass(frozen=True, eq=False)
class CenterLinearisation:
    """Half the weighted squares about one state, their gradient (9,) and Hessian (9, 9)."""

    cost: float
    gradient: FloatArray
    hessian: FloatArray


def centers_suffice(data: ChainData) -> bool:
    """Return whether `fit_centers` applies: no profile, one scanner, one still ball, nothing held, all heard."""
    heard = bool((data.anchor_information[:, 0, 0] > 0).all())
    return heard and len(data.points) == 0 and data.unknowns == 9 and not data.held.any()


def fit_centers(data: ChainData, start: ChainState, sigmas: Sigmas) -> Minimum[ChainState, CenterLinearisation]:
    """Return the most likely unknowns of captures that are all clouds or centers; covariance: inverse Hessian.

    Parameters
    ----------
    data : ChainData
        Without profiles' points, the radius known.
    start : ChainState
        Near the answer.
    sigmas : Sigmas
        Of the robot's poses.
    """
    from calib_core.kernels.centers import center_normal_equations, center_weights

    arms = start.centers_in_laser + start.tool_rotation.T @ start.tool_translation
    weights = np.empty((data.count, 3, 3))
    center_weights(data.anchor_information, arms, sigmas.position_mm**2, sigmas.orientation_rad**2, weights)
    measured = data.anchors
    if data.anchor_gradient.any():
        slopes = data.anchor_gradient[:, :3, None]
        measured = measured - np.linalg.solve(data.anchor_information[:, :3, :3], slopes)[..., 0]

    def linearise(state: ChainState) -> CenterLinearisation:
        hessian, gradient = np.empty((9, 9)), np.empty(9)
        cost = center_normal_equations(
            data.rotations, data.translations, weights, measured, state.tool_rotation, state.tool_translation,
            state.center, hessian, gradient,
        )  # fmt: skip
        return CenterLinearisation(cost, gradient, hessian)

    def retract(state: ChainState, step: FloatArray, _at: CenterLinearisation) -> ChainState:
        turned = state.tool_rotation @ rotation_from_vector(step[:3])
        return _with(state, turned, state.tool_translation + step[3:6], state.center + step[6:])

    near = _approached(data, start, weights, measured)
    return minimise(linearise, retract, near or start, _STEP_LIMIT, _TOLERANCE)


def _approached(
    data: ChainData, start: ChainState, weights: FloatArray, measured: FloatArray
) -> ChainState | None:
    """Return the minimum by full steps alone, or None where they do not lead to one: then damping is needed."""
    from calib_core.kernels.centers import approach_centers

    rotation, translation, center = start.tool_rotation.copy(), start.tool_translation.copy(), start.center.copy()
    try:
        found = approach_centers(
            data.rotations, data.translations, weights, measured, rotation, translation, center, _STEP_LIMIT, _NEAR
        )
    except np.linalg.LinAlgError:  # turned about one axis only: along it nothing is known
        return None
    if not found:
        return None
    return _with(start, rotation, translation, center)


def _with(state: ChainState, rotation: FloatArray, translation: FloatArray, center: FloatArray) -> ChainState:
    return replace(state, position=Position(rotation[None], translation[None], center[None]))
