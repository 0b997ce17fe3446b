"""How much the robot scatters by what the captures show before they are solved.

Before a solve the scatter of an ordinary arm is assumed.  Where the spheres that the captures show lie clearly
farther apart than that lets expect, a prediction by it would promise too much: an arm that scatters six times as
much had "enough" captures by the guide, and five times the uncertainty by the result.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.special import chdtri

from calib_core.chain.model import Sigmas
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.start import Start
from calib_core.frames import FloatArray, skew

_CLEARLY: Final = 0.01  # how often captures that scatter as assumed are taken for others
_GROSS: Final = 6.0  # times the median of the misfits: what a solve will leave out
_LEAST_FREEDOM: Final = 3
_MOST_MM: Final = 10.0
_STEEPEST: Final = 50.0  # of a circle's radius against the height that follows from it
_STEPS: Final = 30
_RANK: Final = 1e-9


def position_sigma_mm(
    seen: Sequence[SphereObservation], sphere: SphereSize, start: Start, assumed: Sigmas
) -> float:
    """Return the robot's position scatter, each axis, in mm: as assumed, or what makes the captures' own fit.

    Tool and sphere are fitted to the spheres that the captures show, each weighted by its covariance.  The sum of
    the squares that are left has as many degrees of freedom as there are coordinates beyond the unknowns; where
    it is larger than 99 of 100 such sums, the scatter is the one by which it is as large as that number.

    Parameters
    ----------
    seen : sequence of SphereObservation
    sphere : SphereSize
    start : Start
        Tool, sphere and sides as found from them.
    assumed : Sigmas
        Its position is the least that is returned.
    """
    used = start.misfit_mm <= _GROSS * max(start.scatter_mm, assumed.position_mm)
    chosen = [o for o, good in zip(seen, used, strict=True) if good]
    residual, jacobian = _linear(chosen, sphere, start, start.sides[used])
    own, arm = _covariances(chosen, sphere, start, assumed)

    def left_over(sigma_mm: float) -> tuple[float, int]:
        covariance = own + arm + sigma_mm**2 * np.eye(3)
        whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        rows = (whiten @ jacobian).reshape(-1, 9)
        rows = rows / np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
        axes, values, _ = np.linalg.svd(rows, full_matrices=False)
        axes = axes[:, values > _RANK * values[0]]
        off = (whiten @ residual[..., None]).ravel()
        return float(off @ off - np.sum((axes.T @ off) ** 2)), off.size - axes.shape[1]

    least = assumed.position_mm
    squares, freedom = left_over(least)
    if freedom < _LEAST_FREEDOM or squares <= chdtri(freedom, _CLEARLY):
        return least
    low, high = np.log([max(least, 1e-6), _MOST_MM])
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if left_over(float(np.exp(middle)))[0] > freedom else (low, middle)
    return float(np.exp(high))


def _linear(
    seen: Sequence[SphereObservation], sphere: SphereSize, start: Start, sides: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how far each sphere's centre lies from the fitted one in L (K, 3), and what moves that (K, 3, 9)."""
    measured = np.array(
        [o.sphere_center_in_laser_mm(sphere, int(side) or 1) for o, side in zip(seen, sides, strict=True)]
    )
    laser_from_base = np.array([(o.base_from_tool0.rotation @ start.rotation).T for o in seen])
    flange = np.array([o.base_from_tool0.translation_mm for o in seen])
    there = np.einsum("kij,kj->ki", laser_from_base, start.center - flange) - start.rotation.T @ start.translation
    turned = np.array([skew(place) for place in there])
    shifted = np.broadcast_to(-start.rotation.T, turned.shape)
    return measured - there, np.concatenate([turned, shifted, laser_from_base], axis=2)


def _covariances(
    seen: Sequence[SphereObservation], sphere: SphereSize, start: Start, assumed: Sigmas
) -> tuple[FloatArray, FloatArray]:
    """Return the covariances (K, 3, 3) in L of each sphere's centre, and of the arm without its own position."""
    own = np.array([_center_covariance(o, sphere) for o in seen])
    turn = assumed.orientation_rad**2 + assumed.alike_orientation_rad**2
    levers = np.array(
        [
            skew(
                (o.base_from_tool0.rotation @ start.rotation).T @ (start.center - o.base_from_tool0.translation_mm)
            )
            for o in seen
        ]
    )
    return own, turn * levers @ np.swapaxes(levers, 1, 2) + assumed.alike_position_mm**2 * np.eye(3)


def _center_covariance(one: SphereObservation, sphere: SphereSize) -> FloatArray:
    """Return the covariance of the sphere's centre in L, mm²: of a profile by what x, z and radius say of it.

    Scale, rim and sphere err by as much as is believed beforehand: near a great circle that is most of what is
    wrong across the profile.
    """
    if one.circle_radius_mm is None:
        return one.center_covariance
    believed = ScannerPriors()
    errors_mm = sphere.sigma_mm / 2, believed.incidence_mm, believed.scale * one.circle_radius_mm
    radius_variance = sum(error**2 for error in errors_mm)
    height_mm = np.sqrt(max(sphere.radius_mm**2 - one.circle_radius_mm**2, 0.0))
    steep = min(one.circle_radius_mm / max(height_mm, 1e-9), _STEEPEST)
    moves = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -steep], [0.0, 1.0, 0.0]])
    return moves @ (one.center_covariance + np.diag([0.0, 0.0, radius_variance])) @ moves.T
