"""A cell as a list of edges: mounts of scanners, places of balls, axes; and what is unknown of each.

Columns of all unknowns, in this order: the first mount (rx ry rz tx ty tz, rotation on the right), the first
ball's place (x y z), every axis, the other places, the other mounts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final, Literal

import numpy as np

from calib_core.frames import FloatArray, nearest_rotation, rotation_from_vector

Carrier = Literal["tool0", "base"]
"""The frames that carry scanners."""
TABLE: Final = "table"
"""The name of the axis that `cell.turntable` and a capture's `table_deg` tell of."""

AXIS_UNKNOWNS = 5
"""rx ry (tilts, on the right), tx ty (shifts along the axis's own x and y), and the scale of what is read."""

SCALE_COLUMN = 4
_MOUNT_STEP = (0.1, 0.1, 0.1, 20.0, 20.0, 20.0)
_AXIS_STEP = (0.1, 0.1, 20.0, 20.0, 0.05)
_PLACE_STEP_MM = 20.0


@dataclass(frozen=True)
class MovedAxis:
    """A rotary or linear axis that carries the object or the robot, `on` base or an axis that is listed before.

    `direction` is told of some: 1 where it counts right-handed about the end that points up in base.
    """

    name: str
    kind: Literal["rotary", "linear"] = "rotary"
    carries: Literal["object", "robot"] = "object"
    on: str = "base"
    direction: Literal[1, -1] | None = None

    @property
    def slides(self) -> bool:
        """Whether it shifts what it carries, and has no place of its own across."""
        return self.kind == "linear"

    @property
    def under_robot(self) -> bool:
        """Whether it carries the robot."""
        return self.carries == "robot"


@dataclass(frozen=True, eq=False)
class AxisState:
    """One guess of an axis: R (3, 3), T (3,) of its frame in base with every axis at zero, z along it; the scale.

    Of a linear axis R's z alone means anything.
    """

    rotation: FloatArray
    origin: FloatArray
    scale: float = 1.0

    def moved(self, step: FloatArray) -> "AxisState":
        """Return the guess after a step (5,)."""
        turn = rotation_from_vector(np.array([step[0], step[1], 0.0]))
        return AxisState(
            nearest_rotation(self.rotation @ turn),
            self.origin + self.rotation[:, :2] @ step[2:4],
            self.scale + float(step[SCALE_COLUMN]),
        )

    def step_to(self, other: "AxisState") -> FloatArray:
        """Return the step (5,) that leads from this guess to one that is near."""
        turn = self.rotation.T @ other.rotation
        tilts = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0]])
        shifts = self.rotation[:, :2].T @ (other.origin - self.origin)
        return np.array([*tilts, *shifts, other.scale - self.scale])


@dataclass(frozen=True)
class KnownDistance:
    """The distance of two balls' centres, mm, as a certificate or a user tells it, and its standard deviation."""

    one: str
    other: str
    mm: float
    sigma_mm: float


