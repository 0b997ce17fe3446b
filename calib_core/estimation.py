"""Estimation in one place: damped least squares, covariance, chances, posteriors of few parameters.

A problem is given by its normal equations, so that solvers may assemble them in the way that suits their structure
(sparse, marginalised, compiled) and still share damping, step limits and the decision when to stop.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray

State = TypeVar("State")


def chance_of(chi_squared: float, degrees_of_freedom: float) -> float:
    """Return how often noise alone gives as large a χ² or a larger one."""
    from scipy.special import chdtrc  # scipy.stats has it too, but takes a second to import

    return float(chdtrc(degrees_of_freedom, max(chi_squared, 0.0)))


def f_chance_of(chi_squared: float, degrees_of_freedom: float, left: float) -> float:
    """Return how often noise alone gives as large a χ², its unit known from what is left, of so many degrees."""
    if np.isinf(left):
        return chance_of(chi_squared, degrees_of_freedom)
    from scipy.special import fdtrc  # scipy.stats has it too, but takes a second to import

    return float(fdtrc(degrees_of_freedom, left, max(chi_squared, 0.0) / degrees_of_freedom))


class Linearisation(Protocol):
    """A problem about one state: half its squared residuals, their gradient and Gauss–Newton Hessian."""

    @property
    def cost(self) -> float:
        """Half the sum of squared, whitened residuals."""
        ...

    @property
    def gradient(self) -> FloatArray:
        """Of the cost, (P,)."""
        ...

    @property
    def hessian(self) -> FloatArray:
        """Of the cost without second derivatives, (P, P)."""
        ...


L = TypeVar("L", bound=Linearisation)


@dataclass(frozen=True, eq=False)
class Minimum(Generic[State, L]):
    """Where a minimisation ended, and the problem linearised there."""

    state: State
    at: L
    iterations: int
    converged: bool


def minimise(
    linearise: Callable[[State], L],
    retract: Callable[[State, FloatArray, L], State],
    start: State,
    step_limit: FloatArray,
    tolerance: float = 1e-6,
    most_iterations: int = 60,
) -> Minimum[State, L]:
    """Minimise by Levenberg–Marquardt (Marquardt's scaling) with a limit on each component of a step.

    Parameters
    ----------
    linearise
        The problem about a state.
    retract
        The state after a step (P,) from the state at which a linearisation was made.
    start
        Where to begin.
    step_limit : (P,)
        The longest step in each parameter; a longer one is shortened as a whole.
    tolerance
        Ends when a step changes the cost by less than this, in units of half a squared standard deviation.
    most_iterations
        After so many it ends unconverged, and says so.

    Raises
    ------
    CalibrationError
        If the cost is not finite at the start.
    LinAlgError
        If the information there is not.
    """
    state, at = start, linearise(start)
    if not np.isfinite(at.cost):
        raise CalibrationError("finite residuals", "NaN or infinity", "Check the captures for impossible numbers.")
    if not np.isfinite(at.hessian).all():  # LAPACK would complain on standard output, and give anything
        raise np.linalg.LinAlgError("information that is not finite")
    damping = 0.0
    for iteration in range(1, most_iterations + 1):
        step = _limited(damped_step(at.hessian, at.gradient, damping), step_limit)
        if damping == 0.0 and float(-step @ at.gradient) < 1e-3 * tolerance:
            return Minimum(state, at, iteration, True)
        trial_state = retract(state, step, at)
        trial = linearise(trial_state)
        gain = at.cost - trial.cost
        if np.isfinite(trial.cost) and gain >= -1e-9 * max(1.0, at.cost):
            state, at = trial_state, trial
            damping = damping / 10 if damping > 1e-9 else 0.0
            predicted = float(-step @ at.gradient)
            if (abs(gain) < tolerance and abs(predicted) < max(tolerance, 1e-3 * abs(gain))) or gain == 0.0:
                return Minimum(state, at, iteration, True)
        else:
            damping = max(10 * damping, 1e-4)
            if damping > 1e8:
                return Minimum(state, at, iteration, True)
    return Minimum(state, at, most_iterations, False)


_WELL_KNOWN = 1e-5  # of a scaled Hessian's Cholesky factor


def damped_step(hessian: FloatArray, gradient: FloatArray, damping: float) -> FloatArray:
    """Return the Levenberg–Marquardt step (P,); directions without any information get none."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    scaled = hessian / np.outer(scale, scale) + damping * np.eye(len(scale))
    try:
        step = np.linalg.solve(scaled, -gradient / scale)
        if np.isfinite(step).all() and np.abs(step).max() < 1e9:
            return step / scale
    except np.linalg.LinAlgError:
        pass
    return np.linalg.lstsq(scaled, -gradient / scale, rcond=1e-12)[0] / scale


def covariance_of(hessian: FloatArray) -> FloatArray:
    """Return the inverse of a Hessian (P, P), well scaled; unknown directions come out huge, not as NaN."""
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-290))  # so that 1e14 times its inverse is a number
    scaled = hessian / np.outer(scale, scale)
    try:  # a tenth of the time, where every direction is known
        low = np.linalg.cholesky(scaled)
        if np.diag(low).min() > _WELL_KNOWN:
            half = np.linalg.inv(low) / scale
            return half.T @ half
    except np.linalg.LinAlgError:
        pass
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, 1e-14 * values.max())
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return (inverse + inverse.T) / 2


