"""Machines that turn about few axes, or none: where on its flange a scanner is remains open along some directions.

A scanner that is shifted along a direction that no pose of the robot turns sees the same, if the ball is shifted
with it.  Such a shift is no unknown: one component of the scanner's place for each such direction is held at
zero, and all else is solved beside it.  A machine that moves along one line leaves open a rotation, too: about its
travel, of scanner and ball and all that stands before it; one component of the scanner's rotation is held then.
What is given of results leaves out what follows either.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.chain.chain_data import ChainData
from calib_core.chain.start import Start
from calib_core.frames import FloatArray, rotation_from_vector, skew

_ALIKE_RAD = 1e-3
_INVOLVED = 1e-3
_ON_LINE_MM = 0.1
_HELD_MM2, _HELD_RAD2 = 1e-8, 1e-10


@dataclass(frozen=True, eq=False)
class OpenShifts:
    """Directions along which the scanner's place on what carries it is open.

    Attributes
    ----------
    directions : (m, 3)
        Unit vectors in the frame of what carries the scanner.
    turned : (3, 3)
        From there into what carries the ball.
    travel : (3,) or None
        Along the one line on which poses lie, in the frame of what carries the scanner, where nothing turns.
    through : (3,)
        A point of that line, in the frame of what carries the ball.
    like : (3, 3)
        The rotation of the scanner that others are turned about the line to be near to.
    """

    directions: FloatArray
    turned: FloatArray
    travel: FloatArray | None = None
    through: FloatArray = field(default_factory=lambda: np.zeros(3))
    like: FloatArray = field(default_factory=lambda: np.eye(3))

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

    def held_at(self, start: Start) -> "OpenShifts":
        """Return the same by which rotations are held near to that of a start."""
        return replace(self, like=start.rotation)

    def start_at_zero(self, start: Start) -> Start:
        """Return a start shifted so that what is held is zero."""
        if not len(self.directions):
            return start
        some = self.components
        along = np.linalg.solve(self.directions[:, some].T, -start.translation[some])
        shift = along @ self.directions
        start = replace(start, translation=start.translation + shift, center=start.center + self.turned @ shift)
        if self.travel is None:
            return start
        across, off = skew(self.travel), start.rotation @ self.like.T
        angle = np.arctan2(np.trace(across @ off), -np.trace(across @ across @ off))
        turn = rotation_from_vector(angle * self.travel)
        beside = start.center - self.through
        center = self.through + self.turned @ turn @ self.turned.T @ beside
        return replace(start, rotation=turn @ start.rotation, center=center)

    def holding(self, data: ChainData) -> ChainData:
        """Return captures with what is held no unknown; its covariance says that it is exact."""
        about = None if self.travel is None else self.like.T @ self.travel
        columns = [] if about is None else [int(np.argmax(np.abs(about)))]
        columns += [3 + component for component in self.components]
        held = data.holding(columns)
        return replace(held, exact=tuple(columns), untold=self.directions) if columns else data


def open_shifts(data: ChainData) -> OpenShifts:
    """Return the directions that no pose of captures turns."""
    rotations, translations = data.walk.across_robot(as_recorded=True)
    turned = rotations.mean(axis=0)
    spread = (rotations - turned).reshape(-1, 3)
    values, vectors = np.linalg.eigh(spread.T @ spread / data.count)
    still = vectors.T[values < _ALIKE_RAD**2]
    directions = np.eye(3) if len(still) == 3 else still if len(still) == 1 else np.zeros((0, 3))
    u, _, vt = np.linalg.svd(turned)
    shifts, through = OpenShifts(directions, u @ vt), translations.mean(axis=0)
    off = translations - through
    values, vectors = np.linalg.eigh(off.T @ off / data.count)
    on_axes = any(axis.carries == "robot" for axis in data.walk.layout.axes)
    if on_axes or len(still) < 3 or not values[1] < _ON_LINE_MM**2 < values[2]:
        return shifts
    return replace(shifts, travel=shifts.turned.T @ vectors[:, 2], through=through)


def without_exact(data: ChainData, covariance: FloatArray) -> FloatArray:
    """Return a covariance in which what is held says nothing."""
    if not data.exact:
        return covariance
    some, found = list(data.exact), covariance.copy()
    found[some], found[:, some] = 0.0, 0.0
    found[some, some] = [_HELD_RAD2 if column < 3 else _HELD_MM2 for column in some]
    return found
