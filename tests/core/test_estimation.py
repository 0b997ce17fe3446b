"""The one least-squares wrapper, covariance, and posteriors of few parameters, on problems with known answers."""

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from calib_core.errors import CalibrationError
from calib_core.estimation import covariance_of, damped_step, maximum, minimise, posterior_about
from calib_core.frames import FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    cost: float
    gradient: FloatArray
    hessian: FloatArray


def rosenbrock(x: FloatArray) -> Problem:
    """Residuals 10 (y − x²) and 1 − x: a bent valley to (1, 1)."""
    residual = np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]])
    jacobian = np.array([[-20 * x[0], 10], [-1.0, 0]])
    return Problem(0.5 * float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian)


def add(x: FloatArray, step: FloatArray, _at: Problem) -> FloatArray:
    return x + step


def linear(jacobian: FloatArray, target: FloatArray):
    def problem(x: FloatArray) -> Problem:
        residual = jacobian @ x - target
        return Problem(0.5 * float(residual @ residual), jacobian.T @ residual, jacobian.T @ jacobian)

    return problem


@pytest.mark.parametrize("start", [(-1.2, 1.0), (10.0, -10.0), (0.0, 0.0), (1.0, 1.0)])
def test_it_finds_the_end_of_a_bent_valley(start: tuple[float, float]) -> None:
    found = minimise(rosenbrock, add, np.array(start), np.full(2, 100.0), 1e-12, most_iterations=200)
    assert found.converged
    np.testing.assert_allclose(found.state, [1, 1], atol=1e-5)
    assert found.at.cost < 1e-10
    assert found.at.cost == rosenbrock(found.state).cost


def test_a_linear_problem_takes_one_step_and_the_second_sees_that_it_is_done() -> None:
    rng = np.random.default_rng(3)
    jacobian, target = rng.normal(size=(20, 4)), rng.normal(size=20)
    found = minimise(linear(jacobian, target), add, np.full(4, 5.0), np.full(4, 1e3))
    np.testing.assert_allclose(found.state, np.linalg.lstsq(jacobian, target, rcond=None)[0], atol=1e-9)
    assert found.converged
    assert found.iterations <= 3


def test_no_step_is_longer_than_its_limit_and_its_direction_is_kept() -> None:
    steps: list[FloatArray] = []

    def noting(x: FloatArray, step: FloatArray, _at: Problem) -> FloatArray:
        steps.append(step)
        return x + step

    limit = np.array([0.5, 100.0])
    far = np.array([30.0, 60.0])
    found = minimise(linear(np.eye(2), far), noting, np.zeros(2), limit, most_iterations=200)
    np.testing.assert_allclose(found.state, far)
    assert all((np.abs(step) <= limit * (1 + 1e-12)).all() for step in steps)
    np.testing.assert_allclose(steps[0], [0.5, 1.0])  # shortened as a whole
    assert len(steps) >= 60


def test_it_says_when_it_did_not_get_there() -> None:
    found = minimise(
        linear(np.eye(2), np.array([30.0, 60.0])), add, np.zeros(2), np.full(2, 1.0), most_iterations=5
    )
    assert not found.converged
    assert found.iterations == 5
    np.testing.assert_allclose(found.state, [2.5, 5.0])  # five steps of the right way


def test_a_direction_without_information_is_left_where_it_was() -> None:
    """One of three unknowns does not matter, two matter only as a sum: the rest is still found."""
    jacobian = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    start = np.array([0.3, -0.3, 7.0])
    found = minimise(linear(jacobian, np.array([5.0, 10.0])), add, start, np.full(3, 1e3))
    assert found.converged
    assert found.at.cost < 1e-12
    assert found.state[0] + found.state[1] == pytest.approx(5)
    assert found.state[2] == pytest.approx(7.0)
    assert found.state[0] - found.state[1] == pytest.approx(0.6)


def test_a_start_without_finite_residuals_is_refused() -> None:
    with pytest.raises(CalibrationError, match="finite residuals"):
        minimise(linear(np.eye(1), np.array([np.nan])), add, np.zeros(1), np.ones(1))


def test_a_start_whose_information_is_no_number_is_refused_before_anything_is_solved() -> None:
    def endless(x: FloatArray) -> Problem:
        return Problem(0.0, np.zeros(1), np.full((1, 1), np.inf))

    with pytest.raises(np.linalg.LinAlgError, match="information"):
        minimise(endless, add, np.zeros(1), np.ones(1))


