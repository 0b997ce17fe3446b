"""What a scanner's own errors put into held-out captures together, beside what the tool has swallowed of them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib_core.chain.observations import SphereObservation
from calib_core.chain.scanner import COUNT, NAMES, spheres_seen
from calib_core.frames import FloatArray
from calib_core.records.results import ScannerFound

_STEP = 1e-4  # of a scale; mm of what errs by incidence


@dataclass(frozen=True, eq=False)
class ScannerScatter:
    """A scanner's errors: as the calibration saw the sphere, so does the verification, and they mostly cancel.

    Attributes
    ----------
    kinds : (n,) int
        Which of `chain.scanner.NAMES`; the sphere's radius is none of them.
    covariance, with_tool : (n, n), (6, n)
        Of what is found of them less what is true, and with the tool's error.
    half_width_mm : float
        In which a bow is measured.
    columns : (n,) int
        Where they are among all that the result has of the scanner.
    """

    kinds: np.ndarray
    covariance: FloatArray
    with_tool: FloatArray
    half_width_mm: float
    columns: np.ndarray

    @classmethod
    def of(cls, found: ScannerFound) -> "ScannerScatter":
        """Return what a result tells of a scanner."""
        columns = np.array([n for n, name in enumerate(found.names) if name != NAMES[0]], dtype=int)
        kinds = np.array([NAMES.index(found.names[n]) for n in columns], dtype=int)
        covariance = np.array(found.covariance).reshape(len(found.names), -1)
        with_tool = np.array(found.covariance_with_tool).reshape(6, -1)
        return cls(
            kinds, covariance[np.ix_(columns, columns)], with_tool[:, columns], found.half_width_mm or 1.0, columns
        )

    def moved(self, seen: Sequence[SphereObservation], radii_mm: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how K captures' figures, and the centres that they see, follow the errors, (3K, n) each."""
        figures, centers = [], []
        still = spheres_seen(seen, np.zeros((len(seen), COUNT)), self.half_width_mm, radii_mm)
        for kind in self.kinds:
            values = np.zeros((len(seen), COUNT))
            values[:, kind] = _STEP
            center, circle = spheres_seen(seen, values, self.half_width_mm, radii_mm)
            by_center, by_circle = (center - still[0]) / _STEP, (circle - still[1]) / _STEP
            flat = np.isfinite(by_circle)
            of_profile = np.column_stack([by_center[:, 0], by_center[:, 2], by_circle])
            figures.append(np.where(flat[:, None], of_profile, by_center).ravel())
            centers.append(by_center.ravel())
        shape = len(self.kinds), 3 * len(seen)
        return np.reshape(figures, shape).T, np.reshape(centers, shape).T
