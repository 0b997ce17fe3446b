"""How far robot and table scatter: variance components by restricted likelihood (REML), and what that adds.

Each pose errs by itself, and by a part that it shares with poses that are alike (`arms.alike`).  Amplitudes and
reach are estimated from the captures themselves, with weak priors for an industrial arm and its table, and the
answer's covariance is averaged over what they may be: few captures know them only roughly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from calib_core.arms.alike import alike_factor, alike_pivots, visits
from calib_core.chain.arm_errors import ArmErrors, ArmShares
from calib_core.chain.centers import centers_suffice, fit_centers
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.likelihood import ChainLinearisation, fit, normal_equations
from calib_core.chain.model import ChainState, prediction, prior
from calib_core.chain.noise import NoiseShapes
from calib_core.estimation import Minimum, Posterior, covariance_of, maximum, posterior_about
from calib_core.frames import FloatArray

# A weak prior, in logarithms: position, orientation, the table's angle, its play, then the shared position and
# orientation and their reach.  Arms of this class repeat to some hundredths of a millimetre and are true to
# some tenths.
# A joint that errs turns the flange and moves it: of real arms the shared position is 0.3 to 1 m times the shared
# orientation, so the two are believed together, their ratio within a factor of two.
# Mean, factor, least and largest of each.
_POSITION, _ORIENTATION = (0.1, 3.0, 0.002, 50.0), (1.5e-4, 3.0, 2e-6, 2e-2)
_READING = {"rotary": (1e-4, 3.0, 1e-6, 2e-2), "linear": (0.03, 3.0, 0.001, 50.0)}
_PLAY = (0.01, 3.0, 0.0005, 50.0)
_ALIKE = ((0.03, 3.0, 1e-3, 50.0), (7e-5, 3.0, 1e-6, 2e-2), (1.0, 1.6, 0.3, 3.0))
_IMPOSSIBLE = -1e12
_SETTLED = 0.5  # of the log-likelihood
_MOST_CAPTURES = 120  # from so many the amplitudes are known well enough

_TIED = np.linalg.inv([[1.0, 0.8], [0.8, 1.0]])  # inverse of the prior's correlation

GivenSigmas = tuple[float | None, ...]
"""Of a pose's position (mm) and orientation (rad) and of each axis's readings; None: to be estimated."""


@dataclass(frozen=True, eq=False)
class Believed:
    """What is believed of the sigmas' logarithms: mean, width, least and largest, (6 + A,) each."""

    mean: FloatArray
    width: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, data: ChainData) -> "Believed":
        """Return it for captures whose ways lead over some axes."""
        axes = [_READING[axis.kind] for axis in data.walk.layout.axes]
        return cls(*np.log(np.array([_POSITION, _ORIENTATION, *axes, _PLAY, *_ALIKE])).T)

    def penalty(self, logarithms: FloatArray, free: np.ndarray) -> float:
        """Return half the squared distance of the free ones from what is believed."""
        off = np.where(free, (logarithms - self.mean) / self.width, 0.0)
        return 0.5 * float(off @ off - off[-3:-1] @ off[-3:-1] + off[-3:-1] @ _TIED @ off[-3:-1])

    def logarithms(self, sigmas: Sigmas) -> FloatArray:
        """Return the logarithms of some sigmas, within the limits."""
        return np.clip(np.log(np.maximum(_values(sigmas, len(self.mean) - 6), 1e-12)), self.low, self.high)


@dataclass(frozen=True, eq=False)
class ChainFit:
    """The most likely unknowns, the pose sigmas, and the covariance that both together deserve.

    Attributes
    ----------
    minimum : Minimum
        At the sigmas below.
    sigmas : Sigmas
        Given, or the posterior's mode.
    covariance : (P, P)
        Of the unknowns (the layout', the nuisances), the uncertainty of estimated sigmas included.
    arm : ArmErrors or None
        How these err together with the arm; of a fit whose covariance is averaged.
    """

    minimum: Minimum[ChainState, ChainLinearisation]
    sigmas: Sigmas
    covariance: FloatArray
    arm: ArmErrors | None = None

    @property
    def state(self) -> ChainState:
        """The most likely unknowns."""
        return self.minimum.state


