"""How far the robot's poses scatter: variance components by restricted likelihood (REML), and what that adds.

Position and orientation scatter are estimated from the captures themselves, with a weak prior for an industrial
arm, and the answer's covariance is averaged over what they may be: few captures know them only roughly.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.likelihood import ChainData, ChainLinearisation, ChainState, Sigmas, fit, pose_spread
from calib_core.estimation import GridPosterior, Minimum, covariance_of, grid_posterior
from calib_core.frames import FloatArray

# A weak prior, in logarithms.  Arms of this class repeat to some hundredths of a millimetre and are true to some
# tenths, so either may be three times smaller or larger without surprise.  Their orientation scatters less than is
# easily seen; on a long arm it would otherwise pass for position, and the other way round.
_PRIOR_POSITION_MM = 0.1
_PRIOR_ORIENTATION_RAD = 5e-5
_PRIOR_WIDTHS = np.log([3.0, 2.0])
_POSITION_RANGE_MM = (0.002, 50.0)
_ORIENTATION_RANGE_RAD = (2e-6, 2e-2)


@dataclass(frozen=True, eq=False)
class ChainFit:
    """The most likely unknowns, the pose sigmas, and the covariance that both together deserve.

    Attributes
    ----------
    minimum : Minimum
        At the sigmas below.
    sigmas : Sigmas
        Given, or the posterior's geometric mean.
    covariance : (9, 9) or (10, 10)
        Of the unknowns, the uncertainty of estimated sigmas included.
    """

    minimum: Minimum[ChainState, ChainLinearisation]
    sigmas: Sigmas
    covariance: FloatArray

    @property
    def state(self) -> ChainState:
        """The most likely unknowns."""
        return self.minimum.state


def fit_with_sigmas(
    data: ChainData, start: ChainState, position_mm: float | None, orientation_rad: float | None
) -> ChainFit:
    """Return the most likely unknowns with pose sigmas that are given or, where None, estimated.

    Parameters
    ----------
    data : ChainData
    start : ChainState
        Near the answer.
    position_mm, orientation_rad : float or None
        Per axis.
    """
    sigmas = Sigmas(
        _PRIOR_POSITION_MM if position_mm is None else position_mm,
        _PRIOR_ORIENTATION_RAD if orientation_rad is None else orientation_rad,
    )
    minimum = fit(data, start, sigmas)
    if position_mm is not None and orientation_rad is not None:
        return ChainFit(minimum, sigmas, covariance_of(minimum.at.hessian))
    low, high = _search_box(position_mm, orientation_rad)
    posterior: GridPosterior | None = None
    for iteration in range(1, 5):
        likelihood = _Restricted(data, minimum)
        posterior = grid_posterior(
            lambda node, of=likelihood: of.value(node) + _log_prior(node), low, high, around=posterior
        )
        before, mean = sigmas, np.exp(posterior.mean)
        sigmas = Sigmas(float(mean[0]), float(mean[1]))
        minimum = fit(data, minimum.state, sigmas)
        change = np.log([sigmas.position_mm / before.position_mm, sigmas.orientation_rad / before.orientation_rad])
        if np.abs(change).max() < 0.05 or iteration == 4:
            covariance = _averaged_covariance(_Restricted(data, minimum), posterior)
            return ChainFit(minimum, sigmas, covariance)
    raise AssertionError("the loop above returns")


def _search_box(position_mm: float | None, orientation_rad: float | None) -> tuple[FloatArray, FloatArray]:
    """Return the logarithms between which sigmas are sought; a given one is not sought at all."""
    ranges = [
        limits if given is None else (max(given, limits[0]),) * 2
        for given, limits in ((position_mm, _POSITION_RANGE_MM), (orientation_rad, _ORIENTATION_RANGE_RAD))
    ]
    low, high = np.log(np.array(ranges)).T
    return low, high


def _log_prior(log_sigmas: FloatArray) -> float:
    off = log_sigmas - np.log([_PRIOR_POSITION_MM, _PRIOR_ORIENTATION_RAD])
    return -0.5 * float(np.sum((off / _PRIOR_WIDTHS) ** 2))


class _Restricted:
    """The restricted log-likelihood of the pose sigmas, with everything else linearised at one minimum."""

    def __init__(self, data: ChainData, minimum: Minimum[ChainState, ChainLinearisation]) -> None:
        state, self._at = minimum.state, minimum.at
        self._predicted = minimum.at.centers_in_laser + minimum.at.offset
        self._tool_in_laser = state.tool_rotation.T @ state.tool_translation
        self._prior = np.zeros((len(minimum.at.gradient),) * 2)
        self._deviation = 0.0
        if data.free_radius:
            self._prior[-1, -1] = 1 / data.radius_sigma_mm**2
            self._deviation = (state.radius_mm - data.radius_mm) / data.radius_sigma_mm**2

    def equations(self, log_sigmas: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return Hessian, gradient, and log-likelihood at the linearisation point, for other sigmas."""
        from calib_core.kernels.chain import marginal_normal_equations, pose_error_gain

        at = self._at
        sigmas = Sigmas(float(np.exp(log_sigmas[0])), float(np.exp(log_sigmas[1])))
        spread = pose_spread(self._predicted, self._tool_in_laser, sigmas)
        gain, share = np.empty_like(spread), np.empty_like(spread)
        logarithm = pose_error_gain(at.information, spread, gain, share)
        hessian, gradient = np.empty_like(at.hessian), np.empty_like(at.gradient)
        marginal_normal_equations(
            at.information, at.vector, gain, share, at.offset, at.jacobian, hessian, gradient
        )
        # −½ eᵀΛe + ηᵀe + ½ hᵀGh, which is hᵀe − ½ eᵀAe + ½ (h − Ae)ᵀ G (h − Ae).
        own = at.information[:, :3, :3]
        pull = np.einsum("kij,kj->ki", own, at.offset)
        rest = at.vector[:, :3] - pull
        value = float(
            np.sum(at.offset * (at.vector[:, :3] - 0.5 * pull)) + 0.5 * np.einsum("ki,kij,kj", rest, gain, rest)
        )
        hessian += self._prior
        gradient[-1] += self._deviation
        return hessian, gradient, value - 0.5 * logarithm

    def value(self, log_sigmas: FloatArray) -> float:
        """Return the restricted log-likelihood: the unknowns maximised out and their loss of freedom counted."""
        hessian, gradient, value = self.equations(log_sigmas)
        scale = np.sqrt(np.diag(hessian))
        eigenvalues, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
        eigenvalues = np.maximum(eigenvalues, 1e-12)
        along = vectors.T @ (gradient / scale)
        logarithm = np.sum(np.log(eigenvalues)) + 2 * np.sum(np.log(scale))
        return value + 0.5 * float(np.sum(along**2 / eigenvalues)) - 0.5 * float(logarithm)


def _averaged_covariance(likelihood: _Restricted, posterior: GridPosterior) -> FloatArray:
    """Return E[covariance | sigmas] + covariance of E[unknowns | sigmas] over the sigmas' posterior."""
    kept = posterior.weights > 1e-6
    weights = posterior.weights[kept] / posterior.weights[kept].sum()
    equations = [likelihood.equations(node) for node in posterior.nodes[kept]]
    inverses = np.array([covariance_of(hessian) for hessian, _, _ in equations])
    steps = -np.einsum("nij,nj->ni", inverses, np.array([gradient for _, gradient, _ in equations]))
    spread = steps - weights @ steps
    return np.einsum("n,nij->ij", weights, inverses) + np.einsum("n,ni,nj->ij", weights, spread, spread)
