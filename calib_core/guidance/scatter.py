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
_PRECISE_MM: Final = 1e-4
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
    from scipy.optimize import root_scalar  # a tenth of a second to import

    used = start.misfit_mm <= _GROSS * max(start.scatter_mm, assumed.position_mm)
    chosen = [o for o, good in zip(seen, used, strict=True) if good]
    laser_from_base = np.array([(o.base_from_tool0.rotation @ start.rotation).T for o in chosen])
    flange = np.array([o.base_from_tool0.translation_mm for o in chosen])
    from_flange = np.einsum("kij,kj->ki", laser_from_base, start.center - flange)
    expected = from_flange - start.rotation.T @ start.translation
    sides = start.sides[used]
    measured = np.array(
        [o.sphere_center_in_laser_mm(sphere, int(s) or 1) for o, s in zip(chosen, sides, strict=True)]
    )
    residual, jacobian = measured - expected, _jacobian(laser_from_base, expected, start)
    known = np.array([_center_covariance(o, sphere) for o in chosen]) + _arm_covariance(from_flange, assumed)

    def left_over(sigma_mm: float) -> tuple[float, int]:
        covariance = known + sigma_mm**2 * np.eye(3)
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

    def too_much(sigma_mm: float) -> float:
        return left_over(sigma_mm)[0] - freedom

    if too_much(_MOST_MM) > 0:
        return _MOST_MM
    return float(root_scalar(too_much, bracket=(least, _MOST_MM), xtol=_PRECISE_MM).root)


def _jacobian(laser_from_base: FloatArray, expected: FloatArray, start: Start) -> FloatArray:
    """Return how the expected centres (K, 3) in L move with the tool and the sphere's centre, (K, 3, 9)."""
    turned = np.array([skew(place) for place in expected])
    shifted = np.broadcast_to(-start.rotation.T, turned.shape)
    return np.concatenate([turned, shifted, laser_from_base], axis=2)


def _arm_covariance(from_flange: FloatArray, assumed: Sigmas) -> FloatArray:
    """Return the covariances (K, 3, 3) in L of centres that lie so far from the flange, its own position apart."""
    turn = assumed.orientation_rad**2 + assumed.alike_orientation_rad**2
    levers = np.array([skew(place) for place in from_flange])
    return turn * levers @ np.swapaxes(levers, 1, 2) + assumed.alike_position_mm**2 * np.eye(3)


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