@dataclass(frozen=True)
class Layout:
    """What a cell is made of, beside the robot's pose.

    Attributes
    ----------
    mounts : tuple of (str, Carrier)
        The scanners' names, and what carries each.
    places : tuple of (str, str)
        What carries each place of a ball ("base", "tool0" or an axis that carries the object), and its name.
    axes : tuple of MovedAxis
    """

    mounts: tuple[tuple[str, Carrier], ...] = (("", "tool0"),)
    places: tuple[tuple[str, str], ...] = (("base", ""),)
    axes: tuple[MovedAxis, ...] = ()

    @property
    def unknowns(self) -> int:
        """The number of unknowns."""
        return 6 * len(self.mounts) + 3 * len(self.places) + AXIS_UNKNOWNS * len(self.axes)

    def mount(self, which: int) -> slice:
        """Return the columns of a scanner's mount."""
        rest = 9 + AXIS_UNKNOWNS * len(self.axes) + 3 * (len(self.places) - 1)
        first = rest + 6 * (which - 1) if which else 0
        return slice(first, first + 6)

    def place(self, which: int) -> slice:
        """Return the columns of a ball's place."""
        first = 9 + AXIS_UNKNOWNS * len(self.axes) + 3 * (which - 1) if which else 6
        return slice(first, first + 3)

    def apart(self, distances: Sequence[KnownDistance]) -> tuple[tuple[int, int, KnownDistance], ...]:
        """Return the known distances of balls that were seen, with the places of both."""
        places = {name: n for n, (_, name) in enumerate(self.places)}
        seen = [d for d in distances if d.one in places and d.other in places]
        return tuple((places[d.one], places[d.other], d) for d in seen)

    def axis(self, which: int) -> slice:
        """Return the columns of an axis."""
        first = 9 + AXIS_UNKNOWNS * which
        return slice(first, first + AXIS_UNKNOWNS)

    def scale(self, which: int) -> int:
        """Return the column of an axis's scale."""
        return self.axis(which).start + SCALE_COLUMN

    def on_axis(self, which: int) -> list[int]:
        """Return the places that an axis carries itself."""
        return [n for n, (carrier, _) in enumerate(self.places) if carrier == self.axes[which].name]

    def stands_alone(self, which: int) -> bool:
        """Return whether an axis stands on base and carries balls itself, and no other axis."""
        own = self.axes[which]
        return own.on == "base" and bool(self.on_axis(which)) and all(own.name != one.on for one in self.axes)

    def axis_and_places(self, which: int) -> np.ndarray:
        """Return the columns of an axis and of the places that it carries itself."""
        own = [np.arange(s.start, s.stop) for s in (self.axis(which), *map(self.place, self.on_axis(which)))]
        return np.concatenate(own)

    @property
    def table(self) -> int:
        """The last axis that carries a ball itself: the turntable where there is no other."""
        carriers = {carrier for carrier, _ in self.places}
        return max((n for n, axis in enumerate(self.axes) if axis.name in carriers), default=0)

    @property
    def carrying(self) -> list[int]:
        """The axes that carry a ball, themselves or by axes on them, from the base outwards."""
        return [a for a, axis in enumerate(self.axes) if axis.carries == "object" and self.rides[:, a].any()]

    def named(self, which: int) -> str:
        """Return an axis's name; empty for the turntable where there are no others."""
        axis = self.axes[which]
        return "" if len(self.carrying) < 2 and (axis.name, axis.kind) == (TABLE, "rotary") else axis.name

    @property
    def mountings(self) -> tuple[str, ...]:
        """The names of the places on that axis."""
        return tuple(self.places[n][1] for n in self.on_axis(self.table)) if self.axes else ()

    @cached_property
    def of_mounts(self) -> np.ndarray:
        """The columns of all mounts."""
        return np.concatenate([np.arange(s.start, s.stop) for s in map(self.mount, range(len(self.mounts)))])

    @cached_property
    def firsts(self) -> np.ndarray:
        """The first column of every place."""
        return np.array([self.place(n).start for n in range(len(self.places))])

    @cached_property
    def rides(self) -> np.ndarray:
        """Which places move with which axis, (places, axes): what it carries, and what axes beyond it carry."""
        names = [axis.name for axis in self.axes]
        found = np.zeros((len(self.places), len(names)), dtype=bool)
        for n, (carrier, _) in enumerate(self.places):
            while carrier in names:
                found[n, names.index(carrier)] = True
                carrier = self.axes[names.index(carrier)].on
        return found

    @cached_property
    def owns(self) -> np.ndarray:
        """Which places stand in which rotary axis's own frame, (places, axes)."""
        found = np.zeros((len(self.places), len(self.axes)), dtype=bool)
        for a, axis in enumerate(self.axes):
            found[self.on_axis(a), a] = axis.kind == "rotary"
        return found

    @cached_property
    def fixed(self) -> np.ndarray:
        """The columns (unknowns,) that keep their values unless asked for: scales, shifts of linear axes."""
        found = np.zeros(self.unknowns, dtype=bool)
        for a, axis in enumerate(self.axes):
            found[self.scale(a)] = True
            found[self.axis(a).start + 2 : self.scale(a)] = axis.kind == "linear"
        return found

    def step_limit(self) -> FloatArray:
        """Return the longest step of each unknown, (unknowns,), rad and mm."""
        limit = np.full(self.unknowns, _PLACE_STEP_MM)
        for n in range(len(self.mounts)):
            limit[self.mount(n)] = _MOUNT_STEP
        for a in range(len(self.axes)):
            limit[self.axis(a)] = _AXIS_STEP
        return limit


def index_of(values: Sequence[object], among: Sequence[object]) -> np.ndarray:
    """Return where each value stands in a list."""
    places = {value: n for n, value in enumerate(among)}
    return np.array([places[value] for value in values], dtype=np.int64)
