"""What the captures say, as arrays, the unknowns, and where these expect each capture's ball.

Unknown are the edges' (`cell.layout`): mounts of scanners, places of balls, axes; then the balls' radii and the
scanners' errors, where they are uncertain (`chain.scanner`); last what is drawn rather than fixed: pose errors
that captures share, each of unit variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib_core.cell.layout import AxisState, KnownDistance, Layout
from calib_core.cell.walk import Position, Walk
from calib_core.chain import scanner
from calib_core.chain.table import TableState
from calib_core.frames import FloatArray, RigidTransform

ARM_SCALE_SIGMA = 2e-4
"""How far an arm's lengths are off, as a share: beyond what its maker promises the captures must show it."""

DRIFT_SIGMA_MM = 0.04
"""How far the sphere drifts from a session's middle to its end, per axis: warmth, settling."""

_UNTOLD_LEVER_MM = 150.0  # scanners and balls sit one to three decimetres from the flange, in some direction
_PLACE_PRIOR = 1e-10  # 1/mm²: keeps a place finite all of whose captures were rejected


@dataclass(frozen=True)
class Sigmas:
    """Standard deviations, per axis, of a robot pose's position and orientation, and of the readings of axes.

    `axes` are in rad or mm, as the cell lists them.  `alike` are those of the part that captures share where their
    poses are alike; `reach` is a factor on the distances over which they are.  `freedom` says how well a pose's
    whole scatter is known: as well as from so many degrees of freedom.
    """

    position_mm: float
    orientation_rad: float
    axes: tuple[float, ...] = ()
    alike_position_mm: float = 0.0
    alike_orientation_rad: float = 0.0
    reach: float = 1.0
    freedom: float = np.inf

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

    def deviation(self, state: "ChainState") -> FloatArray:
        """Return how far a state is from it, (6 S + n,): small, so that the rotation counts as a vector."""
        turned = np.swapaxes(self.rotations, 1, 2) @ state.position.mount_rotations
        turn = 0.5 * (turned - np.swapaxes(turned, 1, 2))
        shift = state.position.mount_translations - self.translations
        off = np.column_stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0], shift]).ravel()
        return np.concatenate([off, (state.scanner - self.scanner)[state.active]])


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
    stop : (K,) int
        Captures of several scanners at one stop of the robot, whose error is common, have one number; −1: alone.
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
            "anchors", "anchor_information", "anchor_gradient", "radii_mm", "nuisance_of", "stop",
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


@dataclass(frozen=True, eq=False)
class ChainState:
    """One guess of the unknowns, and of where each capture's own ball's centre lies in L.

    `scanner` (N,) holds what is added to the told radii and the scanners' errors, of which `active` (n,) are
    sought; `shared` (L,) the pose errors that captures share.
    """

    walk: Walk
    position: Position
    nominal_radius_mm: float
    centers_in_laser: FloatArray
    scanner: FloatArray
    active: np.ndarray
    shared: FloatArray | None = None

    @classmethod
    def predicted(
        cls,
        data: ChainData,
        tool_rotation: FloatArray,
        tool_translation: FloatArray,
        center: FloatArray,
        table: TableState | None = None,
    ) -> "ChainState":
        """Return a guess of one scanner, one still ball and a turntable, in which every pose is taken as exact."""
        layout = data.walk.layout
        places = np.tile(np.asarray(center, dtype=float), (len(layout.places), 1))
        axes: tuple[AxisState, ...] = ()
        if table is not None:
            places[layout.on_axis(layout.table)] = table.mounts
            axes = (table.axis,)
        mount = np.array(tool_rotation, dtype=float)[None], np.array(tool_translation, dtype=float)[None]
        return cls.at(data, Position(*mount, places, axes))

    @classmethod
    def at(cls, data: ChainData, position: Position) -> "ChainState":
        """Return a guess of all edges, in which every pose and reading is taken as exact."""
        values = np.zeros(len(data.nuisance_sigmas))
        guess = cls(data.walk, position, data.radius_mm, np.empty((0, 3)), values, data.active)
        return replace(guess, centers_in_laser=prediction(data, guess).centers_in_laser)

    def moved(self, step: FloatArray) -> "ChainState":
        """Return the unknowns after a step (P,); the captures' own centres stay."""
        layout = self.walk.layout
        width = layout.unknowns
        last = width + len(self.active)
        values = self.scanner.copy()
        values[self.active] += step[width:last]
        shared = None if self.shared is None else self.shared + step[last:]
        return replace(self, position=self.position.moved(layout, step), scanner=values, shared=shared)

    def with_mounts_of(self, rotations: FloatArray, translations: FloatArray) -> "ChainState":
        """Return the same with the mounts (S, 3, 3), (S, 3) of another guess."""
        return replace(
            self, position=replace(self.position, mount_rotations=rotations, mount_translations=translations)
        )

    def step_to(self, other: "ChainState") -> FloatArray:
        """Return the step of the edges' unknowns that leads from this state to another one that is near."""
        return self.position.step_to(self.walk.layout, other.position)

    @property
    def tool_rotation(self) -> FloatArray:
        """Of the first scanner's mount, (3, 3)."""
        return self.position.mount_rotations[0]

    @property
    def tool_translation(self) -> FloatArray:
        """Of the first scanner's mount, (3,)."""
        return self.position.mount_translations[0]

    @property
    def center(self) -> FloatArray:
        """The first ball's centre in what carries it, (3,)."""
        return self.position.places[0]

    @property
    def table(self) -> TableState:
        """The last axis that carries a ball, with the places on it."""
        return self.axis_with_places(self.walk.layout.table)

    def axis_with_places(self, which: int) -> TableState:
        """Return an axis with the places that it carries itself."""
        layout, at = self.walk.layout, self.position
        axis, linear = at.axes[which], layout.axes[which].kind == "linear"
        return TableState(axis.rotation, axis.origin, at.places[layout.on_axis(which)], axis.scale, linear)

    @property
    def radius_mm(self) -> float:
        """The first ball's radius."""
        return self.nominal_radius_mm + float(self.scanner[0])

    @property
    def mount_from_laser(self) -> RigidTransform:
        """The first scanner's pose on what carries it."""
        return self.mount(0)

    def mount(self, which: int) -> RigidTransform:
        """Return a scanner's pose on what carries it."""
        at, carrier = self.position, self.walk.layout.mounts[which][1]
        return RigidTransform.of(at.mount_rotations[which], at.mount_translations[which], carrier, "laser")

    @property
    def tool_in_laser(self) -> FloatArray:
        """The arm from the flange to the origin of L, in L, (3,), mm."""
        return self.tool_rotation.T @ self.tool_translation


