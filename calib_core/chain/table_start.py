"""Where the table's fit starts: axis, mountings and sides from the captures' own sphere centres in base.

The centres of one mounting are linear in the cosine and sine of the table's angle: c = a + b cos + d sin.  Three
captures, each with its two possible sides, fix a, b and d exactly; where they belong together b and d are equally
long and at right angles, b × d is the axis and a the centre of the circle.  The guess on which most captures agree
wins: neither right sides nor clean captures are needed.  The sense of b × d is that in which the angles count up.
Of many captures few propose guesses; all of them say how well these fit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from calib_core.cell.walk import Position
from calib_core.chain.observations import SphereSize, TableObservations
from calib_core.chain.spread import (
    AGREE_MM,
    TRIALS_BY_ALL,
    most_agreed,
    nearest_side,
    robust_costs,
    spread_captures,
    spread_over,
)
from calib_core.chain.table import TableReadings, TableState
from calib_core.errors import InputError, MotionError
from calib_core.frames import FloatArray, RigidTransform, cross
from calib_core.messages import plural

Mounts = RigidTransform | Mapping[str, RigidTransform]
"""The scanner's pose on what carries it, or that of each by its name."""


class AnotherPlaceError(InputError):
    """Captures of one mounting show the sphere in two places, neither of which is another mounting's."""


_TRIPLES = 40
_TRIALS = 160
_STILL_MM = 2.0
_ANOTHER_PLACE_MM = 5.0
_SAME_ANGLE_RAD = np.deg2rad(1.0)
_FULL_TURN_AND_MORE = 6.5
_MUCH_WORSE = 8.0


@dataclass(frozen=True, eq=False)
class TableStart:
    """A guess of the table, each capture's side (±1; 0: none) and how far it is from the guess (K,), mm.

    `position`: of all edges, where there are more axes.
    """

    state: TableState
    sides: np.ndarray
    misfit_mm: FloatArray
    position: Position | None = None

    @property
    def scatter_mm(self) -> float:
        """Robust scale of the misfits (median)."""
        return float(np.median(self.misfit_mm))


def readings_of(observations: TableObservations) -> tuple[TableReadings, tuple[str, ...]]:
    """Return the captures' readings, and the mountings' names in the order in which they first appear."""
    names = tuple(dict.fromkeys(o.mount for o in observations))
    mounts = np.array([names.index(o.mount) for o in observations])
    return TableReadings(np.array([o.angle_rad for o in observations]), mounts, len(names)), names


def both_centers_in_base(
    observations: TableObservations, sphere: SphereSize, mount_from_laser: Mounts
) -> FloatArray:
    """Return each capture's possible sphere centres in base, (K, 2, 3): on the +y and on the −y side."""
    centers = np.empty((len(observations), 2, 3))
    for k, o in enumerate(observations):
        one_mount = (
            mount_from_laser
            if isinstance(mount_from_laser, RigidTransform)
            else mount_from_laser[o.sphere.scanner]
        )
        base_from_laser = o.sphere.ball_from_scanner @ one_mount
        for n, side in enumerate((1, -1)):
            one = o.sphere.side or side
            centers[k, n] = base_from_laser.apply(o.sphere.sphere_center_in_laser_mm(sphere, one))
    return centers


def find_table_start(observations: TableObservations, sphere: SphereSize, mount_from_laser: Mounts) -> TableStart:
    """Return the guess on which most captures agree.

    Raises
    ------
    MotionError
        If no mounting has three different angles, or the sphere stays where it is while the table turns.
    InputError
        If the angles fit as radians, and not as degrees; or a mounting's captures show the sphere in two places.
    """
    readings, _ = readings_of(observations)
    centers = both_centers_in_base(observations, sphere, mount_from_laser)
    _require_angles(readings)
    _require_motion(readings, centers)
    start = best_start(readings, centers)
    degrees = np.rad2deg(readings.angles_rad)
    if np.abs(degrees).max() <= _FULL_TURN_AND_MORE and start.scatter_mm > AGREE_MM:
        other = best_start(TableReadings(degrees, readings.mounts, readings.mount_count), centers)
        if other.scatter_mm * _MUCH_WORSE < start.scatter_mm:
            raise InputError(
                "table angles in degrees (table_deg)",
                "angles up to {degrees:.4g} that fit the captures only as radians",
                "Multiply them by 180/π.",
                "captures: table_deg",
                degrees=np.abs(degrees).max(),
            )
    _require_one_place(observations, readings, centers, start)
    sides = np.array([0 if o.sphere.circle_radius_mm is None else 1 for o in observations])
    return TableStart(start.state, sides * start.sides, start.misfit_mm)


