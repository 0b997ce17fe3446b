"""The simulated cell as it lives: its robot goes from capture to capture, its table turns, its scanner sees.

Nothing here keeps time: whoever serves it asks for a moment.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.simulation.motion import FloatArray, pose, quaternion_wxyz, turn
from calib_core.simulation.profile_cell import Shot, World, measure
from calib_core.simulation.session import SimulatedSession
from calib_core.simulation.writing import profile_csv


@dataclass(frozen=True, eq=False)
class Moment:
    """The cell at one moment.

    Parameters
    ----------
    shot : Shot
        Where the robot stands, or goes.
    reported, actual : (4, 4)
        base_from_tool0 as the controller tells it, and as it is.
    sphere_center_in_base_mm : (3,)
    table_deg : float
        As the encoder tells it.
    moving, turning : bool
        Whether anything moves, and whether the table does.
    """

    shot: Shot
    reported: FloatArray
    actual: FloatArray
    sphere_center_in_base_mm: FloatArray
    table_deg: float
    moving: bool
    turning: bool = False


class LiveCell:
    """A simulated cell whose robot travels between the poses of its captures.

    Parameters
    ----------
    simulated : SimulatedSession
        Of profiles of the sphere.
    travel_s : float
        From one pose to the next.
    """

    def __init__(self, simulated: SimulatedSession, travel_s: float = 0.5) -> None:
        assert simulated.world is not None
        self.world: World = simulated.world
        self._travel_s = travel_s
        self._from = self._to = self._standing(self.world.shots[0])
        self._began_s = -np.inf
        self._shaken: tuple[float, float, int] | None = None

    @property
    def shots(self) -> tuple[Shot, ...]:
        """The captures whose poses the robot can go to."""
        return self.world.shots

    def go(self, number: int, now_s: float) -> None:
        """Send robot and table to where a capture is taken, from where they are."""
        self._from = self.at(now_s)
        self._to = self._standing(self.world.shots[number])
        self._began_s = now_s

    def shake(self, mm: float, period_s: float, across: bool = False) -> None:
        """Move back and forth from now on, the orientation held: along the stripe, or across it as a scan does."""
        self._shaken = mm, period_s, 1 if across else 0

    def rest(self) -> None:
        """Move back and forth no longer."""
        self._shaken = None

    def at(self, now_s: float) -> Moment:
        """Return the cell at a moment: on its way, slow at both ends, or there."""
        part = float(np.clip((now_s - self._began_s) / self._travel_s, 0.0, 1.0))
        if part >= 1.0:
            return self._to if self._shaken is None else self._moved_along(now_s, *self._shaken)
        eased = part * part * (3 - 2 * part)
        lift = np.array([0.0, 0.0, 8.0 * eased * (1 - eased)])  # never along a straight line of what it sees
        return Moment(
            shot=self._to.shot,
            reported=_between(self._from.reported, self._to.reported, eased, lift),
            actual=_between(self._from.actual, self._to.actual, eased, lift),
            sphere_center_in_base_mm=(1 - eased) * self._from.sphere_center_in_base_mm
            + eased * self._to.sphere_center_in_base_mm,
            table_deg=(1 - eased) * self._from.table_deg + eased * self._to.table_deg,
            moving=True,
            turning=self._from.table_deg != self._to.table_deg,
        )

    def profile(self, now_s: float, rng: np.random.Generator) -> bytes:
        """Return what the scanner sees at a moment, as its CSV."""
        return profile_csv(self._measure(self.at(now_s), rng)[2], 1.0)

    def points(self, now_s: float, rng: np.random.Generator) -> FloatArray:
        """Return where the stripe lies on the sphere at a moment, (N, 3) in L: what a raw camera looks at."""
        return self._measure(self.at(now_s), rng)[1]

    def _measure(self, moment: Moment, rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray]:
        kind = self.world.options.kinds[0]
        return measure(kind, self.world, moment.actual, moment.sphere_center_in_base_mm, rng)

    def _moved_along(self, now_s: float, mm: float, period_s: float, axis: int) -> Moment:
        along = (self._to.actual @ self.world.tool0_from_laser)[:3, axis]
        by = mm * np.sin(2 * np.pi * now_s / period_s) * along

        def moved(matrix: FloatArray) -> FloatArray:
            return pose(matrix[:3, :3], matrix[:3, 3] + by)

        return replace(self._to, reported=moved(self._to.reported), actual=moved(self._to.actual), moving=True)

    def _standing(self, shot: Shot) -> Moment:
        table_deg = shot.table.reported_angle if shot.table else 0.0
        return Moment(shot, shot.reported, shot.actual, shot.sphere_center_in_base_mm, table_deg, False)


def _between(one: FloatArray, other: FloatArray, part: float, lift_mm: FloatArray) -> FloatArray:
    """Return a pose between two, by their quaternions' chord."""
    first, last = quaternion_wxyz(one[:3, :3]), quaternion_wxyz(other[:3, :3])
    last = last if first @ last >= 0 else -last
    w, *v = (1 - part) * first + part * last
    axis = np.array(v)
    length = float(np.linalg.norm(axis))
    rotation = turn(2 * np.arctan2(length, w) / length * axis) if length > 0 else np.eye(3)
    return pose(rotation, (1 - part) * one[:3, 3] + part * other[:3, 3] + lift_mm)
