"""Estimation in one place: damped least squares, covariance, chi-square bounds, variance components.

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
    """
    state, at = start, linearise(start)
    if not np.isfinite(at.cost):
        raise CalibrationError("finite residuals", "NaN or infinity", "Check the captures for impossible numbers.")
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
    scale = np.sqrt(np.maximum(np.diag(hessian), 1e-300))
    values, vectors = np.linalg.eigh(hessian / np.outer(scale, scale))
    values = np.maximum(values, 1e-14 * values.max())
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return (inverse + inverse.T) / 2


def _limited(step: FloatArray, limit: FloatArray) -> FloatArray:
    excess = float(np.max(np.abs(step) / limit))
    return step / excess if excess > 1 else step


_COARSE, _FINE = 13, 9


@dataclass(frozen=True, eq=False)
class GridPosterior:
    """A posterior density on a small grid.

    Attributes
    ----------
    nodes : (N, D)
        Where the density was evaluated.
    weights : (N,)
        Its values, summing to one.
    """

    nodes: FloatArray
    weights: FloatArray

    @property
    def mean(self) -> FloatArray:
        """The posterior mean, (D,)."""
        return self.weights @ self.nodes

    @property
    def deviation(self) -> FloatArray:
        """The posterior standard deviation, (D,)."""
        return np.sqrt(self.weights @ (self.nodes - self.mean) ** 2)


def grid_posterior(
    log_density: Callable[[FloatArray], float],
    low: FloatArray,
    high: FloatArray,
    around: GridPosterior | None = None,
) -> GridPosterior:
    """Return a posterior of few parameters by a coarse grid and a fine one about its bulk.

    Two grids need no start, no gradient and no luck; the density is evaluated 13ᴰ + 9ᴰ times.

    Parameters
    ----------
    log_density
        Of one point (D,), up to a constant.
    low, high : (D,)
        The box to search; a dimension with low = high is fixed.
    around : GridPosterior, optional
        A posterior that is near this one: then the coarse grid is spared.
    """
    spacing = (high - low) / (_COARSE - 1)
    first = around or _on_grid(log_density, low, high, _COARSE)
    reach = 3 * np.maximum(first.deviation, 0.15 * spacing if around else 0.5 * spacing)
    return _on_grid(log_density, np.maximum(first.mean - reach, low), np.minimum(first.mean + reach, high), _FINE)


def _on_grid(
    log_density: Callable[[FloatArray], float], low: FloatArray, high: FloatArray, count: int
) -> GridPosterior:
    axes = [np.linspace(a, b, count) if b > a else np.array([a]) for a, b in zip(low, high, strict=True)]
    nodes = np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)
    values = np.array([log_density(node) for node in nodes])
    weights = np.exp(values - values.max())
    return GridPosterior(nodes, weights / weights.sum())