def table_guess(observations: TableObservations, sphere: SphereSize, mount_from_laser: Mounts) -> TableStart:
    """Return the guess on which most captures agree, however badly; raises MotionError without three angles."""
    readings, _ = readings_of(observations)
    _require_angles(readings)
    return best_start(readings, both_centers_in_base(observations, sphere, mount_from_laser))


def _require_angles(readings: TableReadings) -> None:
    for mount in range(readings.mount_count):
        if _different(readings.angles_rad[readings.mounts == mount]) >= 3:
            return
    count = len(readings.angles_rad)
    raise MotionError(
        "captures of one mounting of the sphere at three table angles or more (better eight all around)",
        plural(
            "{count} capture, of which no mounting has three different angles",
            "{count} captures, of which no mounting has three different angles",
            by="count",
            count=count,
        ),
        "Turn the table by 45° and capture the sphere again, all around; then do so at a second height.",
    )


def _different(angles_rad: FloatArray) -> int:
    """Return how many directions are among the angles."""
    left, count = np.sort(np.mod(angles_rad, 2 * np.pi)), 0
    while len(left):
        count += 1
        gap = np.abs(np.mod(left - left[0] + np.pi, 2 * np.pi) - np.pi)
        left = left[gap > _SAME_ANGLE_RAD]
    return count


def _require_motion(readings: TableReadings, centers: FloatArray) -> None:
    """Refuse captures in which no mounting's sphere moves with the table."""
    few = spread_captures(readings.mounts, readings.angles_rad)
    readings, centers = readings.chosen(few), centers[few]
    distances: list[float] = []
    for mount in range(readings.mount_count):
        chosen = readings.mounts == mount
        if _different(readings.angles_rad[chosen]) < 3:
            continue
        places = centers[chosen]
        spread = nearest_side(places.reshape(-1, 3), places)
        distances.append(float(np.median(spread, axis=1).min()))
    if distances and max(distances) < _STILL_MM:
        got = "one that stays within {most:.2f} mm: it stands on the axis, or the table did not turn"
        to_do = "Mount it well off the axis (80 mm or more) and check that the table turns between captures."
        raise MotionError("a sphere that moves when the table turns", got, to_do, most=max(distances))


