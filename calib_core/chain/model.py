"""The unknowns, where they expect each capture's ball, and what is known of them beside the captures.

Unknown are the edges' (`cell.layout`): mounts of scanners, places of balls, axes; then the balls' radii and the
scanners' errors, where they are uncertain (`chain.scanner`); last what is drawn rather than fixed: pose errors
that captures share, each of unit variance.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import AxisState
from calib_core.cell.walk import Position, Walk
from calib_core.chain.chain_data import ChainData, ToolPrior
from calib_core.chain.table import TableState
from calib_core.frames import FloatArray, RigidTransform

_PLACE_PRIOR = 1e-10  # 1/mm²: keeps a place finite all of whose captures were rejected


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


def off_known_tool(known: ToolPrior, state: ChainState) -> FloatArray:
    """Return how far a state is from a known tool, (6 S + n,): small, so that the rotation counts as a vector."""
    turned = np.swapaxes(known.rotations, 1, 2) @ state.position.mount_rotations
    turn = 0.5 * (turned - np.swapaxes(turned, 1, 2))
    shift = state.position.mount_translations - known.translations
    off = np.column_stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0], shift]).ravel()
    return np.concatenate([off, (state.scanner - known.scanner)[state.active]])


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
        deviation = off_known_tool(data.tool_prior, state)
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
