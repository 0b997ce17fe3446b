"""Whether scanner and sphere stood still between several exposures at one commanded pose."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.estimation import chance_of
from calib_core.frames import FloatArray
from calib_core.sphere.arc import ArcFit

LEAST_CHANCE = 1e-3
"""Exposures that noise alone would scatter as much in fewer cases than this have moved."""

_NUMBERS_OF_AN_ARC = 3


@dataclass(frozen=True)
class Standstill:
    """How much the arc of the sphere moved between exposures at one commanded pose.

    Attributes
    ----------
    exposures : int
        That were compared; those of several poses each with those of their own pose.
    movement_mm : float
        Root mean square of what is beyond noise in the arc's centre (x and z of L) and radius, about their means.
        A movement across the plane of light shows in the radius, by the share h/r of it where the plane passes
        the sphere's middle at h.
    noise_mm : float
        What the points' noise alone lets the same three scatter, root mean square.
    chance : float
        In which share of captures that stand still noise alone would scatter them as much.
    """

    exposures: int
    movement_mm: float
    noise_mm: float
    chance: float

    @property
    def stands_still(self) -> bool:
        """Whether noise explains what scatter there is."""
        return self.chance >= LEAST_CHANCE


def standstill(groups: Iterable[Sequence[ArcFit]]) -> Standstill | None:
    """Compare exposures of the sphere that were taken at one commanded pose.

    With p the centre's x, z and the radius, C their covariance and p̄ the mean weighted by C⁻¹ over one pose's n
    exposures, Σ (p − p̄)ᵀ C⁻¹ (p − p̄) is χ² of 3 (n − 1) degrees of freedom where nothing moves (Cochran's test of
    homogeneity).  The movement is the excess of the scatter over the noise, by moments: Σ |p − p̄|² / (n − 1) less
    the mean trace of C.

    Parameters
    ----------
    groups : iterable of sequences of ArcFit
        The exposures of each pose.

    Returns
    -------
    Standstill or None
        None where no pose has two exposures: then it cannot be told.
    """
    compared = [_compare(group) for group in groups if len(group) > 1]
    if not compared:
        return None
    exposures, squares, scatter, noise = (float(sum(column)) for column in zip(*compared, strict=True))
    freedom = exposures - len(compared)
    return Standstill(
        exposures=int(exposures),
        movement_mm=float(np.sqrt(max(0.0, scatter - noise) / freedom)),
        noise_mm=float(np.sqrt(noise / freedom)),
        chance=chance_of(squares, _NUMBERS_OF_AN_ARC * freedom),
    )


def _compare(fits: Sequence[ArcFit]) -> tuple[float, float, float, float]:
    """Return of one pose: exposures, χ², Σ |p − p̄|², and what noise alone lets that be."""
    arcs = np.array([[*fit.center_mm, fit.radius_mm] for fit in fits])
    covariances = np.array([_covariance(fit) for fit in fits])
    weights = np.linalg.inv(covariances)
    mean = np.linalg.solve(weights.sum(axis=0), np.einsum("nij,nj->i", weights, arcs))
    off = arcs - mean
    squares = float(np.einsum("ni,nij,nj->", off, weights, off))
    noise = float(np.trace(covariances, axis1=1, axis2=2).mean()) * (len(fits) - 1)
    return len(fits), squares, float(np.sum(off**2)), noise


def _covariance(fit: ArcFit) -> FloatArray:
    """Return an arc's covariance, enlarged where neighbouring points err alike (see `ArcFit.lag1_correlation`)."""
    return fit.covariance * fit.points_per_independent
