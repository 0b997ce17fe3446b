"""A scan with every point judged, and what is believed in judging."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SingleArray = NDArray[np.float32]

KEPT, BLANK, STRAY, MIXED, GRAZING = 0, 1, 2, 3, 4


@dataclass(frozen=True)
class CleanOptions:
    """What is believed.

    Parameters
    ----------
    stray_cut : float
        Distance to the neighbours' plane, in units of the noise (or of their own scatter where that is larger).
    fewest_neighbours : int
        Of the 24 in 5×5, how many must be near.
    grazing_deg : float
        Largest angle of incidence, from the surface's normal.
    workers : int
        Threads.
    """

    stray_cut: float = 5.0
    fewest_neighbours: int = 7
    grazing_deg: float = 78.0
    workers: int = 2


@dataclass(frozen=True, eq=False)
class CleanScan:
    """A scan in T, every point judged.

    Parameters
    ----------
    name : str
    points_in_turntable_mm : (P, C, 3) float32
        All points, kept or not.
    normals : (P, C, 3) float32
        Unit, toward the scanner, where `verdicts` is KEPT.
    verdicts : (P, C) uint8
        KEPT, or why not: BLANK, STRAY, MIXED, GRAZING.
    sigma_mm : (P, C) float32
        Of each kept point's place along the ray: the noise over the cosine of incidence, and the scan's own place.
    point_sigma_mm : float
        Of a point's distance to the surface, as the scan states it.
    reach_mm : float
        Points of adjacent rows or columns farther apart than this are not on one surface; 0 without a grid.
    intensity : (P, C) float32 or None
    """

    name: str
    points_in_turntable_mm: SingleArray
    normals: SingleArray
    verdicts: NDArray[np.uint8]
    sigma_mm: SingleArray
    point_sigma_mm: float
    reach_mm: float
    intensity: SingleArray | None = None

    def removed(self) -> dict[str, int]:
        """Return how many points were dropped, by reason; blanks do not count."""
        names = {"stray": STRAY, "mixed": MIXED, "grazing": GRAZING}
        return {name: int(np.count_nonzero(self.verdicts == verdict)) for name, verdict in names.items()}
