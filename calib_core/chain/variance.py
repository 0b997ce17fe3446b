"""How far robot and table scatter: variance components by restricted likelihood (REML), and what that adds.

Position, orientation and angle scatter are estimated from the captures themselves, with a weak prior for an
industrial arm and its table, and the answer's covariance is averaged over what they may be: few captures know them
only roughly.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.centers import centers_suffice, fit_centers
from calib_core.chain.likelihood import ChainLinearisation, fit, pose_spread
from calib_core.chain.model import ChainData, ChainState, Sigmas, prior
from calib_core.estimation import GridPosterior, Minimum, covariance_of, grid_posterior
from calib_core.frames import FloatArray

# A weak prior, in logarithms.  Arms of this class repeat to some hundredths of a millimetre and are true to some
# tenths, so either may be three times smaller or larger without surprise.  Their orientation scatters less than is
# easily seen; on a long arm it would otherwise pass for position, and the other way round.
_PRIOR_POSITION_MM = 0.1
_PRIOR_ORIENTATION_RAD = 7e-5
_PRIOR_ANGLE_RAD = 1e-4
_PRIOR = np.log([_PRIOR_POSITION_MM, _PRIOR_ORIENTATION_RAD, _PRIOR_ANGLE_RAD])
_PRIOR_WIDTHS = np.log([3.0, 2.0, 3.0])
_POSITION_RANGE_MM = (0.002, 50.0)
_ORIENTATION_RANGE_RAD = (2e-6, 2e-2)
_ANGLE_RANGE_RAD = (1e-6, 2e-2)

GivenSigmas = tuple[float | None, float | None, float | None]
"""Of a pose's position (mm) and orientation (rad) and of the table's angle (rad); None: to be estimated."""


@dataclass(frozen=True, eq=False)
class ChainFit:
    """The most likely unknowns, the pose sigmas, and the covariance that both together deserve.

    Attributes
    ----------
    minimum : Minimum
        At the sigmas below.
    sigmas : Sigmas
        Given, or the posterior's geometric mean.
    covariance : (P, P)
        Of the unknowns (9, the table's, the radius), the uncertainty of estimated sigmas included.
    """

    minimum: Minimum[ChainState, ChainLinearisation]
    sigmas: Sigmas
    covariance: FloatArray

    @property
    def state(self) -> ChainState:
        """The most likely unknowns."""
        return self.minimum.state


def fit_with_sigmas(
    data: ChainData,
    start: ChainState,
    position_mm: float | None,
    orientation_rad: float | None,
    angle_rad: float | None = 0.0,
) -> ChainFit:
    """Return the most likely unknowns with sigmas that are given or, where None, estimated.

    Parameters
    ----------
    data : ChainData
    start : ChainState
        Near the answer.
    position_mm, orientation_rad : float or None
        Per axis.
    angle_rad : float or None
        Of the table's angle.
    """
    sigmas = Sigmas(
        _PRIOR_POSITION_MM if position_mm is None else position_mm,
        _PRIOR_ORIENTATION_RAD if orientation_rad is None else orientation_rad,
        _PRIOR_ANGLE_RAD if angle_rad is None else angle_rad,
    )
    if centers_suffice(data):
        start = fit_centers(data, start, sigmas).state
    minimum = fit(data, start, sigmas)
    given = (position_mm, orientation_rad, angle_rad)
    if None not in given:
        return ChainFit(minimum, sigmas, covariance_of(minimum.at.hessian))
    low, high = _search_box(given)
    posterior: GridPosterior | None = None
    for iteration in range(1, 5):
        likelihood = _Restricted(data, minimum)
        posterior = grid_posterior(
            lambda node, of=likelihood: of.value(node) + _log_prior(node), low, high, around=posterior
        )
        before, mean = sigmas, np.exp(posterior.mean)
        sigmas = _with_given(mean, given)
        minimum = fit(data, minimum.state, sigmas)
        if _change(before, sigmas) < 0.05 or iteration == 4:
            covariance = _averaged_covariance(_Restricted(data, minimum), posterior)
            return ChainFit(minimum, sigmas, covariance)
    raise AssertionError("the loop above returns")


def _search_box(given: GivenSigmas) -> tuple[FloatArray, FloatArray]:
    """Return the logarithms between which sigmas are sought; a given one is not sought at all."""
    limits = (_POSITION_RANGE_MM, _ORIENTATION_RANGE_RAD, _ANGLE_RANGE_RAD)
    ranges = [
        limit if value is None else (max(value, limit[0]),) * 2 for value, limit in zip(given, limits, strict=True)
    ]
    low, high = np.log(np.array(ranges)).T
    return low, high


def _with_given(found: FloatArray, given: GivenSigmas) -> Sigmas:
    position, orientation, angle = (
        float(sought) if value is None else value for sought, value in zip(found, given, strict=True)
    )
    return Sigmas(position, orientation, angle)


def _change(before: Sigmas, after: Sigmas) -> float:
    """Return the largest change of a logarithm."""
    pairs = (
        (before.position_mm, after.position_mm),
        (before.orientation_rad, after.orientation_rad),
        (before.angle_rad, after.angle_rad),
    )
    return max(abs(float(np.log(new / old))) for old, new in pairs if old > 0 and new > 0)


def _log_prior(log_sigmas: FloatArray) -> float:
    return -0.5 * float(np.sum(((log_sigmas - _PRIOR) / _PRIOR_WIDTHS) ** 2))


class _Restricted:
    """The restricted log-likelihood of the pose sigmas, with everything else linearised at one minimum."""

    def __init__(self, data: ChainData, minimum: Minimum[ChainState, ChainLinearisation]) -> None:
        state, self._at = minimum.state, minimum.at
        self._predicted = minimum.at.centers_in_laser + minimum.at.offset
        self._tool_in_laser = state.tool_in_laser
        _, self._prior_gradient, self._prior_hessian = prior(data, state)

    def equations(self, log_sigmas: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return Hessian, gradient, and log-likelihood at the linearisation point, for other sigmas."""
        from calib_core.kernels.chain import marginal_normal_equations, pose_error_gain

        at = self._at
        position, orientation, angle = np.exp(log_sigmas).tolist()
        sigmas = Sigmas(position, orientation, angle)
        spread = pose_spread(self._predicted, self._tool_in_laser, sigmas, at.levers)
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
        hessian += self._prior_hessian
        gradient += self._prior_gradient
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
