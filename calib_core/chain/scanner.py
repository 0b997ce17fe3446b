"""What a scanner does wrong, as unknowns with priors: scales, shear, bow, and error by the angle of incidence.

They are common to all captures, so that no residual of one capture shows them; poses and the sphere's known size
do, in part.  What these leave open stays in the covariance.  At a workpiece they largely cancel against what they
did to the tool, since both were seen at about the same distance.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation
from calib_core.frames import FloatArray
from calib_core.sphere.circle import circle_step, circle_steps

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
    return replace(moved, center_in_laser_mm=np.array([x, center[1], z]), circle_radius_mm=float(radius))


def _times(moves: FloatArray, change: FloatArray) -> FloatArray:
    return np.einsum("nij,nj->ni", moves, change)


def spheres_seen(
    observations: Observations, values: FloatArray, half_width_mm: float, radii_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the centres (K, 3) and circles' radii (K,), NaN where none, that a right scanner had measured.

    As `corrected` makes them, and without what the error by incidence does to a profile's circle; `values` (K, 8).
    """
    centers = np.array([o.center_in_laser_mm for o in observations]).reshape(-1, 3)
    radii = np.array([o.circle_radius_mm or np.nan for o in observations], dtype=float)
    arcs = [o.points_in_laser_mm[:, [0, 2]] for o in observations]
    has_arc = np.isfinite(radii) & np.array([len(arc) > 0 for arc in arcs], dtype=bool)
    change, shapes = values[:, OF_FILES], values[:, 5:]
    moved = centers + _times(displacements(centers, bow_of(centers, half_width_mm)), change)
    if not has_arc.any() or not values[:, 1:].any():
        return moved, radii
    arcs = [arc for arc, has in zip(arcs, has_arc, strict=True) if has]
    offsets = np.concatenate([[0], np.cumsum([len(arc) for arc in arcs])])
    points, each = np.concatenate(arcs), np.repeat(np.flatnonzero(has_arc), [len(arc) for arc in arcs])
    circles = np.column_stack([centers[:, [0, 2]], radii])[has_arc]
    if change.any():
        in_space = np.column_stack([points[:, 0], np.zeros(len(points)), points[:, 1]])
        moves = displacements(in_space, bow_of(in_space, half_width_mm))
        points = points + _times(moves, change[each])[:, [0, 2]]
        circles = circle_steps(points, offsets, circles)
    if shapes.any():
        own = np.repeat(circles, np.diff(offsets), axis=0)
        apart, radius = points - own[:, :2], own[:, 2]
        radii_there = radii_mm[each]
        cosine = np.sqrt(np.maximum(1 - (apart[:, 0] / radius) ** 2, 0.0)) * radius / radii_there
        # A distance to the sphere is r/R of the one in the plane of light.
        outside = np.einsum("ij,ij->i", incidence_shapes(cosine), shapes[each]) * radii_there / radius
        distance = np.hypot(apart[:, 0], apart[:, 1])
        points = own[:, :2] + apart * (1 - outside / distance)[:, None]
        circles = circle_steps(points, offsets, circles)
    moved[has_arc] = np.column_stack([circles[:, 0], moved[has_arc, 1], circles[:, 1]])
    radii[has_arc] = circles[:, 2]
    return moved, radii