def _require_one_place(
    observations: TableObservations, readings: TableReadings, centers: FloatArray, start: TableStart
) -> None:
    """Refuse a mounting of which a third of the captures or more agree on another place of the sphere."""
    places = _turned_back(readings, centers, start.state.rotation, start.state.origin)
    for mount in range(readings.mount_count):
        members = np.flatnonzero(readings.mounts == mount)
        off = members[start.misfit_mm[members] > _ANOTHER_PLACE_MM]
        if len(off) < 3 or 3 * len(off) < len(members):
            continue
        guesses = places[off[spread_over(len(off))]].reshape(-1, 3)
        agree = nearest_side(guesses, places[off]) < _STILL_MM
        best = int(np.argmax(agree.sum(axis=1)))
        if agree[best].sum() < max(3, len(members) // 3):
            continue
        names = ", ".join(observations[int(k)].sphere.capture for k in off[agree[best]])
        x, y, z = guesses[best] - start.state.mounts[mount]
        known = any(
            other != mount and np.linalg.norm(guesses[best] - place) < _STILL_MM
            for other, place in enumerate(start.state.mounts)
        )
        raise (InputError if known else AnotherPlaceError)(
            "one place of the sphere on the table in the mounting '{mount}'",
            "another place in {names}, by ({x:.0f}, {y:.0f}, {z:.0f}) mm",
            "Correct their `mount`: the labels are mixed up." if known else "Give these a `mount` of their own.",
            "captures: mount",
            mount=observations[int(off[0])].mount,
            names=names,
            x=x,
            y=y,
            z=z,
        )


def best_start(readings: TableReadings, centers: FloatArray) -> TableStart:
    """Return the guess with the least robust cost, of balls' possible centres in base (K, 2, 3)."""
    few = np.zeros(len(centers), dtype=bool)
    few[spread_captures(readings.mounts, readings.angles_rad)] = True
    circles = _circles(readings, centers)
    states = [_state(readings, centers, circle, few, exact=False) for circle in circles]
    costs = [_cost(_misfits(readings, centers, state)[0]) for state in states]
    if not few.all():
        best = np.sort(np.argsort(costs, kind="stable")[:TRIALS_BY_ALL])
        states = [_state(readings, centers, circles[n], few, exact=True) for n in best]
        costs = [_cost(_misfits(readings, centers, state)[0]) for state in states]
    state = states[int(np.argmin(costs))]
    misfit, sides = _misfits(readings, centers, state)
    return TableStart(state, sides, misfit)


def has_circle(readings: TableReadings) -> bool:
    """Return whether any mounting was read at three angles that tell a circle."""
    return any(_triples(readings.angles_rad[readings.mounts == mount]) for mount in range(readings.mount_count))


def _cost(misfit_mm: FloatArray) -> float:
    return float(robust_costs(misfit_mm))


def _circles(readings: TableReadings, centers: FloatArray) -> list[FloatArray]:
    """Return trial circles a, b, d (3, 3), the most nearly round ones first."""
    guesses: list[FloatArray] = []
    for mount in range(readings.mount_count):
        members = np.flatnonzero(readings.mounts == mount)
        for triple in _triples(readings.angles_rad[members]):
            chosen = members[list(triple)]
            angles = readings.angles_rad[chosen]
            inverse = np.linalg.inv(np.column_stack([np.ones(3), np.cos(angles), np.sin(angles)]))
            sides = np.array(list(product((0, 1), repeat=3)))
            guesses.extend(inverse @ centers[chosen[None], sides])
    circles = np.array(guesses)
    cosine, sine = np.linalg.norm(circles[:, 1], axis=1), np.linalg.norm(circles[:, 2], axis=1)
    square = np.abs(np.einsum("ni,ni->n", circles[:, 1], circles[:, 2])) / np.maximum(
        np.maximum(cosine, sine), 1e-9
    )
    order = np.argsort(np.abs(cosine - sine) + square)
    return [circles[n] for n in order[:_TRIALS]]


def _triples(angles_rad: FloatArray) -> list[tuple[int, int, int]]:
    """Return well spread triples of captures of one mounting."""
    members = np.arange(len(angles_rad))
    if len(members) > 14:
        members = np.unique(np.linspace(0, len(angles_rad) - 1, 14).astype(int))
    triples = list(combinations(members.tolist(), 3))
    if not triples:
        return []
    angles = angles_rad[np.array(triples)]
    rows = np.stack([np.ones_like(angles), np.cos(angles), np.sin(angles)], axis=2)
    area = np.abs(np.linalg.det(rows))
    good = [t for t, a in zip(triples, area, strict=True) if a > max(0.4 * area.max(), 1e-4)]
    picked = np.random.default_rng(len(good)).permutation(len(good))[:_TRIPLES]
    return [good[int(n)] for n in picked]


def _state(
    readings: TableReadings, centers: FloatArray, circle: FloatArray, few: np.ndarray, exact: bool
) -> TableState:
    """Return the table of a trial circle, every mounting placed where most of its captures agree."""
    constant, cosine, sine = (np.asarray(part, dtype=np.float64) for part in circle)
    axis = cross(cosine, sine)
    axis = axis / max(float(np.linalg.norm(axis)), 1e-12)
    across = cosine + cross(sine, axis)
    across = across - axis * (axis @ across)
    length = float(np.linalg.norm(across))
    if length < 1e-9 or not np.isfinite(length):
        return TableState(np.eye(3), constant, np.zeros((readings.mount_count, 3)))
    across = across / length
    rotation = np.column_stack([across, cross(axis, across), axis])
    places = _turned_back(readings, centers, rotation, constant)
    mounts = np.zeros((readings.mount_count, 3))
    for mount in range(readings.mount_count):
        chosen = readings.mounts == mount
        own = places[chosen]
        guess = most_agreed(own, few[chosen], exact)
        distances = nearest_side(guess[None], own)[0]
        near = own[np.arange(len(own)), np.argmin(np.linalg.norm(own - guess, axis=2), axis=1)]
        third = float(np.sort(distances)[(len(own) - 1) // 3])
        agree = np.linalg.norm(near - guess, axis=1) <= max(3 * third, AGREE_MM)
        mounts[mount] = near[agree].mean(axis=0)
    return TableState(rotation, constant, mounts)


def _turned_back(
    readings: TableReadings, centers: FloatArray, rotation: FloatArray, origin: FloatArray
) -> FloatArray:
    """Return the captures' possible centres in T at angle zero, (K, 2, 3)."""
    local = (centers - origin) @ rotation
    cosine, sine = np.cos(readings.angles_rad)[:, None], np.sin(readings.angles_rad)[:, None]
    x, y, z = local[..., 0], local[..., 1], local[..., 2]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=2)


def _misfits(readings: TableReadings, centers: FloatArray, state: TableState) -> tuple[FloatArray, np.ndarray]:
    """Return each capture's distance (K,) from where a guess expects it, and its side ±1."""
    places = _turned_back(readings, centers, state.rotation, state.origin)
    distances = np.linalg.norm(places - state.mounts[readings.mounts][:, None], axis=2)
    return distances.min(axis=1), np.where(distances[:, 0] <= distances[:, 1], 1, -1)
