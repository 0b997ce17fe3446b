"""What a scanner does wrong, as unknowns with priors: scales, shear, bow, and error by the angle of incidence.

They are common to all captures, so that no residual of one capture shows them; poses and the sphere's known size
do, in part.  What these leave open stays in the covariance.  At a workpiece they largely cancel against what they
did to the tool, since both were seen at about the same distance.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.observations import SphereObservation
from calib_core.frames import FloatArray
from calib_core.sphere.circle import circle_step

NAMES = ("radius_mm", "scale_x", "scale_z", "shear", "bow", "incidence_1_mm", "incidence_2_mm", "incidence_4_mm")
"""In the order of the unknowns; the first is the sphere's, the others are the scanner's."""

COUNT = len(NAMES)
OF_FILES = np.array([False, True, True, True, True, False, False, False])
"""Which of them move the points of the scanner's files; the others are about the sphere and how it is lit."""


@dataclass(frozen=True)
class ScannerPriors:
    """Standard deviations of what is believed of a scanner before any capture.

    Attributes
    ----------
    scale, shear : float
        Of x and z each; of x by z.
    bow : float
        Sag of z over the seen width, as a share of half that width.
    incidence_mm : float
        Of each of three shapes (sin², sin⁴ and sin⁸ of the angle between light and surface normal).
    """

    scale: float = 0.005
    shear: float = 0.01
    bow: float = 0.001
    incidence_mm: float = 0.02

    def sigmas(self, radius_sigma_mm: float) -> FloatArray:
        """Return the standard deviations (8,) of all nuisances."""
        return np.array([radius_sigma_mm, self.scale, self.scale, self.shear, self.bow, *[self.incidence_mm] * 3])


def nothing_believed(radius_sigma_mm: float) -> FloatArray:
    """Return sigmas (8,) of a scanner that is taken as exact."""
    return np.array([radius_sigma_mm, *[0.0] * (COUNT - 1)])


def incidence_shapes(cosine: FloatArray) -> FloatArray:
    """Return the three shapes (N, 3) of the error along the normal, by the cosine of the angle of incidence."""
    square = np.clip(1 - cosine**2, 0.0, 1.0)
    return np.column_stack([square - 0.3, square**2 - 0.15, square**4 - 0.05])


def displacements(points: FloatArray, bow_mm: FloatArray) -> FloatArray:
    """Return how points (N, 3) move with scale x, scale z, shear and bow (`bow_of`), (N, 3, 4)."""
    moved = np.zeros((len(points), 3, 4))
    moved[:, 0, 0], moved[:, 2, 1] = points[:, 0], points[:, 2]
    moved[:, 0, 2], moved[:, 2, 3] = points[:, 2], bow_mm
    return moved


def bow_of(points: FloatArray, half_width_mm: float) -> FloatArray:
    """Return what a bow of one moves points (N, 3) along z, (N,), mm."""
    return points[:, 0] ** 2 / max(half_width_mm, 1e-9)


def corrected(observation: SphereObservation, values: FloatArray, half_width_mm: float) -> SphereObservation:
    """Return an observation as a scanner without the errors `values` (8,) would have made it."""
    if not values[OF_FILES].any():
        return observation
    change = values[OF_FILES]
    points = observation.points_in_laser_mm
    if len(points):
        points = points + displacements(points, bow_of(points, half_width_mm)) @ change
    center = observation.center_in_laser_mm
    moved = replace(
        observation,
        points_in_laser_mm=points,
        center_in_laser_mm=center + (displacements(center[None], bow_of(center[None], half_width_mm)) @ change)[0],
    )
    if observation.circle_radius_mm is None or not len(points):
        return moved
    circle = np.array([center[0], center[2], observation.circle_radius_mm])
    x, z, radius = circle_step(points[:, [0, 2]], circle).parameters
    return replace(moved, center_in_laser_mm=np.array([x, 0.0, z]), circle_radius_mm=float(radius))


def with_true_incidence(observation: SphereObservation, values: FloatArray, radius_mm: float) -> SphereObservation:
    """Return a profile whose circle (x, z, r) is that of points without the error by incidence (`values`, 8)."""
    shapes = values[5:]
    own = observation.circle_radius_mm
    if own is None or not shapes.any() or not len(observation.points_in_laser_mm):
        return observation
    center = observation.center_in_laser_mm[[0, 2]]
    offsets = observation.points_in_laser_mm[:, [0, 2]] - center
    cosine = np.sqrt(np.maximum(1 - (offsets[:, 0] / own) ** 2, 0.0)) * own / radius_mm
    # A distance to the sphere is r/R of the one in the plane of light.
    outside = incidence_shapes(cosine) @ shapes * radius_mm / own
    distance = np.linalg.norm(offsets, axis=1)
    points = center + offsets * (1 - outside / distance)[:, None]
    x, z, radius = circle_step(points, np.array([*center, own])).parameters
    return replace(observation, center_in_laser_mm=np.array([x, 0.0, z]), circle_radius_mm=float(radius))