def fit_with_sigmas(
    data: ChainData, start: ChainState, given: GivenSigmas, guess: Sigmas | None = None, rounds: int = 4
) -> ChainFit:
    """Return the most likely unknowns with sigmas that are given or, where None, estimated.

    Parameters
    ----------
    data : ChainData
    start : ChainState
        Near the answer.
    given : GivenSigmas
        What is told of a pose's own errors; play, and those that poses share, are always estimated.
    guess : Sigmas, optional
        Near which the sigmas are.
    rounds : int
        How often sigmas and unknowns follow each other at most.
    """
    given = _asked(data, given)
    believed = Believed.of(data)
    log_sigmas = believed.mean.copy() if guess is None else believed.logarithms(guess)
    free = _free(given)
    sigmas = _sigmas(log_sigmas, given)
    if guess is None and centers_suffice(data):
        start = fit_centers(data, start, sigmas).state
    minimum = fit(data, start, sigmas)
    density = _Density(data, minimum, log_sigmas, given, free)
    for _ in range(rounds):
        before = log_sigmas
        limits = believed.width[free], believed.low[free], believed.high[free]
        log_sigmas = density.with_free(maximum(density, log_sigmas[free], *limits))
        sigmas = _sigmas(log_sigmas, given)
        minimum = fit(data, minimum.state, sigmas)
        density = _Density(data, minimum, log_sigmas, given, free)
        if np.abs(log_sigmas - before)[:-1].max() < 0.1:
            break
    return ChainFit(minimum, sigmas, covariance_of(minimum.at.hessian)[: data.width, : data.width])


def log_probability(data: ChainData, found: ChainFit, given: GivenSigmas) -> float:
    """Return how likely a fit's choice of sides is, but for a constant: the density at its most likely sigmas."""
    given = _asked(data, given)
    free, log_sigmas = _free(given), Believed.of(data).logarithms(found.sigmas)
    return _Density(data, found.minimum, log_sigmas, given, free)(log_sigmas[free])


def is_settled(found: ChainFit) -> bool:
    """Return whether a fit ended at a minimum: of one that ran away the slope promises more than it can hold."""
    at = found.minimum.at
    return 0.5 * float(at.gradient @ covariance_of(at.hessian) @ at.gradient) < _SETTLED


def with_averaged_covariance(data: ChainData, found: ChainFit, given: GivenSigmas) -> ChainFit:
    """Return a fit with the covariance that is averaged over what estimated sigmas may be.

    E[covariance | sigmas] + covariance of E[unknowns | sigmas] over the sigmas' posterior.
    """
    every, weights = _likely_sigmas(data, found, given)
    whole = _Restricted(data, found.minimum)
    size = data.width
    shares = ArmShares(data, alike_pivots(*data.walk.poses, found.sigmas.reach))
    inverses, steps, own = [], [], []
    for sigmas in every:
        hessian, gradient, _ = whole.equations(sigmas)
        inverse, by_shared = covariance_of(hessian), shares.by_shared(sigmas)
        step = -(inverse @ gradient)
        inverses.append(np.hstack([inverse[:size, :size], inverse[:size, size:] @ by_shared.T]))
        steps.append(np.concatenate([step[:size], by_shared @ step[size:]]))
        first = len(inverse) - shares.terms
        own.append(inverse[first:, size:] @ by_shared.T)
    spread = np.array(steps) - weights @ np.array(steps)
    covariance = np.einsum("n,nij->ij", weights, inverses)
    covariance += np.einsum("n,ni,nj->ij", weights, spread[:, :size], spread)
    by_terms = spread[:, spread.shape[1] - shares.terms :]
    terms = np.einsum("n,nij->ij", weights, own) + np.einsum("n,ni,nj->ij", weights, by_terms, spread[:, size:])
    arm = shares.errors(covariance[:, size:], terms, every, weights)
    sigmas = replace(found.sigmas, freedom=whole.freedom(every, weights))
    return replace(found, sigmas=sigmas, covariance=covariance[:, :size], arm=arm)


def mean_sigmas(data: ChainData, found: ChainFit, given: GivenSigmas) -> Sigmas:
    """Return sigmas whose squares are means over what they may be: a covariance by them is near the mean one."""
    every, weights = _likely_sigmas(data, found, given)
    count = len(data.walk.layout.axes)
    values = np.array([_values(one, count) for one in every])
    means = np.sqrt(weights @ values**2)
    means[-1] = np.exp(weights @ np.log(values[:, -1]))
    return _of_values(means)


