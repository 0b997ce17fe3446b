"""What errors of robot and axes do to where each capture's scanner sees its ball.

Each pose errs by itself, and so does each reading of an axis; captures at one stop of the robot share both.  The
arm's lengths, a drift and errors that are alike where poses are act on many captures.
"""

from dataclasses import dataclass

import numpy as np

from calib_core.arms.alike import alike_factor
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.model import ChainState, prediction
from calib_core.frames import FloatArray

_LEAST_SIGMA_MM = 1e-4  # keeps the prior of a capture's own centre invertible


@dataclass(frozen=True, eq=False)
class Noise:
    """What the errors of robot and table do to each capture's centre in L.

    Attributes
    ----------
    spread : (K, 3, 3)
        Covariance by what is each capture's own, mm².
    shared : (K, 3, L)
        How it moves with one standard deviation of each error that captures share, mm.
    """

    spread: FloatArray
    shared: FloatArray

    @property
    def precision(self) -> FloatArray:
        """The spread's inverse, (K, 3, 3)."""
        return np.asarray(np.linalg.inv(self.spread), dtype=float)


def noise_of(data: ChainData, state: ChainState, sigmas: Sigmas) -> Noise:
    """Return what errors of robot and table do to each capture's centre, as a state sees it."""
    levers = prediction(data, state).levers if data.walk.layout.axes else None
    factor = np.empty((data.count, 0))
    if sigmas.is_alike:
        factor = alike_factor(*data.walk.poses, sigmas.reach)
    middle = data.walk.translations.mean(axis=0)
    return NoiseShapes.at(data, state.centers_in_laser, state, levers, middle).noise(sigmas, factor)


