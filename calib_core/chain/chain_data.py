"""What the captures say, as arrays, and what is known beside them: scatters, the tool, the scanner."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib_core.cell.layout import AxisState, KnownDistance, Layout
from calib_core.cell.walk import Position, Walk
from calib_core.chain import scanner
from calib_core.frames import FloatArray

ARM_SCALE_SIGMA = 2e-4
"""How far an arm's lengths are off, as a share: beyond what its maker promises the captures must show it."""

DRIFT_SIGMA_MM = 0.04
"""How far the sphere drifts from a session's middle to its end, per axis: warmth, settling."""
_UNTOLD_LEVER_MM = 150.0  # scanners and balls sit one to three decimetres from the flange, in some direction


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, per axis, of a robot pose's position and orientation, and of the readings of axes.

    `axes` are in rad or mm, as the cell lists them.  `alike` are those of the part that captures share where their
    poses are alike; `reach` is a factor on the distances over which they are.  `freedom` says how well a pose's
    whole scatter is known: as well as from so many degrees of freedom.  `play_mm` is that of a ball on an axis
    before a scanner that stands still; elsewhere a pose's position holds it.
    """

    position_mm: float
    orientation_rad: float
    axes: tuple[float, ...] = ()
    alike_position_mm: float = 0.0
    alike_orientation_rad: float = 0.0
    reach: float = 1.0
    freedom: float = np.inf
    play_mm: float = 0.0

    @property
    def angle_rad(self) -> float:
        """Of the first axis: a turntable's angle."""
        return self.axes[0] if self.axes else 0.0

    @property
    def is_alike(self) -> bool:
        """Whether poses share errors where they are alike."""
        return self.alike_position_mm > 0 or self.alike_orientation_rad > 0

    @property
    def largest_position_mm(self) -> float:
        """The larger of a pose's own error and the one it shares."""
        return max(self.position_mm, self.alike_position_mm)


@dataclass(frozen=True, eq=False)
class ToolPrior:
    """What is known of the mounts and of the scanners beforehand.

    R (S, 3, 3), T (S, 3), the scanners' values (N,), and the inverse covariance (6 S + n, 6 S + n) of rx … tz of
    each mount and of those n nuisances that are sought.
    """

    rotations: FloatArray
    translations: FloatArray
    scanner: FloatArray
    information: FloatArray

    def without(self, held: np.ndarray) -> "ToolPrior":
        """Return what is known where some nuisances, a mask (n,), are nothing for sure."""
        kept = np.concatenate([np.ones(6 * len(self.rotations), dtype=bool), ~held])
        return replace(self, information=self.information[np.ix_(kept, kept)])