def _likely_sigmas(data: ChainData, found: ChainFit, given: GivenSigmas) -> tuple[list[Sigmas], FloatArray]:
    """Return what the sigmas may be, and how likely that is: they add up to 1."""
    given = _asked(data, given)
    free, believed = _free(given), Believed.of(data)
    log_sigmas = believed.logarithms(found.sigmas)
    density = _Density(data, found.minimum, log_sigmas, given, free)
    posterior: Posterior = posterior_about(density, log_sigmas[free], believed.width[free])
    kept = posterior.weights > 1e-3
    every = [_sigmas(density.with_free(node), given) for node in posterior.nodes[kept]]
    return every, posterior.weights[kept] / posterior.weights[kept].sum()


def _asked(data: ChainData, given: GivenSigmas) -> GivenSigmas:
    """Return what is given with the play and what poses share: None where captures can tell it.

    Of a robot that is on no way they tell nothing, and of play only those that it is not on the way of.
    """
    over_robot = data.walk.over_robot != 0
    if not over_robot.any():
        return 0.0, 0.0, *given[2:], None, 0.0, 0.0, 1.0
    return *given, 0.0 if over_robot.all() else None, None, None, None


def _free(asked: GivenSigmas) -> np.ndarray:
    return np.array([value is None for value in asked])


def _sigmas(log_sigmas: FloatArray, asked: GivenSigmas) -> Sigmas:
    found = np.exp(log_sigmas)
    own = [sought if value is None else value for sought, value in zip(found, asked, strict=True)]
    return _of_values(np.array(own))


def _of_values(values: FloatArray) -> Sigmas:
    position, orientation, *axes, play, alike_position, alike_orientation, reach = values.tolist()
    return Sigmas(position, orientation, tuple(axes), alike_position, alike_orientation, reach, play_mm=play)


def _values(sigmas: Sigmas, axes: int) -> FloatArray:
    own = [*sigmas.axes, *[0.0] * axes][:axes]
    alike = sigmas.alike_position_mm, sigmas.alike_orientation_rad, sigmas.reach
    return np.array([sigmas.position_mm, sigmas.orientation_rad, *own, sigmas.play_mm, *alike])


class _Density:
    """The log-density of the free sigmas' logarithms: restricted likelihood of some captures, and the prior."""

    def __init__(
        self,
        data: ChainData,
        minimum: Minimum[ChainState, ChainLinearisation],
        log_sigmas: FloatArray,
        given: GivenSigmas,
        free: np.ndarray,
    ) -> None:
        self._likelihood = _Restricted(data, minimum, _representative(data))
        self._believed = Believed.of(data)
        self._log_sigmas, self._given, self._free = log_sigmas, given, free

    def with_free(self, node: FloatArray) -> FloatArray:
        """Return all logarithms, of which the free ones are a node's."""
        every = self._log_sigmas.copy()
        every[self._free] = node
        return every

    def __call__(self, node: FloatArray) -> float:
        every = self.with_free(node)
        penalty = self._believed.penalty(every, self._free)
        return self._likelihood.value(_sigmas(every, self._given)) - penalty


def _representative(data: ChainData) -> np.ndarray:
    """Return the captures from which sigmas are estimated: one of each pose that was visited, and not too many."""
    count = data.count
    chosen = np.arange(count)
    rotations, translations = data.walk.across_robot(as_recorded=True)
    if (visits(rotations, translations) > 1).any():
        numbers = np.hstack([np.round(rotations.reshape(count, 9), 5), np.round(translations, 2)])
        if data.walk.layout.axes or len(data.walk.layout.mounts) > 1 or len(data.walk.layout.places) > 1:
            numbers = np.column_stack([numbers, data.walk.readings, data.walk.place, data.walk.scanner])
        chosen = np.sort(np.unique(numbers, axis=0, return_index=True)[1])
    if len(chosen) > _MOST_CAPTURES:
        chosen = chosen[np.linspace(0, len(chosen) - 1, _MOST_CAPTURES).astype(int)]
    return chosen


def _known(data: ChainData, state: ChainState, shared: int) -> tuple[FloatArray, FloatArray]:
    """Return gradient and Hessian of what is known beside the captures, with so many shared errors, all zero."""
    return prior(data, replace(state, shared=np.zeros(shared)), shared)[1:]