@dataclass(frozen=True, eq=False)
class NoiseShapes:
    """What errors of robot and table of unit size do to each capture's centre: many sigmas are tried at one state.

    Attributes
    ----------
    moving, turning, axes : (K, 3, 3), (K, 3, 3), (A, K, 3)
        Covariance by a position's error and by an orientation's about any axis; the way by each axis's reading.
    stops : (K, c)
        1 where a capture is of a stop of the robot that several share, whose errors are theirs together.
    playing : (K, 1, 1)
        1 where the robot is not on the way to the ball: what carries it has play.
    scale : (K, 1, 1)
        By how much a capture's own pose variance is larger.
    moves : (K, 3, 6)
        By a shift of the flange along base's axes, and by its turn about them.
    drawn : (K, 3, c)
        By one standard deviation each of the arm's lengths and the drift.
    arm : (K, 3, p)
        The same of the arm's own terms.
    """

    moving: FloatArray
    turning: FloatArray
    axes: FloatArray
    playing: FloatArray
    scale: FloatArray
    stops: FloatArray
    moves: FloatArray
    drawn: FloatArray
    arm: FloatArray

    @classmethod
    def at(
        cls,
        data: ChainData,
        centers_in_laser: FloatArray,
        state: ChainState,
        levers: FloatArray | None,
        middle: FloatArray,
    ) -> "NoiseShapes":
        """Return those of captures whose spheres are seen at (K, 3), by a state's tool."""
        walk = data.walk
        laser_from_base = walk.laser_from_base(state.position)
        drawn = [np.empty((data.count, 3, 0))]
        if data.arm_scale_sigma > 0:
            from_middle = walk.translations - middle
            drawn.append(laser_from_base @ from_middle[:, :, None] * data.arm_scale_sigma)
        if data.drift_sigma_mm > 0:
            drawn.append(laser_from_base * (data.order * data.drift_sigma_mm)[:, None, None])
        arms, untold = data.levers(state.position, centers_in_laser)
        by_axis = np.empty((0, data.count, 3)) if levers is None else np.moveaxis(levers, 2, 0)
        return cls(
            moving=np.abs(walk.over_robot)[:, None, None] * np.eye(3),
            turning=_turning(arms[:, :, None] * arms[:, None, :] + untold),
            axes=by_axis,
            playing=(walk.over_robot == 0)[:, None, None].astype(float),
            scale=data.pose_scale[:, None, None],
            stops=(data.stop[:, None] == np.arange(data.stops)).astype(float),
            moves=walk.moves(laser_from_base, arms),
            drawn=np.concatenate(drawn, axis=2),
            arm=np.empty((data.count, 3, 0)) if data.arm_columns is None else data.arm_columns,
        )

    def noise(self, sigmas: Sigmas, factor: FloatArray) -> Noise:
        """Return the noise of some sigmas, with a factor (K, m) of the alike part."""
        spread = self._by_pose(sigmas.position_mm, sigmas.orientation_rad)
        for sigma, axis in zip(sigmas.axes, self.axes, strict=False):
            spread += sigma**2 * axis[:, :, None] * axis[:, None, :]
        spread *= self.scale
        together, left = [self.drawn], np.zeros(len(spread))
        if sigmas.is_alike:
            left = np.maximum(1 - np.sum(factor**2, axis=1), 0.0)
            alike = sigmas.alike_position_mm, sigmas.alike_orientation_rad
            spread += left[:, None, None] * self._by_pose(*alike)
            together.append(self._drawn(np.repeat([alike], len(left), axis=0), factor))
        if self.stops.size:
            spread[self.stops.any(axis=1)] = _LEAST_SIGMA_MM**2 * np.eye(3)
            together.append(self._at_stops(sigmas, left[:, None]))
        spread += sigmas.play_mm**2 * self.scale * self.playing * np.eye(3)
        return Noise(spread, np.concatenate([*together, self.arm], axis=2))

    def _at_stops(self, sigmas: Sigmas, left: FloatArray) -> FloatArray:
        """Return how captures move by one standard deviation of what errs at their stops: poses, then axes."""
        own = np.array([sigmas.position_mm, sigmas.orientation_rad])
        alike = np.array([sigmas.alike_position_mm, sigmas.alike_orientation_rad])
        scale = self.scale[:, :, 0]
        moved = [self._drawn(np.sqrt(scale * own**2 + left * alike**2), self.stops)]
        for sigma, axis in zip(sigmas.axes, self.axes, strict=False):
            moved.append(sigma * (np.sqrt(scale) * axis)[:, :, None] * self.stops[:, None, :])
        return np.concatenate(moved, axis=2)

    def mean_square(self, sigmas: Sigmas) -> float:
        """Return the mean square, mm², of what poses' own errors and those that are alike do to captures."""
        own = self._by_pose(sigmas.position_mm, sigmas.orientation_rad)
        alike = self._by_pose(sigmas.alike_position_mm, sigmas.alike_orientation_rad)
        return float(np.trace(own + alike, axis1=1, axis2=2).mean())

    def _drawn(self, sizes: FloatArray, factor: FloatArray) -> FloatArray:
        """Return how captures move by errors that they have by a factor (K, m), (K, 3, 6 m).

        `sizes` (K, 2) are these errors' standard deviations in position and orientation.
        """
        moves = self.moves * np.repeat(sizes, 3, axis=1)[:, None]
        return (moves[:, :, None, :] * factor[:, None, :, None]).reshape(len(moves), 3, -1)

    def _by_pose(self, position_mm: float, orientation_rad: float) -> FloatArray:
        return _spread(self.moving, position_mm) + orientation_rad**2 * self.turning


def _turning(squared: FloatArray) -> FloatArray:
    """Return the covariance (K, 3, 3) of the ends of levers by turns of unit variance, by their squares l lᵀ."""
    return np.trace(squared, axis1=1, axis2=2)[:, None, None] * np.eye(3) - squared


def _spread(moving: FloatArray, position_mm: float) -> FloatArray:
    return np.maximum(position_mm**2 * moving, _LEAST_SIGMA_MM**2 * np.eye(3))


def pose_spread(levers: FloatArray, sigmas: Sigmas) -> FloatArray:
    """Return the covariance (K, 3, 3), mm², of the sphere's centre in L by random errors of the robot.

    A position error moves it by itself; an orientation error ω about the flange by ω × p, with p the lever from
    the flange to the centre.

    Parameters
    ----------
    levers : (K, 3)
        From the flange to the sphere's centre, in L, mm.
    sigmas : Sigmas
    """
    moved = _spread(np.broadcast_to(np.eye(3), (len(levers), 3, 3)), sigmas.position_mm)
    return moved + sigmas.orientation_rad**2 * _turning(levers[:, :, None] * levers[:, None, :])