@dataclass(frozen=True, eq=False)
class Prediction:
    """Where the unknowns expect each capture's ball.

    Attributes
    ----------
    centers_in_laser : (K, 3)
    jacobian : (K, 3, P)
        Of these by the unknowns; zero for held ones.
    levers : (K, 3, A) or None
        Of these by the readings of the axes, mm/rad and mm/mm.
    """

    centers_in_laser: FloatArray
    jacobian: FloatArray
    levers: FloatArray | None


def prediction(data: ChainData, state: ChainState) -> Prediction:
    """Return where the unknowns expect each capture's ball in L, poses and readings taken as recorded."""
    from calib_core.kernels.chain import predict_centers

    count, walk, at = data.count, data.walk, state.position
    balls, by_edges, levers = walk.balls(at)
    predicted, narrow = np.empty((count, 3)), np.empty((count, 3, 9))
    # A transform's own arrays are read-only and strided: numba would compile another kernel for them.
    mounts = np.require(at.mount_rotations, None, ["C", "W"]), np.require(at.mount_translations, None, ["C", "W"])
    predict_centers(data.rotations, data.translations, *mounts, walk.scanner, balls, predicted, narrow)
    jacobian = narrow
    if by_edges is not None and levers is not None:
        jacobian, levers = narrow[:, :, 6:9] @ by_edges, narrow[:, :, 6:9] @ levers
    elif data.unknowns > 9:
        jacobian = np.zeros((count, 3, data.unknowns))
        jacobian[:, :, 6:9] = narrow[:, :, 6:9]
    if jacobian is not narrow:
        for n in range(len(walk.layout.mounts)):
            own = walk.scanner == n
            jacobian[own, :, walk.layout.mount(n)] = narrow[own, :, :6]
    if data.held.any():
        jacobian[:, :, data.held] = 0.0
    return Prediction(predicted, jacobian, levers)


def prior(data: ChainData, state: ChainState, shared: int) -> tuple[float, FloatArray, FloatArray]:
    """Return cost, gradient (P,) and Hessian (P, P) of what is known beside the captures.

    A held unknown gets a one in the Hessian, so that its row does not vanish.
    """
    active, layout = data.active, data.walk.layout
    width, last = data.unknowns, data.width
    diagonal = np.zeros(last + shared)
    for n in range(len(layout.places)):
        if n or layout.places[0][0] not in ("base", "tool0"):
            diagonal[layout.place(n)] = _PLACE_PRIOR
    diagonal[:width][data.held] = 1.0
    cost, gradient = 0.0, np.zeros_like(diagonal)
    if data.tool_prior is None:
        sigmas = data.nuisance_sigmas[active]
        off = state.scanner[active] / sigmas
        cost += 0.5 * float(off @ off)
        gradient[width:last] = off / sigmas
        diagonal[width:last] = 1 / sigmas**2
    if state.shared is not None and shared:
        off = data.unlikely(state.shared)
        cost += 0.5 * float(off @ off)
        gradient[last:] = off
        diagonal[last:] = 1.0
    hessian = np.diag(diagonal)
    if data.tool_prior is not None:
        at = data.known_columns
        deviation = data.tool_prior.deviation(state)
        gradient[at] += data.tool_prior.information @ deviation
        cost += 0.5 * float(deviation @ data.tool_prior.information @ deviation)
        hessian[np.ix_(at, at)] += data.tool_prior.information
    for one, other, known in data.distances:
        apart = state.position.places[other] - state.position.places[one]
        distance = float(np.linalg.norm(apart))
        row = np.zeros(len(diagonal))
        row[layout.place(one)], row[layout.place(other)] = -apart / distance, apart / distance
        cost += 0.5 * ((distance - known.mm) / known.sigma_mm) ** 2
        gradient += row * (distance - known.mm) / known.sigma_mm**2
        hessian += np.outer(row, row) / known.sigma_mm**2
    return cost, gradient, hessian
