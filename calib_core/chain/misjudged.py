"""What an answer is worth whose weights came from sigmas that the captures contradict."""

import numpy as np

from calib_core.chain.likelihood import pose_spread
from calib_core.chain.model import ChainData
from calib_core.chain.rejection import Judged
from calib_core.chain.variance import ChainFit, GivenSigmas, fit_with_sigmas
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray


def covariance_of_judged(judged: Judged, given: GivenSigmas) -> FloatArray:
    """Return the covariance (P, P) of the unknowns; where the captures contradict given sigmas, what they say."""
    if judged.excess > 1 and None not in given:
        return covariance_under_estimated_sigmas(judged.data, judged.fit)
    return judged.fit.covariance * judged.excess


def covariance_under_estimated_sigmas(data: ChainData, found: ChainFit) -> FloatArray:
    """Return the covariance (P, P) of a fit with wrong pose sigmas, the true ones being estimated.

    The estimate stays what its weights made it: with H = Σ JᵀΛJ and errors of covariance Λ⁻¹ + ΔS in each capture
    its covariance is H⁻¹ + H⁻¹ (Σ JᵀΛ ΔS ΛJ) H⁻¹ (the "sandwich").

    Parameters
    ----------
    data : ChainData
        The captures of the fit.
    found : ChainFit
        At the sigmas that were given.
    """
    from calib_core.kernels.chain import without_pose_error

    at, state = found.minimum.at, found.state
    predicted = at.centers_in_laser + at.offset
    likely = fit_with_sigmas(data, state, None, None, found.sigmas.angle_rad).sigmas
    more, given = (pose_spread(predicted, state.tool_in_laser, s, at.levers) for s in (likely, found.sigmas))
    size, width = at.information.shape[1], at.jacobian.shape[2]
    middle = np.zeros_like(at.hessian)
    reduced, rest = np.empty((size, size)), np.empty(size)
    for k in range(len(at.offset)):
        without_pose_error(at.information[k], at.vector[k], at.gain[k], at.share[k], reduced, rest)
        rows = np.zeros((3, len(at.hessian)))  # Λ's first three rows: only there do poses err
        rows[:, :width] = reduced[:3, :3] @ at.jacobian[k]
        if size == 4:
            rows[:, -1] = reduced[:3, 3]
        middle += rows.T @ (more[k] - given[k]) @ rows
    inverse = covariance_of(at.hessian)
    return inverse + inverse @ middle @ inverse
