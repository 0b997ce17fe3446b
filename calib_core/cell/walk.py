"""The way from a scanner to the ball that it sees, over the edges between them, and what the robot's error moves.

A ball's place is moved by the axes that carry it, out of base by those that carry the robot, by the robot's pose
where one end of the way alone is on the flange, and into L by the scanner's mount.  A pose's error acts where the
way leads over the robot, with the lever from the flange to the ball; otherwise it moves nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import AxisState, Carrier, Layout, MovedAxis
from calib_core.frames import (
    FloatArray,
    RigidTransform,
    nearest_rotation,
    rotation_from_vector,
    skew,
    vector_from_rotation,
)

_X, _Y, _Z = (skew(axis) for axis in np.eye(3))


@dataclass(frozen=True)
class Carriers:
    """What carries the scanner, and what the ball: "tool0", "base", or an axis that carries the object."""

    scanner: Carrier = "tool0"
    ball: str = "base"

    @property
    def scanner_moves(self) -> bool:
        """Whether the flange carries the scanner."""
        return self.scanner == "tool0"

    @property
    def over_robot(self) -> int:
        """1 where the way from scanner to ball leads from the flange to base, −1 the other way, 0 not over it."""
        return (self.ball != "tool0") - (self.scanner == "base")

    def ball_in_base(self, center_mm: FloatArray, base_from_tool0: RigidTransform) -> FloatArray:
        """Return where a ball (3,) that one of them carries is in base, axes at zero, at a pose of the robot."""
        return base_from_tool0.apply(center_mm) if self.ball == "tool0" else center_mm

    def ball_from_scanner(self, base_from_tool0: RigidTransform) -> RigidTransform:
        """Return the transform between the two that carry, axes at zero, at a pose of the robot."""
        if self.over_robot == 0:
            return RigidTransform.identity(self.scanner, self.scanner)
        return base_from_tool0 if self.over_robot > 0 else base_from_tool0.inverse()


@dataclass(frozen=True, eq=False)
class Position:
    """One guess of the edges: mounts R (S, 3, 3) and T (S, 3), places (P, 3), axes."""

    mount_rotations: FloatArray
    mount_translations: FloatArray
    places: FloatArray
    axes: tuple[AxisState, ...] = ()

    def moved(self, layout: Layout, step: FloatArray) -> "Position":
        """Return the guess after a step of all unknowns."""
        of_mounts = [step[layout.mount(n)] for n in range(len(self.mount_rotations))]
        turned = [
            nearest_rotation(r @ rotation_from_vector(own[:3]))
            for r, own in zip(self.mount_rotations, of_mounts, strict=True)
        ]
        return Position(
            np.array(turned),
            self.mount_translations + [own[3:] for own in of_mounts],
            self.places + [step[layout.place(n)] for n in range(len(self.places))],
            tuple(axis.moved(step[layout.axis(n)]) for n, axis in enumerate(self.axes)),
        )

    def step_to(self, layout: Layout, other: "Position") -> FloatArray:
        """Return the step of all unknowns that leads from this guess to another one that is near."""
        step = np.zeros(layout.unknowns)
        for n, (one, there) in enumerate(zip(self.mount_rotations, other.mount_rotations, strict=True)):
            shift = other.mount_translations[n] - self.mount_translations[n]
            step[layout.mount(n)] = [*vector_from_rotation(one.T @ there), *shift]
        for n, shift in enumerate(other.places - self.places):
            step[layout.place(n)] = shift
        for n, (one, there) in enumerate(zip(self.axes, other.axes, strict=True)):
            step[layout.axis(n)] = one.step_to(there)
        return step


@dataclass(frozen=True, eq=False)
class Walk:
    """The ways of K captures.

    Attributes
    ----------
    layout : Layout
    rotations, translations : (K, 3, 3), (K, 3)
        base_from_tool0 as recorded, mm.
    over_robot : (K,)
        As `Carriers` has it.
    scanner, place : (K,) int
        Which mount and which place stand at the ends.
    readings : (K, A)
        Of the axes, rad and mm.
    """

    layout: Layout
    rotations: FloatArray
    translations: FloatArray
    over_robot: FloatArray
    scanner: np.ndarray
    place: np.ndarray
    readings: FloatArray

    def chosen(self, which: np.ndarray) -> "Walk":
        """Return those of some captures."""
        return replace(
            self,
            rotations=self.rotations[which],
            translations=self.translations[which],
            over_robot=self.over_robot[which],
            scanner=self.scanner[which],
            place=self.place[which],
            readings=self.readings[which],
        )

    @property
    def poses(self) -> tuple[FloatArray, FloatArray]:
        """Rotations and translations."""
        return self.rotations, self.translations

    def main_place(self, which: np.ndarray) -> int:
        """Return which place most of some captures (K,) saw."""
        return int(np.argmax(np.bincount(self.place[which])))

    def across_robot(self, *, as_recorded: bool = False) -> tuple[FloatArray, FloatArray]:
        """Return what is recorded from what carries the scanner into what carries the ball, (K, 3, 3), (K, 3).

        Where axes that carry the robot stand between it and the scanner, nothing is left for it, unless it is
        asked for what was recorded.
        """
        back = self.over_robot < 0
        if not back.any() and self.over_robot.all():
            return self.rotations, self.translations
        rotations, translations = self.rotations.copy(), self.translations.copy()
        rotations[back] = np.swapaxes(self.rotations[back], 1, 2)
        translations[back] = -np.einsum("kij,kj->ki", rotations[back], self.translations[back])
        none = (self.over_robot == 0) | (back & self._on_axes & (not as_recorded))
        rotations[none], translations[none] = np.eye(3), 0.0
        return rotations, translations

    @property
    def _on_axes(self) -> bool:
        return any(axis.carries == "robot" for axis in self.layout.axes)

    def balls(self, at: Position) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
        """Return where balls stand before `across_robot`, (K, 3), and how that follows unknowns and readings.

        The derivatives are (K, 3, P) and (K, 3, A); None where no axis moves anything and one place is all.
        """
        layout = self.layout
        points = at.places[self.place]
        if not layout.axes and len(layout.places) == 1:
            return points, None, None
        rows, size = np.arange(len(points)), layout.unknowns
        moves = np.zeros((len(points), 3, size + len(layout.axes)))
        for i in range(3):
            moves[rows, i, layout.firsts[self.place] + i] = 1.0
        for a in reversed(range(len(layout.axes))):
            self._move(a, at.axes[a], layout.rides[self.place, a], 1, points, moves)
        if self._on_axes:
            back = np.flatnonzero(self.over_robot < 0)
            points[back] = np.einsum("kij,kj->ki", self.rotations[back], points[back]) + self.translations[back]
            moves[back] = self.rotations[back] @ moves[back]
            robots = [a for a, axis in enumerate(layout.axes) if axis.carries == "robot"]
            for a in reversed(robots):
                self._move(a, at.axes[a], self.over_robot < 0, 1, points, moves)
            for a in robots:
                self._move(a, at.axes[a], self.over_robot > 0, -1, points, moves)
        return points, moves[:, :, :size], moves[:, :, size:]

    def _move(
        self, a: int, axis: AxisState, which: np.ndarray, sign: int, points: FloatArray, moves: FloatArray
    ) -> None:
        """Move points and their derivatives with an axis (or back, with −1), where a mask (K,) says so."""
        some = np.flatnonzero(which)
        layout, columns, lever = self.layout, self.layout.axis(a), self.layout.unknowns + a
        reading, r = sign * self.readings[some, a], axis.rotation
        if layout.axes[a].kind == "linear":
            way = (axis.scale * reading)[:, None]
            points[some] += way * r[:, 2]
            moves[some, :, columns.start] += -way * r[:, 1]
            moves[some, :, columns.start + 1] += way * r[:, 0]
            moves[some, :, layout.scale(a)] += reading[:, None] * r[:, 2]
            moves[some, :, lever] += sign * r[:, 2]
            return
        own = layout.owns[self.place[some], a][:, None]
        within = np.where(own, points[some], (points[some] - axis.origin) @ r)
        slopes = np.where(own[:, :, None], moves[some], r.T @ moves[some])
        cosine, sine = np.cos(axis.scale * reading), np.sin(axis.scale * reading)
        turn = np.zeros((len(some), 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = cosine
        turn[:, 0, 1], turn[:, 1, 0], turn[:, 2, 2] = -sine, sine, 1.0
        turned = np.einsum("kij,kj->ki", turn, within)
        slopes = turn @ slopes
        before = np.where(own, 0.0, 1.0)[:, :, None] * turn  # what rides on it is seen from its frame first
        by_axis = np.empty((len(some), 3, 5))
        for n, about in enumerate((_X, _Y)):
            by_axis[:, :, n] = turned @ about.T - np.einsum("kij,kj->ki", before, within @ about.T)
            by_axis[:, :, 2 + n] = np.eye(3)[n] - before[:, :, n]
        around = turned @ _Z.T
        by_axis[:, :, 4] = reading[:, None] * around
        slopes[:, :, columns] += by_axis
        slopes[:, :, lever] += sign * around
        points[some] = turned @ r.T + axis.origin
        moves[some] = r @ slopes

    def seen(self, at: Position) -> FloatArray:
        """Return where each ball is expected in L, (K, 3), mm."""
        points, rotations, translations = self.balls(at)[0], *self.across_robot()
        carried = np.einsum("kji,kj->ki", rotations, points - translations)
        mounts = at.mount_rotations[self.scanner]
        return np.einsum("kji,kj->ki", mounts, carried - at.mount_translations[self.scanner])

    def flanges(self, at: Position) -> tuple[FloatArray, FloatArray]:
        """Return the flange's pose as the scanner's side sees it, (K, 3, 3), (K, 3), robots moved on axes."""
        back = self.over_robot < 0
        if not self._on_axes or not back.any():
            return self.poses
        rotations, translations = self.on_foot(at.axes)
        return (
            np.where(back[:, None, None], rotations, self.rotations),
            np.where(back[:, None], translations, self.translations),
        )

    def on_foot(self, axes: Sequence[AxisState]) -> tuple[FloatArray, FloatArray]:
        """Return base_from_tool0 as the axes that carry the robot have moved it, (K, 3, 3), (K, 3)."""
        turned, moved = foot_moves(self.layout.axes, axes, self.readings)
        return turned @ self.rotations, np.einsum("kij,kj->ki", turned, self.translations) + moved

    def ball_from_mount(self, at: Position) -> FloatArray:
        """Return the rotations from what carries scanners into what carries still balls, (K, 3, 3)."""
        rotations = (self.on_foot(at.axes)[0] if self._on_axes else self.rotations).copy()
        back = self.over_robot < 0
        rotations[back] = np.swapaxes(rotations[back], 1, 2)
        rotations[self.over_robot == 0] = np.eye(3)
        return rotations

    def laser_from_base(self, at: Position) -> FloatArray:
        """Return how balls move in L with the reported position of the flange in base, (K, 3, 3).

        The axes of base as L sees them; against them where the flange carries the ball.
        """
        mounts = np.swapaxes(at.mount_rotations, 1, 2)[self.scanner]
        inverse = np.swapaxes(self.rotations, 1, 2)
        if (self.over_robot > 0).all():
            return mounts @ inverse
        turned = inverse.copy()
        turned[self.over_robot == 0] = 0.0
        back = self.over_robot < 0
        turned[back] = -np.eye(3)
        if self._on_axes:
            turned[back] = -(self.flanges(at)[0] @ inverse)[back]
        return mounts @ turned

    def levers(self, at: Position, centers_in_laser: FloatArray) -> FloatArray:
        """Return from the flange to each ball, (K, 3), along the axes of L, mm.

        Parameters
        ----------
        at : Position
        centers_in_laser : (K, 3)
            Where the balls are seen.
        """
        inverse = np.swapaxes(at.mount_rotations, 1, 2)
        from_mount = centers_in_laser + np.einsum("sij,sj->si", inverse, at.mount_translations)[self.scanner]
        if (self.over_robot > 0).all():
            return from_mount
        seen = np.einsum("kij,kj->ki", inverse[self.scanner], self.flanges(at)[1])
        flange = np.where((self.over_robot < 0)[:, None], seen, 0.0)
        return np.where((self.over_robot != 0)[:, None], from_mount - flange, 0.0)

    def moves(self, laser_from_base: FloatArray, levers: FloatArray) -> FloatArray:
        """Return how balls move in L by the robot's error along and about base's axes, (K, 3, 6), mm and mm/rad.

        The error is the reported position less the true one, and the turn from the reported orientation to the
        true one.

        Parameters
        ----------
        laser_from_base, levers : (K, 3, 3), (K, 3)
            As the methods of these names return them.
        """
        in_base = np.einsum("kji,kj->ki", laser_from_base, levers) * self.over_robot[:, None]
        return np.concatenate([laser_from_base, laser_from_base @ skew(in_base)], axis=2)


def foot_moves(
    axes: Sequence[MovedAxis], states: Sequence[AxisState], readings: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return how those of axes (A) that carry the robot have moved its foot at readings, (K, 3, 3), (K, 3)."""
    turned, moved = np.tile(np.eye(3), (len(readings), 1, 1)), np.zeros((len(readings), 3))
    for axis, at, reading in reversed(list(zip(axes, states, readings.T, strict=True))):
        if axis.carries != "robot":
            continue
        way = at.scale * reading[:, None] * at.rotation[:, 2]
        if axis.kind == "linear":
            moved = moved + way
            continue
        turn = np.array([rotation_from_vector(one) for one in way]).reshape(-1, 3, 3)
        turned, moved = turn @ turned, np.einsum("kij,kj->ki", turn, moved - at.origin) + at.origin
    return turned, moved


def ways(
    layout: Layout,
    poses: Sequence[RigidTransform],
    carriers: Sequence[Carriers],
    scanner: np.ndarray,
    place: np.ndarray,
    readings: FloatArray,
) -> Walk:
    """Return the ways of captures with the robot's poses."""
    return Walk(
        layout,
        np.array([pose.rotation for pose in poses]).reshape(-1, 3, 3),
        np.array([pose.translation_mm for pose in poses]).reshape(-1, 3),
        np.array([float(one.over_robot) for one in carriers]),
        scanner,
        place,
        readings,
    )
