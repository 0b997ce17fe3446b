"""Whether poses and stripe tell of one world, without any clock: what moves must move for both."""

from collections import deque
from collections.abc import Callable

import numpy as np

from calib_core.captures.standstill import is_resting
from calib_core.cell.found import known_scanner, on_flange
from calib_core.frames import FloatArray
from calib_core.messages import message
from calib_core.records import Cell
from calib_core.sphere.arc import ArcFit
from calib_core.sphere.standstill import standstill
from server.live.departures import STRIPE_MOVED_MM, STRIPE_STOOD_MM, Departures, LateAngle
from server.live.exposures import Exposure
from server.live.standstill import Rest, Rules, is_new_place
from server.sources.device import Sample, host_now_s

_ROBOT_MOVED_MM, _JOINT_TURNED_DEG = 3.0, 0.5
_BALL_MOVED_MM = 8.0  # more than a tool is off by that was solved, less than a ball moves by with its table
_MOST_ARCS = 2000
_LATEST_S = 1.5  # a stripe without a clock that arrives later than so is not waited for
_ARRIVES_S = 0.2  # poses may arrive so much later than what the scanner saw, beside the time between two of them
_NOISE_MM = 0.1  # at most between two arcs of a stripe that stood
_WHILE_S = 0.35  # so long something else was in the light than the sphere
_FEWEST_POINTS = 20  # of something: a laser that was switched off shows none


