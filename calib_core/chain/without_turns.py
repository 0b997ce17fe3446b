"""Machines that turn about few axes, or none: where on its flange a scanner is remains open along some directions.

A scanner that is shifted along a direction that no pose of the robot turns sees the same, if the ball is shifted
with it.  Such a shift is no unknown: one component of the scanner's place for each such direction is held at
zero, and all else is solved beside it.  What is given of results leaves out what follows it.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.model import ChainData
from calib_core.chain.start import Start
from calib_core.frames import FloatArray

_ALIKE_RAD = 1e-3
_INVOLVED = 1e-3
_HELD_MM2 = 1e-8


@dataclass(frozen=True, eq=False)
class OpenShifts:
    """Directions along which the scanner's place on what carries it is open.

    Attributes
    ----------
    directions : (m, 3)
        Unit vectors in the frame of what carries the scanner.
    turned : (3, 3)
        From there into what carries the ball.
    """

    directions: FloatArray
    turned: FloatArray

    @property
    def components(self) -> list[int]:
        """Which components of the place are held, one for each direction."""
        return [0, 1, 2] if len(self.directions) == 3 else [int(np.argmax(np.abs(v))) for v in self.directions]

    @property
    def of_mount(self) -> np.ndarray:
        """Which components of the scanner's place are not determined, (3,) bool."""
        return np.any(np.abs(self.directions) > _INVOLVED, axis=0)

    @property
    def of_ball(self) -> np.ndarray:
        """Which components of places of balls and axes are not determined, (3,) bool."""
        return np.any(np.abs(self.directions @ self.turned.T) > _INVOLVED, axis=0)

    def start_at_zero(self, start: Start) -> Start:
        """Return a start shifted so that what is held is zero."""
        if not len(self.directions):
            return start
        some = self.components
        along = np.linalg.solve(self.directions[:, some].T, -start.translation[some])
        shift = along @ self.directions
        return replace(start, translation=start.translation + shift, center=start.center + self.turned @ shift)

    def holding(self, data: ChainData) -> ChainData:
        """Return captures with what is held no unknown; its covariance says that it is exact."""
        columns = [3 + component for component in self.components]
        return replace(data.holding(columns), exact=tuple(columns)) if columns else data


def open_shifts(data: ChainData) -> OpenShifts:
    """Return the directions that no pose of captures turns."""
    turned = data.rotations.mean(axis=0)
    spread = (data.rotations - turned).reshape(-1, 3)
    values, vectors = np.linalg.eigh(spread.T @ spread / data.count)
    still = vectors.T[values < _ALIKE_RAD**2]
    directions = np.eye(3) if len(still) == 3 else still if len(still) == 1 else np.zeros((0, 3))
    u, _, vt = np.linalg.svd(turned)
    return OpenShifts(directions, u @ vt)


def without_exact(data: ChainData, covariance: FloatArray) -> FloatArray:
    """Return a covariance in which what is held says nothing."""
    if not data.exact:
        return covariance
    some, found = list(data.exact), covariance.copy()
    found[some], found[:, some] = 0.0, 0.0
    found[some, some] = _HELD_MM2
    return found
