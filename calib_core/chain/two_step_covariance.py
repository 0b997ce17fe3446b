"""How uncertain the paper's two-step answer is: the centres' errors propagated through both steps."""

from collections.abc import Sequence

import numpy as np

from calib_core.cell.walk import Walk
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.noise import pose_spread
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.chain.scanner import ScannerPriors
from calib_core.chain.two_step import both_steps, pure_translations
from calib_core.chain.variance import ChainFit
from calib_core.frames import FloatArray, vector_from_rotation

_NUDGE_MM = 1e-3
_MOST_CAPTURES = 60


def two_step_covariance(
    observations: Observations,
    sphere: SphereSize,
    centers: FloatArray,
    rotations: FloatArray,
    translations: FloatArray,
    fit: ChainFit,
    walk: Walk,
    by_files: Sequence[tuple[FloatArray, FloatArray]],
) -> tuple[FloatArray, FloatArray] | None:
    """Return the 6×6 covariance of the two-step mount_from_laser, and that of how it differs from the joint one.

    Each centre's own covariance and its pose's random error are carried through both steps by differences.  What
    the scanner's files err by moves both answers.  None beyond 60 captures (it would be slow).

    Parameters
    ----------
    observations : the K captures
    sphere : SphereSize
    centers : (K, 3)
        In L, mm.
    rotations, translations : (K, 3, 3), (K, 3)
        From what carries the scanner into what carries the ball.
    fit : ChainFit
        Of the same captures: its sigmas are used.
    walk : Walk
        Their ways.
    by_files : sequence of ((K, 3), (6,))
        How the centres move with one sigma of each independent error of the scanner's files, and the joint answer.
    """
    if len(observations) > _MOST_CAPTURES:
        return None
    levers = walk.levers(fit.state.position, centers)
    spread = pose_spread(levers, fit.sigmas)
    alike = Sigmas(fit.sigmas.alike_position_mm, fit.sigmas.alike_orientation_rad)
    spread = spread + pose_spread(levers, alike)
    groups = pure_translations(rotations)
    rotation, translation, _ = both_steps(rotations, translations, centers, groups)
    covariance = np.zeros((6, 6))
    for k, observation in enumerate(observations):
        columns = np.empty((6, 3))
        for axis in range(3):
            nudged = centers.copy()
            nudged[k, axis] += _NUDGE_MM
            other_rotation, other_translation, _ = both_steps(rotations, translations, nudged, groups)
            columns[:3, axis] = vector_from_rotation(rotation.T @ other_rotation)
            columns[3:, axis] = other_translation - translation
        columns /= _NUDGE_MM
        covariance += columns @ (_own_covariance(observation, sphere) + spread[k]) @ columns.T
    beside_joint = covariance.copy()
    for moved, joint in ((_by_size(observations, sphere, centers), np.zeros(6)), *by_files):
        other_rotation, other_translation, _ = both_steps(rotations, translations, centers + moved, groups)
        turned = vector_from_rotation(rotation.T @ other_rotation)
        step = np.concatenate([turned, other_translation - translation])
        covariance += np.outer(step, step)
        beside_joint += np.outer(step - joint, step - joint)
    return covariance, beside_joint


def _by_size(observations: Observations, sphere: SphereSize, centers: FloatArray) -> FloatArray:
    """Return how the centres (K, 3) move with one sigma of the sphere's size, as the scanner shows it."""
    moved = np.zeros_like(centers)
    sigma = float(np.hypot(sphere.sigma_mm / 2, ScannerPriors().incidence_mm))
    for k, o in enumerate(observations):
        if o.circle_radius_mm is not None:
            radius_mm = o.size(sphere).radius_mm
            height = np.sqrt(max(radius_mm**2 - o.circle_radius_mm**2, (0.1 * radius_mm) ** 2))
            moved[k, 1] = np.sign(centers[k, 1]) * radius_mm / height * sigma
    return moved


def _own_covariance(observation: SphereObservation, sphere: SphereSize) -> FloatArray:
    """Return the covariance (3, 3) of a capture's own sphere centre; a profile's y by r/√(R² − r²)."""
    radius = observation.circle_radius_mm
    if radius is None:
        return observation.center_covariance * observation.points_per_independent
    of_ball_mm = observation.size(sphere).radius_mm
    height = np.sqrt(max(of_ball_mm**2 - radius**2, (0.02 * of_ball_mm) ** 2))
    rows = np.array([[1.0, 0, 0], [0, 0, -radius / height], [0, 1.0, 0]])
    return rows @ (observation.center_covariance * observation.points_per_independent) @ rows.T