class Agreement:
    """Remembers since when robot and table stand, and what the stripe did meanwhile.

    Parameters
    ----------
    rules : Rules
        What counts as one pose, and how long before its arrival an exposure may have been made.
    unwatched_s : callable, optional
        For how long at a stretch nobody looked within an interval, or what arrived in it was stamped too late.
    """

    def __init__(self, rules: Rules, unwatched_s: Callable[[float, float], float] = lambda _, __: 0.0) -> None:
        self._rules, self._unwatched_s = rules, unwatched_s
        self.late_angle = LateAngle(rules.latency_s)
        self.departures = Departures(rules.latency_s)
        self.forget(is_remounted=True)

    def forget(self, *, is_remounted: bool) -> None:
        """Begin anew: a device was lost, or the sphere may have been moved by hand."""
        if is_remounted:
            self.doubted_since_s: float | None = None  # a stand whose pose was not where the robot stood
            self.moved_after_s = np.inf  # the stripe did in that stand
            self.nobody_looked_s = 0.0  # as the robot left that stand
            self._on_table: Rest | None = None
        else:
            self._look_back(host_now_s())
        self._stands: Sample | None = None
        self._table_deg: float | None = None
        self.stands_since_s = self._told_s = -np.inf
        self._else_s: float | None = None  # since when something else is in the light than the sphere
        self._leaving: tuple[float, float] | None = None  # since when stood what moves now, and since when it does
        self._came_s = np.inf  # when the stand began, where it began with a move
        self._doubted = -np.inf, ""  # when last, and why
        self._arcs: deque[tuple[float, ArcFit]] = deque(maxlen=_MOST_ARCS)
        self._before: Rest | None = None
        self._left_since_s = -np.inf
        self._former: tuple[float, Sample, ArcFit] | None = (
            None  # the last stand: since when, where, what was seen
        )
        self.late_angle.forget()
        self.departures.forget()

    def tell(self, sample: Sample) -> None:
        """Take where the robot or the table stands."""
        pose, rules = sample.base_from_tool0, self._rules
        if pose is not None:
            last = self._stands.base_from_tool0 if self._stands else None
            if last is None or not is_resting([last, pose], rules.position_mm, rules.orientation_rad):
                self._moved(sample)
                self._came_s = np.inf if last is None else sample.host_time_s
                self._stands = sample
        if sample.table_deg is not None:
            if self._table_deg is None or abs(sample.table_deg - self._table_deg) > rules.table_deg:
                self._moved(sample)
                self._came_s = np.inf if self._table_deg is None else sample.host_time_s
            self._table_deg = sample.table_deg
            self.late_angle.tell(sample.table_deg, sample.host_time_s)
        self._told_s = sample.host_time_s

    def see(self, exposure: Exposure, *, is_on_table: bool = False) -> None:
        """Take what the scanner saw, of a ball on the table or not.

        What may have been exposed before the robot stood says nothing.
        """
        seen_s = exposure.frame.host_time_s
        if is_on_table and exposure.arc is not None and self.late_angle.see(exposure.arc, seen_s, self._table_deg):
            self.doubted_since_s, self.moved_after_s = self._left_since_s, np.inf
        self.departures.see(exposure.arc, seen_s)
        self._see_leaving(seen_s)
        late = seen_s <= self.stands_since_s + self._rules.latency_s
        if not exposure.frame.fresh or late or self._unwatched_s(seen_s - self._rules.untimed_latency_s, seen_s):
            return
        if exposure.arc is None:
            if self._else_s is None and len(exposure.points) >= _FEWEST_POINTS:
                self._else_s = seen_s
            return
        self._else_s = None
        self._arcs.append((seen_s, exposure.arc))
        former, self._former = self._former, None
        if former is None or self._stands is None or not _stood(former[2], exposure.arc):
            return
        poses = [one.base_from_tool0 for one in (former[1], self._stands) if one.base_from_tool0 is not None]
        # The pose moved alone: the robot had been here long before.
        if not is_resting(poses, _ROBOT_MOVED_MM, np.inf):
            self.doubted_since_s, self.moved_after_s = former[0], np.inf

    def table_contradiction(self, now: Rest, cell: Cell) -> str:
        """Return what speaks against a standstill's angle of the table, "" where nothing does.

        A ball on the table, seen by a known tool, is where it was as long as the angle is the same.
        """
        before = self._on_table
        if before is None or before.table_deg is None or now.table_deg is None:
            self._on_table = now
            return ""
        moved_mm = _ball_moved_mm(before, now, cell)
        if abs(now.table_deg - before.table_deg) > self._rules.table_deg or moved_mm < _BALL_MOVED_MM:
            self._on_table = now
            return ""
        return message(
            "the ball moved by {moved_mm:.0f} mm while the table's angle stood. Is the angle still being sent? If "
            "the ball was moved by hand, turn the table once",
            moved_mm=moved_mm,
        )

    def contradiction(self, now: Rest, is_timed: bool = True) -> str:
        """Return what speaks against a standstill's pose or exposures, "" where nothing does.

        A stripe that moved or a joint that turned while robot and table stood shows a pose that is not fresh; a
        pure translation that left the stripe where it was, exposures that are not.  One that is where it was may
        have been on its way since before the move, where exposures tell no time (`is_timed`).
        """
        arc = now.chosen.arc
        assert arc is not None
        if self._stands is None or now.robot is None:
            return ""
        if now.exposures[-1].frame.host_time_s < self.stands_since_s:
            return "the robot moves"  # since these exposures, so that nothing is known any more of their stand
        turned_deg = _turned_deg(self._stands, now.robot)
        if turned_deg > _JOINT_TURNED_DEG:
            told = message(
                "a joint turned by {turned_deg:.1f}° while the robot's pose stood. Is the pose still being sent?",
                turned_deg=turned_deg,
            )
            return self._doubt(told)
        if why := self._stripe_moved(arc):
            return why
        before, self._before = self._before, now
        if before is None or before.robot is None:
            return ""
        assert before.chosen.arc is not None
        if before.chosen.arc.apart_mm(arc) > STRIPE_STOOD_MM:
            return ""
        if not self._is_straight(before, now):
            stood_s = now.exposures[-1].frame.host_time_s - self.stands_since_s
            if is_timed or stood_s > _LATEST_S or not is_new_place(now, before.robot, before.table_deg):
                return ""
            self._before = before
            return message("the stripe, which is where it was before the move: perhaps it arrives late")
        self._before = before
        return message(
            "the robot moved by {before:.1f} mm since the last standstill, and the stripe did not. "
            "Does the scanner send what it sees now?",
            before=_way_mm(before, now),
        )

    def contradicted_since(self, began_s: float, is_timed: bool) -> str:
        """Return what spoke against poses or angles that were recorded since then, "" where nothing did.

        A stripe that moved soon in a stand may have been late, where exposures tell no time (`is_timed`).
        """
        if self._arcs:
            self._stripe_moved(self._arcs[-1][1])
        doubted_s, why = self._doubted
        counts = doubted_s >= began_s and (is_timed or not self.is_late())
        return self.late_angle.why or (why if counts else "")

    def _stripe_moved(self, arc: ArcFit, before_s: float = np.inf) -> str:
        """Return by how much the stripe moved in this stand, "" where it stood."""
        seen = (other for seen_s, other in self._arcs if seen_s < before_s)
        moved_mm = max((arc.apart_mm(other) for other in seen), default=0.0)
        if moved_mm <= STRIPE_MOVED_MM:
            return ""
        return self._doubt(
            message(
                "the stripe moved by {moved_mm:.1f} mm while the robot's pose stood. Is the pose "
                "still being sent? If scanner or sphere were moved by hand, drive the robot "
                "elsewhere once",
                moved_mm=moved_mm,
            )
        )

    def _doubt(self, why: str) -> str:
        """Remember a stand in which pose and stripe told of two places, and when the stripe left the first."""
        self._doubted = self._told_s, why
        self.doubted_since_s, self.nobody_looked_s = self.stands_since_s, 0.0
        left_s = (seen_s for seen_s, arc in self._arcs if self._arcs[0][1].apart_mm(arc) > STRIPE_MOVED_MM)
        self.moved_after_s = next(left_s, np.inf) - self.stands_since_s
        return why

    def is_late(self) -> bool:
        """Return whether the stripe moved so soon in the doubted stand that it may have been of before it."""
        return self.moved_after_s < _LATEST_S

    def _moved(self, sample: Sample) -> None:
        """Begin a new stand; one in which the stripe went elsewhere long before was none."""
        self._look_back(sample.host_time_s)
        if self._arcs and self._stands is not None:
            self._former = self.stands_since_s, self._stands, self._arcs[-1][1]
        if self._arcs:
            self.late_angle.leave(self._table_deg, self._arcs[-1][1])
            if self._arcs[0][1].apart_mm(self._arcs[-1][1]) <= STRIPE_MOVED_MM:
                self.departures.leave(sample, *self._arcs[-1])
            self._left_since_s = self.stands_since_s
            self._leaving = self.stands_since_s, sample.host_time_s
        self.stands_since_s = sample.host_time_s
        self._arcs.clear()
        self._else_s = None

    def _look_back(self, left_s: float) -> None:
        """Doubt a stand that ends, where the stripe left it before the pose did or nobody saw that it did not."""
        if not self._arcs:
            return
        before_s, seen_s = self._told_s - _ARRIVES_S, self._arcs[-1][0]
        if self._arcs[0][0] < before_s and self._stripe_moved(self._arcs[0][1], before_s):
            return
        nobody_s = self._unwatched_s(seen_s, left_s)
        if nobody_s or (self._else_s is not None and self._else_s + _WHILE_S < before_s):
            self._doubt_stand(self.stands_since_s, nobody_s)

    def _see_leaving(self, seen_s: float) -> None:
        """Doubt a stand that ended, where nobody saw that the stripe moved as soon as the pose did."""
        if self._leaving is None or seen_s <= self._leaving[1] + self._rules.latency_s:
            return
        (since_s, left_s), self._leaving = self._leaving, None
        if nobody_s := self._unwatched_s(left_s, seen_s):
            self._doubt_stand(since_s, nobody_s)

    def _doubt_stand(self, since_s: float, nobody_looked_s: float) -> None:
        self.doubted_since_s, self.moved_after_s, self.nobody_looked_s = since_s, np.inf, nobody_looked_s

    def unwatched_since_s(self) -> float:
        """Return for how long nobody looked since the stand began with a move, before its first exposure."""
        return self._unwatched_s(self._came_s, self._arcs[0][0]) if self._arcs else 0.0

    def _is_straight(self, before: Rest, now: Rest) -> bool:
        """Return whether the robot alone moved, without a turn, far enough to be seen."""
        poses = [rest.robot.base_from_tool0 for rest in (before, now) if rest.robot]
        told = [pose for pose in poses if pose is not None]
        return (
            len(told) == len(poses)
            and before.table_deg == now.table_deg
            and is_resting(told, np.inf, self._rules.orientation_rad)
            and _way_mm(before, now) > _ROBOT_MOVED_MM
        )


