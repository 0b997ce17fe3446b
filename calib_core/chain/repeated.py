"""Poses that were taken again after the arm had been elsewhere: what shows a lag or play that nothing else shows.

A lag that is always in one direction of the flange is the tool's own shift to every single capture.  Where the arm
comes back to a pose from another side, the sphere appears beside where it was.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.chain.observations import Observations, SphereObservation
from calib_core.frames import stack_matrices

_SAME_MM, _SAME_RAD = 0.1, 2e-4  # as controllers report one pose twice
_MIDDLES = 3.0  # standard deviations of a fitted centre


@dataclass(frozen=True)
class Repeat:
    """Two captures of one pose, the arm having been elsewhere between them, and how far apart they see the sphere.

    `sigma_mm` is what the fits of the two captures leave open.
    """

    first: str
    again: str
    shift_mm: float
    sigma_mm: float

    @property
    def is_shift(self) -> bool:
        """Whether the two differ by more than their fits."""
        return self.shift_mm > _MIDDLES * self.sigma_mm


def repeats(observations: Observations) -> list[Repeat]:
    """Return each capture of a pose that was taken before, beside the first one of that pose.

    Parameters
    ----------
    observations : K captures of the still sphere, in the order in which they were taken
        Of a profile the circle's centre counts: what moves along y shows in its radius alone.
    """
    matrices = stack_matrices([o.base_from_tool0 for o in observations])
    found: list[Repeat] = []
    for k in range(1, len(observations)):
        apart = matrices[:k] - matrices[k]
        turned_rad = np.linalg.norm(apart[:, :3, :3], axis=(1, 2)) / np.sqrt(2)  # of small angles
        same = (np.linalg.norm(apart[:, :3, 3], axis=1) < _SAME_MM) & (turned_rad < _SAME_RAD)
        if same.any() and not same[(first := int(np.argmax(same))) :].all():
            found.append(_compared(observations[first], observations[k]))
    return found


def _compared(one: SphereObservation, other: SphereObservation) -> Repeat:
    seen = [0, 2] if one.kind == "profile" else [0, 1, 2]
    shift = (other.center_in_laser_mm - one.center_in_laser_mm)[seen]
    rows = [0, 1] if one.kind == "profile" else [0, 1, 2]  # a profile's covariance is of x, z and the radius
    covariance = one.center_covariance[np.ix_(rows, rows)] * one.points_per_independent
    covariance = covariance + other.center_covariance[np.ix_(rows, rows)] * other.points_per_independent
    sigma_mm = float(np.sqrt(np.trace(covariance)))
    return Repeat(one.capture, other.capture, float(np.linalg.norm(shift)), sigma_mm)