def test_a_step_into_nowhere_is_taken_back() -> None:
    def root(x: FloatArray) -> Problem:
        with np.errstate(invalid="ignore"):
            value = float(np.sqrt(x[0]) - 0.1)
        slope = 0.5 / np.sqrt(abs(x[0]))
        return Problem(0.5 * value**2, np.array([slope * value]), np.array([[slope**2]]))

    found = minimise(root, add, np.array([4.0]), np.array([100.0]), 1e-14)  # the first full step goes below zero
    assert found.state[0] == pytest.approx(0.01, rel=1e-4)


@given(st.integers(0, 10_000), st.floats(-6, 6))
def test_the_covariance_is_the_inverse_however_the_units_differ(seed: int, exponent: float) -> None:
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(30, 5)) * [1, 10.0**exponent, 1, 10.0 ** (-exponent), 1]
    covariance = covariance_of(jacobian.T @ jacobian)
    _, r = np.linalg.qr(jacobian)
    root = np.linalg.inv(r)
    expected = root @ root.T
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(covariance / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-8)
    assert (covariance == covariance.T).all()


def test_the_covariance_of_what_is_not_seen_is_huge_and_only_there() -> None:
    jacobian = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 2.0]])
    covariance = covariance_of(jacobian.T @ jacobian)
    assert np.isfinite(covariance).all()
    along = np.array([1, -1, 0]) / np.sqrt(2)
    across = np.array([1, 1, 0]) / np.sqrt(2)
    assert along @ covariance @ along > 1e9
    assert across @ covariance @ across == pytest.approx(0.25, abs=0.05)  # 1e14 beside it costs that many digits
    assert covariance[2, 2] == pytest.approx(0.25)


def test_more_damping_is_a_shorter_step_downhill() -> None:
    hessian, gradient = np.diag([1.0, 100.0]), np.array([1.0, -50.0])
    lengths: list[float] = []
    for damping in (0.0, 0.1, 1.0, 100.0):
        step = damped_step(hessian, gradient, damping)
        assert step @ gradient < 0
        lengths.append(float(np.linalg.norm(step)))
    np.testing.assert_allclose(damped_step(hessian, gradient, 0.0), [-1.0, 0.5])
    assert lengths == sorted(lengths, reverse=True)


@settings(max_examples=25)
@given(st.floats(-2, 2), st.floats(-2, 2), st.floats(0.4, 1.0), st.floats(0.4, 1.0), st.floats(-0.6, 0.6))
def test_a_gaussians_mode_is_found_and_its_nodes_have_its_moments(
    a: float, b: float, sigma_a: float, sigma_b: float, correlation: float
) -> None:
    off = correlation * sigma_a * sigma_b
    covariance = np.array([[sigma_a**2, off], [off, sigma_b**2]])
    precision, mean, widths = np.linalg.inv(covariance), np.array([a, b]), np.full(2, 1.5)

    def log_density(x: FloatArray) -> float:
        return -0.5 * float((x - mean) @ precision @ (x - mean)) + 123.0  # the constant plays no part

    low, high = np.full(2, -7.0), np.full(2, 7.0)
    mode = maximum(log_density, np.zeros(2), widths, low, high, tolerance=1e-4)
    np.testing.assert_allclose(mode, mean, atol=0.05)
    posterior = posterior_about(log_density, mean, widths)
    off_mean = posterior.nodes - mean
    np.testing.assert_allclose(posterior.weights @ posterior.nodes, mean, atol=1e-6)
    np.testing.assert_allclose(
        np.einsum("n,ni,nj->ij", posterior.weights, off_mean, off_mean), covariance, atol=1e-6
    )


def test_a_maximum_beyond_the_box_is_its_edge() -> None:
    found = maximum(
        lambda x: 3.0 * float(x[0]), np.array([1.0]), np.array([1.0]), np.array([0.0]), np.array([5.0])
    )
    assert found[0] == pytest.approx(5.0)


def test_a_density_that_falls_off_faster_on_one_side_gives_that_node_less_weight() -> None:
    def log_density(x: FloatArray) -> float:
        return -0.5 * float(x[0]) ** 2 * (4.0 if x[0] > 0 else 0.25)

    posterior = posterior_about(log_density, np.zeros(1), np.array([3.0]))
    assert posterior.weights[np.argmin(posterior.nodes[:, 0])] > 0.6
