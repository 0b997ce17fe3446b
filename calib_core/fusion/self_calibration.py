"""What the scans' overlap says of the tool and the table that they share, where it says more than captures did.

The errors of tool and table move all scans together, each by its own pose and angle: what is wrong along the light
makes a ball larger or smaller when it is scanned from all around, and scans from different sides, which see the
same surface obliquely, lie apart by it.  A fine registration (see `register`) gives each scan's move m with its
covariance S; with m = C z + o, where z are the shared errors in units of their sigmas and o the scans' own,
and P = C Cᵀ + O what the calibration says of m,

    E[z] = Cᵀ P⁻¹ m,    cov z = 1 − Cᵀ P⁻¹ C + Cᵀ P⁻¹ S P⁻¹ C

Only directions of z that are known several times better afterwards are moved.  In the others the surfaces slide on
each other, and the noise of their normals, which the registration takes for exact, would be believed.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.frames import FloatArray, vector_from_rotation
from calib_core.fusion.overlap import PoseErrors, transforms_of_moves
from calib_core.fusion.register import Registration, covariance_of_moves

LARGEST_VARIANCE = 0.05
"""Of a direction that is moved, beside 1 before: known 4.5 times better by the overlap."""

CAUTION = 5.0
"""What the variance of a moved direction is stated larger by.

On simulated parts with edges and few scans the mean squared error was 4.6 times what the registration says of
itself, on a ball 1.1 times.
"""


@dataclass(frozen=True, eq=False)
class SelfCalibration:
    """A change of the shared errors, in units of their standard deviations.

    Parameters
    ----------
    shift : (D,)
        To be added to the calibration, as the columns of `PoseErrors.common` count.
    covariance : (D, D)
        After it; the identity before.
    directions : int
        How many directions the overlap determined.
    turntable_from_scan : (S, 4, 4)
        To be applied to each scan's points in T.
    errors : PoseErrors
        What is left uncertain of each scan's place.
    """

    shift: FloatArray
    covariance: FloatArray
    directions: int
    turntable_from_scan: FloatArray
    errors: PoseErrors


def self_calibration(registration: Registration, errors: PoseErrors) -> SelfCalibration:
    """Return what a registration of scans says of the errors that they share.

    Parameters
    ----------
    registration : Registration
        Made with these errors.
    errors : PoseErrors
    """
    origin = np.zeros(3)
    ways = registration.turntable_from_scan
    moves = np.array([[*vector_from_rotation(way[:3, :3]), *way[:3, 3]] for way in ways])
    common = errors.common.reshape(moves.size, -1)
    gain = np.linalg.lstsq(covariance_of_moves(errors, origin), common, rcond=None)[0].T
    left = gain @ covariance_of_moves(registration.errors, origin) @ gain.T
    covariance = np.eye(common.shape[1]) - gain @ common + left
    values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
    known = vectors[:, values < LARGEST_VARIANCE].astype(float)
    shift: FloatArray = (known @ (known.T @ (gain @ moves.ravel()))).astype(float)
    left_over = CAUTION * values[values < LARGEST_VARIANCE]
    after = np.eye(len(shift)) - known @ known.T + (known * left_over) @ known.T
    root = np.linalg.cholesky(after + 1e-12 * np.eye(len(after)))
    return SelfCalibration(
        shift,
        after,
        known.shape[1],
        transforms_of_moves(errors.common @ shift, origin),
        PoseErrors(errors.common @ root, errors.own),
    )