@dataclass(frozen=True, eq=False)
class ChainData:
    """All captures as arrays.

    Attributes
    ----------
    rotations, translations : (K, 3, 3), (K, 3)
        From what carries the scanner into what carries the ball, poses as recorded: `Walk.across_robot`.
    walk : Walk
        The way from each scanner to its ball.
    points, counts, basis : (M, 3), (M,), (M, 4)
        Profiles' points in L, neighbours merged; how many measured points each stands for; what a bow moves it
        along z and the shapes of the error by incidence (`chain.scanner`).
    offsets, weights, effective : (K + 1,), (K,), (K,)
        Where each capture's points begin, 1/σ² of one, and how many independent ones one counts as (N_eff / N).
    anchors, anchor_information, anchor_gradient : (K, 3), (K, 11, 11), (K, 11)
        For clouds and centers, whose likelihood is quadratic in (centre, nuisances): where, how sharp, how steep.
    radius_mm, radii_mm, nuisance_sigmas : float, (K,), (N,)
        The first ball's radius as told, each capture's; how uncertain those and scanners' errors are (0: exact).
    nuisance_of, kinds : (K, 8), (N,)
        Which nuisances each capture's eight (`scanner.NAMES`) are, and which name each nuisance has.
    half_width_mm : float
        Half the width that the scanner's points fill.
    arm_scale_sigma, drift_sigma_mm : float
        Of the arm's lengths, as a share, and of a slow drift of the sphere to the session's end, per axis.
    order : (K,)
        When each was taken, from −1 (first) to 1 (last).
    pose_scale : (K,)
        By how much a capture's pose variance is larger than the sigmas say: captures that lie off count less.
    points_per_independent : (K,)
        How many of a capture's points say as much as one that errs by itself.
    bent : (K,)
        By how many times fewer these are once its scanner's errors are out of the points.
    stop : (K,) int
        Captures at one stop of the robot, of several scanners or balls, whose errors are common, have one number;
        −1: alone.
    held : (P,) bool
        Unknowns that keep their values, without the nuisances.
    distances : tuple
        Known distances between balls, with the places of both.
    tool_prior : ToolPrior or None
    arm_columns, arm_means : (K, 3, p), (p,), or None
        How the balls move in L by one standard deviation of each term of the arm's own errors, beyond what the
        poses are corrected by; and what is believed of these (`chain.arm_model`).
    arm_moves : (K, 6, p) or None
        How the flanges move in base by the same.
    exact : tuple of int
        Columns of the first mount that are held, as no motion tells them (`without_turns`).
    untold : (m, 3) or None
        Unit vectors in the frame of what carries the first scanner along which its place is held for that.
    """

    rotations: FloatArray
    translations: FloatArray
    walk: Walk
    points: FloatArray
    counts: FloatArray
    basis: FloatArray
    offsets: np.ndarray
    weights: FloatArray
    effective: FloatArray
    anchors: FloatArray
    anchor_information: FloatArray
    anchor_gradient: FloatArray
    radius_mm: float
    radii_mm: FloatArray
    nuisance_sigmas: FloatArray
    nuisance_of: np.ndarray
    kinds: np.ndarray
    half_width_mm: float
    order: FloatArray
    pose_scale: FloatArray
    points_per_independent: FloatArray
    bent: FloatArray
    stop: np.ndarray
    held: np.ndarray
    arm_scale_sigma: float = 0.0
    drift_sigma_mm: float = 0.0
    distances: tuple[tuple[int, int, KnownDistance], ...] = ()
    tool_prior: ToolPrior | None = None
    arm_columns: FloatArray | None = None
    arm_means: FloatArray | None = None
    arm_moves: FloatArray | None = None
    exact: tuple[int, ...] = ()
    untold: FloatArray | None = None

    @property
    def count(self) -> int:
        """The number of captures."""
        return len(self.weights)

    @property
    def stops(self) -> int:
        """The number of the robot's stops that several captures share."""
        return int(self.stop.max(initial=-1)) + 1

    @property
    def of_stops(self) -> int:
        """The number of errors that captures share as they are of one stop: of its pose and of each axis."""
        return self.stops * (6 + len(self.walk.layout.axes))

    @cached_property
    def active(self) -> np.ndarray:
        """Which of the nuisances are unknowns (with a prior) as well."""
        return np.flatnonzero(self.nuisance_sigmas > 0)

    @property
    def of_files(self) -> np.ndarray:
        """Which nuisances move the points of a scanner's files, (N,)."""
        return scanner.OF_FILES[self.kinds]

    @property
    def unknowns(self) -> int:
        """The number of unknowns, held ones included, without the nuisances."""
        return self.walk.layout.unknowns

    @property
    def width(self) -> int:
        """The number of unknowns with the nuisances."""
        return self.unknowns + len(self.active)

    @property
    def free_unknowns(self) -> int:
        """The number of unknowns that are sought, without the nuisances."""
        return self.unknowns - int(self.held.sum())

    @property
    def known_columns(self) -> np.ndarray:
        """The columns of what a `ToolPrior` is about: all mounts and the nuisances that are sought."""
        return np.concatenate([self.walk.layout.of_mounts, np.arange(self.unknowns, self.width)])

    def levers(self, at: Position, centers_in_laser: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return expected levers from the flange to balls (K, 3), mm, and how far off they may be (K, 3, 3), mm².

        A place that is held for want of turns tells no lever: along such a direction it may be any usual one.
        """
        levers = self.walk.levers(at, centers_in_laser)
        if self.untold is None:
            return levers, np.zeros((self.count, 3, 3))
        directions = self.untold @ at.mount_rotations[self.walk.scanner]
        along = np.swapaxes(directions, 1, 2) @ directions
        on_flange = self.walk.over_robot < 0  # the ball; what is held is then a place in base
        levers = levers - on_flange[:, None] * np.einsum("kij,kj->ki", along, levers)
        return levers, _UNTOLD_LEVER_MM**2 * along

    def holding(self, columns: int | slice | Sequence[int] | np.ndarray, held: bool = True) -> "ChainData":
        """Return the same with some unknowns held at their values, or sought."""
        mask = self.held.copy()
        mask[columns] = held
        return replace(self, held=mask)

    def silent(self, used: np.ndarray) -> "ChainData":
        """Return the same captures, of which those outside a mask (K,) say nothing."""
        if used.all():
            return self
        return replace(
            self,
            weights=np.where(used, self.weights, 0.0),
            effective=np.where(used, self.effective, 0.0),
            anchor_information=self.anchor_information * used[:, None, None],
            anchor_gradient=self.anchor_gradient * used[:, None],
        )

    def chosen(self, used: np.ndarray) -> "ChainData":
        """Return only the captures of a mask (K,)."""
        if used.all():
            return self
        lengths = np.diff(self.offsets)
        points = np.repeat(used, lengths)
        each = (
            "rotations", "translations", "weights", "effective", "order", "pose_scale", "points_per_independent",
            "anchors", "anchor_information", "anchor_gradient", "radii_mm", "nuisance_of", "stop", "bent",
        )  # fmt: skip
        return replace(
            self,
            **{name: getattr(self, name)[used] for name in each},
            arm_columns=None if self.arm_columns is None else self.arm_columns[used],
            arm_moves=None if self.arm_moves is None else self.arm_moves[used],
            walk=self.walk.chosen(used),
            points=self.points[points],
            counts=self.counts[points],
            basis=self.basis[points],
            offsets=np.concatenate([[0], np.cumsum(lengths[used])]),
        )

    def of_one_scanner(self, which: int, axes: Sequence[AxisState]) -> "ChainData":
        """Return one scanner's captures of one ball alone, the axes under the robot known."""
        walk = self.walk
        if len(walk.layout.mounts) == len(walk.layout.places) == 1 and not walk.layout.axes:
            return self
        own = walk.scanner == which
        place = walk.main_place(own)
        some = self.chosen(own & (walk.place == place))
        alone = Layout((walk.layout.mounts[which],), (walk.layout.places[place],))
        kept, zero = some.nuisance_of[0], np.zeros(some.count, dtype=np.int64)
        turned, moved = some.walk.on_foot(axes)
        own = replace(
            some.walk,
            layout=alone,
            rotations=turned,
            translations=moved,
            scanner=zero,
            place=zero,
            readings=np.empty((some.count, 0)),
        )
        rotations, translations = own.across_robot()
        return replace(
            some,
            walk=own,
            rotations=rotations,
            translations=translations,
            nuisance_sigmas=self.nuisance_sigmas[kept],
            nuisance_of=np.tile(np.arange(len(kept)), (some.count, 1)),
            kinds=self.kinds[kept],
            stop=zero - 1,
            held=np.isin(np.arange(alone.unknowns), self.exact) | alone.fixed,
            distances=(),
        )

    def unlikely(self, shared: FloatArray) -> FloatArray:
        """Return how far errors that captures share (L,) are from what is believed, in standard deviations."""
        if self.arm_means is None:
            return shared
        off = shared.copy()
        off[len(shared) - len(self.arm_means) :] -= self.arm_means  # the last ones
        return off

    def own(self, values: FloatArray) -> FloatArray:
        """Return each capture's eight (K, 8) of the nuisances' values (N,)."""
        return values[self.nuisance_of]