def _stood(one: ArcFit, other: ArcFit) -> bool:
    """Return whether noise explains what lies between two arcs, where that is little."""
    apart_mm = one.apart_mm(other)
    found = standstill([[one, other]]) if STRIPE_STOOD_MM < apart_mm <= _NOISE_MM else None
    return apart_mm <= STRIPE_STOOD_MM or (found is not None and found.stands_still)


def _way_mm(before: Rest, now: Rest) -> float:
    places = [
        rest.robot.base_from_tool0.translation_mm
        for rest in (before, now)
        if rest.robot and rest.robot.base_from_tool0
    ]
    return float(np.linalg.norm(places[1] - places[0]))


def _turned_deg(one: Sample, other: Sample) -> float:
    """Return how far the joint that turned most has turned; arms of more joints may turn them and stand."""
    if one.joints_deg is None or other.joints_deg is None or not len(one.joints_deg) == len(other.joints_deg) == 6:
        return 0.0
    return float(np.abs(np.subtract(one.joints_deg, other.joints_deg)).max())


def _ball_moved_mm(before: Rest, now: Rest, cell: Cell) -> float:
    """Return how far a ball moved in the base at least, on whichever side of the light it lay; 0: unknown."""
    places = [_ball_places_mm(rest, cell) for rest in (before, now)]
    return float(np.linalg.norm(places[0][:, None] - places[1], axis=2).min()) if all(map(len, places)) else 0.0


def _ball_places_mm(rest: Rest, cell: Cell) -> FloatArray:
    """Return both places (2, 3) in the base where a ball may be; none where pose, diameter or tool are unknown."""
    arc, pose, mount = rest.chosen.arc, rest.robot.base_from_tool0 if rest.robot else None, known_scanner(cell)
    if arc is None or cell.sphere_diameter_mm is None or mount is None or (on_flange(mount) and pose is None):
        return np.empty((0, 3))
    beside_mm = np.sqrt(max((cell.sphere_diameter_mm / 2) ** 2 - arc.radius_mm**2, 0.0))
    x_mm, z_mm = arc.center_mm
    places = np.array([[x_mm, side * beside_mm, z_mm, 1.0] for side in (-1, 1)])
    base_from_laser = pose.matrix @ mount.matrix if pose is not None and on_flange(mount) else mount.matrix
    return (places @ base_from_laser.T)[:, :3]