def _limited(step: FloatArray, limit: FloatArray) -> FloatArray:
    excess = float(np.max(np.abs(step) / limit))
    return step / excess if excess > 1 else step


@dataclass(frozen=True, eq=False)
class Posterior:
    """A posterior density of few parameters about its mode.

    Attributes
    ----------
    nodes, weights : (N, D), (N,)
        Where and with which weights, summing to one, a function is to be averaged over the posterior.
    """

    nodes: FloatArray
    weights: FloatArray


def maximum(
    log_density: Callable[[FloatArray], float],
    start: FloatArray,
    widths: FloatArray,
    low: FloatArray,
    high: FloatArray,
    tolerance: float = 0.01,
) -> FloatArray:
    """Return where a smooth log-density of few parameters is largest, by BFGS on differences.

    Parameters
    ----------
    log_density
        Of one point (D,), up to a constant.
    start, widths : (D,)
        Where to begin, and how far the density reaches at most in each parameter.
    low, high : (D,)
        The box that is not left.
    tolerance
        Ends when a step promises less than this.
    """
    x, value = start, log_density(start)
    inverse = np.diag(widths**2) / 2
    slope = _slope(log_density, x, widths)
    for _ in range(20):
        step = inverse @ slope
        step *= min(1.0, float(np.min(1.5 * widths / np.maximum(np.abs(step), 1e-12))))
        if float(step @ slope) < 2 * tolerance:
            break
        for _ in range(6):
            trial = np.clip(x + step, low, high)
            there = log_density(trial)
            if there > value:
                break
            step = step / 3
        else:
            break
        moved, x, gained = trial - x, trial, there - value
        value = there
        before, slope = slope, _slope(log_density, x, widths)
        turned = before - slope
        along = float(turned @ moved)
        if along > 1e-9:
            left = np.eye(len(x)) - np.outer(moved, turned) / along
            inverse = left @ inverse @ left.T + np.outer(moved, moved) / along
        if gained < tolerance:
            break
    return x


def posterior_about(log_density: Callable[[FloatArray], float], mode: FloatArray, widths: FloatArray) -> Posterior:
    """Return a posterior about its mode: nodes by its curvature, weighted by the density that is found there.

    Parameters
    ----------
    log_density, mode, widths
        As in `maximum`; no node lies farther out than the widths say.
    """
    size = len(mode)
    if size == 0:
        return Posterior(mode[None], np.ones(1))
    at_mode = log_density(mode)
    curvature = _curvature(log_density, mode, 0.5 * widths, at_mode)
    scaled = curvature * np.outer(widths, widths)
    values, vectors = np.linalg.eigh(scaled)
    reach = np.sqrt(size / np.maximum(values, 1.0))
    moves = (vectors * reach).T * widths
    nodes = np.concatenate([mode + moves, mode - moves])
    found = np.array([log_density(node) for node in nodes]) - at_mode
    weights = np.exp(np.clip(found + size / 2, -8.0, 1.0))
    return Posterior(nodes, weights / weights.sum())


def _slope(log_density: Callable[[FloatArray], float], at: FloatArray, widths: FloatArray) -> FloatArray:
    slope = np.empty(len(at))
    for p, width in enumerate(widths):
        change = np.zeros(len(at))
        change[p] = 0.1 * width
        slope[p] = (log_density(at + change) - log_density(at - change)) / (0.2 * width)
    return slope


def _curvature(
    log_density: Callable[[FloatArray], float], at: FloatArray, steps: FloatArray, value: float
) -> FloatArray:
    """Return minus the second derivatives (D, D), by differences of D² + D values about one that is known."""
    size = len(at)
    moves = np.diag(steps)
    alone = [log_density(at + move) + log_density(at - move) - 2 * value for move in moves]
    curvature = -np.diag(alone)
    for p in range(size):
        for q in range(p):
            both = moves[p] + moves[q]
            together = log_density(at + both) + log_density(at - both) - 2 * value
            curvature[p, q] = curvature[q, p] = -(together - alone[p] - alone[q]) / 2
    return curvature / np.outer(steps, steps)