class _Restricted:
    """The restricted log-likelihood of the pose sigmas, with everything else linearised at one minimum."""

    def __init__(
        self, data: ChainData, minimum: Minimum[ChainState, ChainLinearisation], some: np.ndarray | None = None
    ) -> None:
        state, at = minimum.state, minimum.at
        if some is None or len(some) == data.count:
            some = np.arange(data.count)
        else:
            mask = np.zeros(data.count, dtype=bool)
            mask[some] = True
            data = data.chosen(mask)
        self._state = replace(state, shared=None, active=data.active)
        self._data = data
        expected = prediction(data, self._state)
        seen = expected.centers_in_laser
        self._offset = seen - at.centers_in_laser[some]
        self._jacobian = expected.jacobian
        self._information, self._vector = at.information[some], at.vector[some]
        pull = np.einsum("kij,kj->ki", self._information[:, :3, :3], self._offset)
        self._rest = (self._vector[:, :3] - pull)[:, :, None]
        self._at_offset = float(np.sum(self._offset * (self._vector[:, :3] - 0.5 * pull)))
        middle = data.walk.translations.mean(axis=0)
        self._shapes = NoiseShapes.at(data, seen, self._state, expected.levers, middle)
        self._factor_of = cache(partial(alike_factor, *data.walk.poses))
        self._prior_of = cache(partial(_known, data, self._state))

    def equations(self, sigmas: Sigmas) -> tuple[FloatArray, FloatArray, float]:
        """Return Hessian, gradient, and log-likelihood at the linearisation point, for other sigmas."""
        from calib_core.kernels.chain import pose_error_gain

        data, information, vector = self._data, self._information, self._vector
        noise = self._shapes.noise(sigmas, self._factor_of(sigmas.reach))
        gain, share = np.empty_like(noise.spread), np.empty_like(noise.spread)
        logarithm = pose_error_gain(information, noise.spread, gain, share)
        many, first, last = noise.shared.shape[2], data.unknowns, data.width
        jacobian = np.zeros((data.count, 3, last + many))
        jacobian[:, :, :first] = self._jacobian
        jacobian[:, :, last:] = noise.shared
        hessian, gradient = normal_equations(
            information, vector, gain, share, self._offset, jacobian, slice(first, last)
        )
        # −½ eᵀΛe + ηᵀe + ½ hᵀGh, which is hᵀe − ½ eᵀAe + ½ (h − Ae)ᵀ G (h − Ae).
        value = self._at_offset + 0.5 * float(self._rest.ravel() @ (gain @ self._rest).ravel())
        known_gradient, known_hessian = self._prior_of(many)
        hessian += known_hessian
        return hessian, gradient + known_gradient, value - 0.5 * logarithm

    def freedom(self, every: Sequence[Sigmas], weights: FloatArray) -> float:
        """Return from how many degrees of freedom one knows how far poses scatter, by what the sigmas may be."""
        logarithms = np.log([self._shapes.mean_square(one) for one in every])
        variance = float(weights @ (logarithms - weights @ logarithms) ** 2)
        # A variance known from n degrees of freedom: its logarithm's variance is trigamma(n / 2), 2 / n + 2 / n².
        return 2 / variance + 1 if variance > 2e-6 else np.inf

    def value(self, sigmas: Sigmas) -> float:
        """Return the restricted log-likelihood: the unknowns maximised out and their loss of freedom counted."""
        # What `solve_triangular` calls, which takes three times as long to come to it.
        from scipy.linalg.lapack import dtrtrs  # pyright: ignore[reportAttributeAccessIssue]

        hessian, gradient, value = self.equations(sigmas)
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
        hessian /= scale
        hessian /= scale[:, None]
        hessian.ravel()[:: len(scale) + 1] += 1e-12
        try:
            low = np.linalg.cholesky(hessian)
        except np.linalg.LinAlgError:  # nothing is known of some unknown at such sigmas
            return _IMPOSSIBLE
        along = dtrtrs(low.T, gradient / scale, lower=0, trans=1)[0]
        logarithm = np.log(np.diag(low)).sum() + np.log(scale).sum()
        return value + 0.5 * float(along @ along) - float(logarithm)
