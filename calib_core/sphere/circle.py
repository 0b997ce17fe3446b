"""A circle through points in a plane: seeds from three points, geometric least squares, covariance."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib_core.frames import FloatArray

BoolArray = NDArray[np.bool_]

CUT_IN_SIGMAS = 3.5
"""Points further than this many standard deviations from the circle or sphere are left out of its fit."""

# What a normal distribution keeps of its variance when it is cut at ±3.5 σ: 1 − 2c·φ(c) / P(|x| < c).
KEPT_VARIANCE = 0.99389

_LONGEST_STEP = 1e6  # in radii; longer ones come from matrices that are singular but for rounding


@dataclass(frozen=True, eq=False)
class CircleFit:
    """A least-squares circle: `parameters` (x, z, r), `normal_matrix` JᵀJ (3, 3), `residuals` (n,)."""

    parameters: FloatArray
    normal_matrix: FloatArray
    residuals: FloatArray


def distances_to_circle(points: FloatArray, circle: FloatArray) -> FloatArray:
    """Return the signed distances (N,) of points (N, 2) to a circle (x, z, r): positive outside."""
    return np.hypot(points[:, 0] - circle[0], points[:, 1] - circle[1]) - circle[2]


def circles_through(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return the circles (K, 3), x, z, r, through three points each, (K, 2); not finite where they are in line."""
    ab, ac = b - a, c - a
    twice_area = 2 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    ab2, ac2 = (ab**2).sum(axis=1), (ac**2).sum(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x = (ac[:, 1] * ab2 - ab[:, 1] * ac2) / twice_area
        z = (ab[:, 0] * ac2 - ac[:, 0] * ab2) / twice_area
        return np.column_stack([a[:, 0] + x, a[:, 1] + z, np.hypot(x, z)])


def circle_step(points: FloatArray, circle: FloatArray) -> CircleFit:
    """Return the circle after one Gauss–Newton step of the geometric distance over points (n, 2).

    The residuals are those before the step.  The derivative of the distance by (x, z, r) is (−u, −1), with u the
    unit vector from the centre to the point.
    """
    offset = points - circle[:2]
    distance = np.hypot(offset[:, 0], offset[:, 1])
    jacobian = np.ones((len(points), 3))
    jacobian[:, :2] = offset / np.maximum(distance, 1e-300)[:, None]
    residuals = distance - circle[2]
    normal_matrix = jacobian.T @ jacobian
    step = _solved(normal_matrix, jacobian.T @ residuals, _LONGEST_STEP * abs(circle[2]))
    return CircleFit(circle + step, normal_matrix, residuals)


def circle_steps(points: FloatArray, offsets: NDArray[np.int64], circles: FloatArray) -> FloatArray:
    """Return circles (K, 3) after one step each; circle k has the points from offsets[k] to offsets[k + 1]."""
    from calib_core.kernels.sphere import circle_sums

    sums = np.empty((len(circles), 3, 4))
    circle_sums(np.ascontiguousarray(points), offsets, circles, sums)
    try:
        steps = np.linalg.solve(sums[:, :, :3], sums[:, :, 3:])[:, :, 0]
    except np.linalg.LinAlgError:
        steps = np.full(circles.shape, np.inf)
    longest = _LONGEST_STEP * np.abs(circles[:, 2])
    for k in np.flatnonzero(~(np.abs(steps).max(axis=1) < longest)):
        steps[k] = _solved(sums[k, :, :3], sums[k, :, 3], longest[k])
    return circles + steps


def _solved(normal_matrix: FloatArray, gradient: FloatArray, longest: float) -> FloatArray:
    """Return the step (3,), the shortest one where several fit equally well."""
    try:
        step = np.asarray(np.linalg.solve(normal_matrix, gradient), dtype=np.float64)
    except np.linalg.LinAlgError:
        step = np.full(3, np.inf)
    if np.abs(step).max() < longest:
        return step
    return np.asarray(np.linalg.lstsq(normal_matrix, gradient, rcond=1e-14)[0], dtype=np.float64)


def fit_circle(points: FloatArray, start: FloatArray) -> CircleFit:
    """Return the least-squares circle of points (n, 2), by Gauss–Newton from a circle that is near.

    Parameters
    ----------
    points : (n, 2)
    start : (3,)
        x, z, r.
    """
    circle = start
    for _ in range(20):
        fit = circle_step(points, circle)
        moved = float(np.abs(fit.parameters - circle).max())
        circle = fit.parameters
        if moved < 1e-11 * abs(circle[2]) or circle[2] <= 0:
            break
    final = circle_step(points, circle)
    return CircleFit(circle, final.normal_matrix, final.residuals)


def median_of(values: FloatArray) -> float:
    """Return the median of finite values (n ≥ 1), as numpy's does in four times as long."""
    middle = len(values) // 2
    if len(values) % 2:
        return float(np.partition(values, middle)[middle])
    low, high = np.partition(values, (middle - 1, middle))[middle - 1 : middle + 1]
    return float(low + high) / 2


def sigma_of_kept(residuals: FloatArray, parameters: int) -> float:
    """Return the points' standard deviation from the residuals that the cut left over (`KEPT_VARIANCE` mended)."""
    freedom = max(len(residuals) - parameters, 1)
    return float(np.sqrt((residuals @ residuals) / (freedom * KEPT_VARIANCE)))
