"""Turntable: base_from_turntable from a sphere that is fixed on the table and seen at several angles.

The model is centre = base_from_turntable · Rz(direction · scale · angle) · s_m, with a place s_m for each mounting
of the sphere.  Reads as a table of contents: find a start, fit jointly, reject what does not belong, then collect
the evidence: covariance, residuals along, across and around the axis, encoder scale, the paper's circles.

The tool is that of the stage before.  While captures are judged and scatters estimated it may move within its own
uncertainty, so that its error is not taken for theirs; the answer then holds it, because table and tool are used
together and belong together, and its uncertainty is carried into the answer's.  So is a tool that the captures of
the table see elsewhere, as far as that is more than chance: a scanner that was moved in between, by little.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.cell.layout import AxisState, KnownDistance, Layout, MovedAxis
from calib_core.cell.walk import Position
from calib_core.chain.arm_model import ArmModel
from calib_core.chain.arrays import chain_data, layout_of
from calib_core.chain.axes_balls import balls_on_axes
from calib_core.chain.axes_start import axes_guesses, axes_start
from calib_core.chain.bend import Bend, unbent
from calib_core.chain.circles import PaperAxis, paper_axis
from calib_core.chain.effective import with_effective_points
from calib_core.chain.held import Held, hold_files
from calib_core.chain.likelihood import fit, linearised_at
from calib_core.chain.mirrored import (
    JudgedTable,
    MirrorImage,
    likelier_side,
    mirror_spread,
    told_directions,
    with_spread,
)
from calib_core.chain.model import ChainData, ChainState, Sigmas, ToolPrior
from calib_core.chain.observations import (
    SphereObservation,
    SphereSize,
    TableObservation,
    TableObservations,
    pooled_point_sigma,
    with_own_sigmas,
)
from calib_core.chain.rejection import Judged, core_of
from calib_core.chain.scanner import ScannerPriors, corrected
from calib_core.chain.table_errors import table_errors_of
from calib_core.chain.table_frame import TableCovariance, TableFrame, frame_by_rule, frame_covariance
from calib_core.chain.table_judging import EncoderScale, EncoderScales, judge_table
from calib_core.chain.table_moves import TableMove
from calib_core.chain.table_patterns import Pattern
from calib_core.chain.table_residuals import TableResiduals, table_residuals
from calib_core.chain.table_start import Mounts, TableStart, both_centers_in_base, find_table_start, readings_of
from calib_core.chain.table_tool import ToolMove, tool_move
from calib_core.chain.tcp import TcpSolution, say_nothing
from calib_core.chain.variance import GivenSigmas
from calib_core.errors import MotionError
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform

Progress = Callable[[float, str], None]
_LEAST_CAPTURES = 4
_SAME_POSE_MM = 1e-6
_LEANED_RAD = np.deg2rad(10.0)


@dataclass(frozen=True)
class KnownTool:
    """The tool of the stage before, what was found of the scanner with it (None: both exact), and the two steps'.

    `mount_from_laser` is the answer of that stage, `arm` what its poses were corrected by, `bend` its points.
    Beside an exact one `late` has by name where others are about, whose places are sought with the table.  Where
    nothing places any, all of it is sought, beginning with what balls on axes say of themselves.
    """

    mount_from_laser: RigidTransform
    held: Held | None = None
    two_step: RigidTransform | None = None
    arm: ArmModel | None = None
    bend: Bend | None = None
    late: Mapping[str, RigidTransform] = field(default_factory=dict[str, RigidTransform])
    sought: TcpSolution | None = None

    @property
    def state(self) -> ChainState | None:
        """All that is known of scanners and of axes under the robot, or that a search begins with."""
        known = self.held or (self.sought and self.sought.held)
        return known and known.state

    @property
    def mounts(self) -> Mounts:
        """The answer of that stage, of several scanners by their names."""
        if self.late:
            return self.late
        state = self.state
        if state is None or len(state.walk.layout.mounts) == 1:
            return self.mount_from_laser
        return {name: state.mount(n) for n, (name, _) in enumerate(state.walk.layout.mounts)}


@dataclass(frozen=True)
class TurntableOptions:
    """Standard deviations that the user fixes (None: estimated), and what is asked of the encoder.

    `direction` is the cell's; `encoder_scale` asks for the encoder's scale as an unknown (False: never; None: if
    the captures leave no doubt that it is off).  `angles_unknown`: the angles were found from the captures.
    `axes`: those of the cell where it names them, with the standard deviations of their readings, rad or mm, and
    what is asked of each one's encoder.
    `distances`: known ones of balls on them.
    """

    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    point_sigma_mm: float | None = None
    angle_sigma_rad: float | None = None
    direction: int | None = None
    encoder_scale: bool | None = None
    angles_unknown: bool = False
    axes: tuple[MovedAxis, ...] = ()
    axis_sigmas: tuple[float | None, ...] = ()
    axis_scales: tuple[bool | None, ...] = ()
    distances: tuple[KnownDistance, ...] = ()
    priors: ScannerPriors = field(default_factory=ScannerPriors)

    def scale_asked(self, axis: int) -> bool | None:
        """Return what is asked of an axis's encoder, by the axis's number."""
        return self.axis_scales[axis] if self.axes else self.encoder_scale

    @property
    def sigmas(self) -> GivenSigmas:
        """Position, orientation, and the readings of all axes."""
        readings = self.axis_sigmas if self.axes else (self.angle_sigma_rad,)
        return self.position_sigma_mm, self.orientation_sigma_rad, *readings


@dataclass(frozen=True, eq=False)
class TurntableSolution:
    """The turntable with its evidence.

    Attributes
    ----------
    frame : TableFrame
    covariance : TableCovariance
    state : ChainState
        The unknowns as they were solved.
    sigmas : Sigmas
    point_sigma_mm : float or None
    mounts : tuple of str
        The mountings' names.
    captures, used, squared_distance, excess
        As `Judged` has them.
    residuals : TableResiduals
    circles : PaperAxis
        The paper's way on the same captures, by the two steps' tool where there is one.
    encoders : dict
    options : TurntableOptions
    unknowns_covariance : (P, P)
        Of the edges' unknowns.
    pattern : Pattern or None
        What repeats with the table's angle, beyond chance.
    move : TableMove or None
        How table or sphere moved in the course of the captures, beyond chance.
    tool_move : ToolMove or None
        How far the captures of the table see the tool elsewhere than those of the stage before.
    mirror : TableCovariance or None
        The part of `covariance` that is due to the answer mirrored at the plane of light.
    mirror_chance : float
        How likely that answer is.
    by_arm_mm : float
        How much those of the stage before scatter alike: the arm, not the table.
    """

    frame: TableFrame
    covariance: TableCovariance
    state: ChainState
    sigmas: Sigmas
    point_sigma_mm: float | None
    captures: list[str]
    mounts: tuple[str, ...]
    used: np.ndarray
    squared_distance: FloatArray
    excess: float
    residuals: TableResiduals
    circles: PaperAxis
    encoders: EncoderScales
    options: TurntableOptions
    unknowns_covariance: FloatArray
    pattern: Pattern | None = None
    move: TableMove | None = None
    tool_move: ToolMove | None = None
    mirror: TableCovariance | None = None
    mirror_chance: float = 0.0
    by_arm_mm: float = 0.0

    @property
    def encoder(self) -> EncoderScale:
        """How the encoder counts of the axis that carries the sphere."""
        return self.encoders[self.state.walk.layout.table]

    @property
    def turns(self) -> bool:
        """Whether the axis that carries the sphere is rotary."""
        layout = self.state.walk.layout
        return layout.axes[layout.table].kind == "rotary"

    @property
    def tilted(self) -> bool:
        """Whether a rotary axis under it leaned the one that carries the sphere: that tells its direction, too."""
        walk, axes = self.state.walk, self.state.position.axes
        layout = walk.layout
        on_it = np.isin(walk.place, layout.on_axis(layout.table))
        under = layout.axes[layout.table].on
        for a in reversed(range(layout.table)):
            edge, across = layout.axes[a], np.cross(axes[a].rotation[:, 2], axes[layout.table].rotation[:, 2])
            if edge.name == under:
                under = edge.on
                leaned = np.linalg.norm(across) * np.ptp(walk.readings[on_it, a])
                if edge.kind == "rotary" and leaned > _LEANED_RAD:
                    return True
        return False

    @property
    def reading_sigma(self) -> float:
        """The standard deviation of that axis's readings, rad or mm."""
        return self.sigmas.axes[self.state.walk.layout.table] if self.sigmas.axes else 0.0


def solve_turntable(
    observations: TableObservations,
    sphere: SphereSize,
    tool: KnownTool,
    options: TurntableOptions | None = None,
    progress: Progress | None = None,
) -> TurntableSolution:
    """Return the turntable's axis and frame from captures of a sphere on it.

    Parameters
    ----------
    observations : captures of kinds profile, cloud and center, of one or more mountings
    sphere : SphereSize
    tool : KnownTool
    options : TurntableOptions, optional
    progress : callable, optional
        Called with the fraction done and what is being done.

    Raises
    ------
    MotionError
        If there are too few captures or angles, or the sphere does not move with the table.
    InputError
        If the angles are in radians.
    """
    options = options or TurntableOptions()
    tell = progress or say_nothing
    _require_captures(observations)
    observations = table_with_effective_points(observations, sphere)
    if tool.held is not None and tool.held.applied:
        observations = corrected_table(observations, tool.held)

    tell(0.1, "Searching the axis and the sphere's sides")
    start = _start(observations, sphere, tool, options)

    tell(0.3, "Fitting all captures of the table jointly")
    options = _with_still_robot(observations, options)
    point_sigma = options.point_sigma_mm or pooled_point_sigma([o.sphere for o in observations], sphere)
    observations = with_table_sigmas(observations, sphere, options.point_sigma_mm)
    data = _data(observations, sphere, point_sigma, tool, options)
    flat = [o.placed for o in observations]
    begin = _start_state(data, tool, start)
    spheres, bent = unbent(flat, data, begin, tool.bend)
    judged, encoders, image = _judge(spheres, bent, begin, core_of(start.misfit_mm), options)
    if tool.bend is not None:  # where the balls are is known better now
        spheres, bent = unbent(flat, data, judged.fit.state, tool.bend)
        judged, encoders, image = _judge(spheres, bent, judged.fit.state, judged.used, options)
    observations = [o.seen_as(sphere) for o, sphere in zip(observations, spheres, strict=True)]

    tell(0.7, "Holding the tool")
    move = tool_move(judged)
    errors = table_errors_of(judged, len(observations))
    state, covariance = _tool_held(judged, tool, move)
    covariance = _less_sure(covariance, errors.spread, None if tool.sought else data.walk.layout.of_mounts)
    spread = mirror_spread(bent, state, image)
    covariance = with_spread(covariance, spread)

    tell(0.8, "Testing the encoder, drawing the paper's circles")
    size = data.walk.layout.axis_and_places(data.walk.layout.table)
    frame = frame_by_rule(state.table, options.direction)
    residuals = table_residuals(observations, data.walk, state, frame)
    return TurntableSolution(
        frame=frame,
        covariance=frame_covariance(state.table, covariance[np.ix_(size, size)], options.direction),
        state=state,
        sigmas=judged.fit.sigmas,
        point_sigma_mm=point_sigma,
        captures=[o.sphere.capture for o in observations],
        mounts=state.walk.layout.mountings,
        used=judged.used,
        squared_distance=judged.squared_distance,
        excess=judged.excess,
        residuals=residuals,
        circles=paper_circles(observations, sphere, tool, residuals.sides, judged.used),
        encoders=encoders,
        options=options,
        unknowns_covariance=covariance,
        pattern=errors.pattern,
        move=errors.move,
        tool_move=move,
        mirror=mirror_of(spread, state, options.direction),
        mirror_chance=image.chance if image else 0.0,
        by_arm_mm=tool.held.sigmas.largest_position_mm if tool.held else 0.0,
    )


def _less_sure(covariance: FloatArray, spread: FloatArray, mounts: np.ndarray | None) -> FloatArray:
    """Return a covariance with another one of its unknowns added, but for mounts that are held."""
    added = spread[: len(covariance), : len(covariance)].copy()
    if mounts is not None:
        added[mounts], added[:, mounts] = 0.0, 0.0
    return covariance + added


def mirror_of(spread: FloatArray, state: ChainState, direction: int | None) -> TableCovariance | None:
    """Return a spread by the mirrored answer as the table's covariance, None where there is none."""
    layout = state.walk.layout
    size = layout.axis_and_places(layout.table)
    return frame_covariance(state.table, spread[np.ix_(size, size)], direction) if spread.any() else None


def paper_circles(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, sides: np.ndarray, used: np.ndarray
) -> PaperAxis:
    """Return the paper's circles and axis through the captures' own centres, by the two steps' tool if any."""
    both = both_centers_in_base(observations, sphere, _by_paper(tool))
    centers = np.where(sides[:, None] >= 0, both[:, 0], both[:, 1])
    if any(o.sphere.readings for o in observations):  # other axes moved as well: no circles
        return PaperAxis([], None, None)
    return paper_axis(centers, readings_of(observations)[0].mounts, used)


def _by_paper(tool: KnownTool) -> Mounts:
    if tool.two_step is None:
        return tool.mounts
    return tool.two_step if isinstance(tool.mounts, RigidTransform) else tool.mounts


def _require_captures(observations: TableObservations) -> None:
    if len(observations) < _LEAST_CAPTURES:
        need = "at least {least_captures} captures of the sphere on the turntable (better 8 at each of 2 heights)"
        to_do = "Turn the table by 45° and capture the sphere again, all around; then do so at a second height."
        raise MotionError(need, str(len(observations)), to_do, least_captures=_LEAST_CAPTURES)


def _with_still_robot(observations: TableObservations, options: TurntableOptions) -> TurntableOptions:
    """Return options in which a robot that stood still throughout has no orientation scatter to be estimated."""
    poses = np.array([o.sphere.base_from_tool0.matrix for o in observations])
    if options.orientation_sigma_rad is None and np.abs(poses - poses[0]).max() < _SAME_POSE_MM:
        return replace(options, orientation_sigma_rad=0.0)
    return options


def _data(
    observations: TableObservations,
    sphere: SphereSize,
    point_sigma: float | None,
    tool: KnownTool,
    options: TurntableOptions,
) -> ChainData:
    placed, known = [o.placed for o in observations], tool.held
    layout = _layout(observations, tool, options)
    data = chain_data(placed, sphere, point_sigma, options.priors if tool.sought else None, layout)
    data = replace(data, distances=layout.apart(options.distances))
    for axis in layout.carrying:
        data = data.holding(layout.scale(axis), not options.scale_asked(axis))
    if tool.sought:
        return tool.sought.shifts.holding(data)
    for n, axis in enumerate(layout.axes):
        if axis.carries == "robot":  # known with the tool, or never moved
            data = data.holding(layout.axis(n))
    if known is None:
        first = layout.mount(0)
        return data.holding(np.arange(first.start, first.stop))
    some = known.mounts_and_scanners
    found = known.found
    # Where points are corrected by what was found, its uncertainty is left.
    values = np.where(known.data.of_files, 0.0, found.scanner) if known.applied else found.scanner
    mounts = found.position.mount_rotations, found.position.mount_translations
    prior = ToolPrior(*mounts, values, covariance_of(known.covariance[np.ix_(some, some)]))
    sigmas = np.zeros(len(data.kinds))
    sigmas[known.active] = 1.0  # the prior of the tool and the scanner together takes their place
    return replace(data, tool_prior=prior, nuisance_sigmas=sigmas)


def _layout(observations: TableObservations, tool: KnownTool, options: TurntableOptions) -> Layout:
    layout = layout_of([o.placed for o in observations], options.axes)
    return layout if tool.state is None else replace(layout, mounts=tool.state.walk.layout.mounts)


def _start(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> TableStart:
    """Return where the fit starts: by circles about one axis, or by all axes' directions."""
    if not options.axes:
        return find_table_start(observations, sphere, tool.mounts)
    data, centers = start_data(observations, sphere, tool, options)
    position, misfit = axes_start(data.walk, centers, _mounts(tool), _known_axes(tool))
    state = ChainState.at(data, position)
    return TableStart(state.table, np.zeros(len(observations)), misfit, position)


def balls_of_arcs(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> np.ndarray | None:
    """Return which ball of its mounting each arc is of, as `balls_on_axes` does."""
    data, centers = start_data(observations, sphere, tool, options)
    return balls_on_axes(data.walk, centers, axes_guesses(data.walk, centers, _mounts(tool), _known_axes(tool)))


def start_data(
    observations: TableObservations, sphere: SphereSize, tool: KnownTool, options: TurntableOptions
) -> tuple[ChainData, FloatArray]:
    """Return captures as arrays and their balls' possible centres in base."""
    layout = _layout(observations, tool, options)
    data = chain_data([o.placed for o in observations], sphere, None, layout=layout)
    return data, both_centers_in_base(observations, sphere, tool.mounts)


def _known_axes(tool: KnownTool) -> dict[str, AxisState]:
    """Return the axes that were found with the tool."""
    if (state := tool.state) is None:
        return {}
    return {axis.name: at for axis, at in zip(state.walk.layout.axes, state.position.axes, strict=True)}


def _mounts(tool: KnownTool) -> tuple[FloatArray, FloatArray]:
    if tool.state is None:
        every = list(tool.late.values()) or [tool.mount_from_laser]
        return np.array([one.rotation for one in every]), np.array([one.translation_mm for one in every])
    answer = tool.state.position
    return answer.mount_rotations, answer.mount_translations


def table_with_effective_points(observations: TableObservations, sphere: SphereSize) -> list[TableObservation]:
    """Return captures of the table that say how many of their points count as one independent one."""
    spheres = with_effective_points([o.sphere for o in observations], sphere)
    return [replace(o, sphere=s) for o, s in zip(observations, spheres, strict=True)]


def with_table_sigmas(
    observations: TableObservations, sphere: SphereSize, told_mm: float | None
) -> list[TableObservation]:
    """Return captures of the table by several scanners with the points' noise of each."""
    spheres = with_own_sigmas([o.sphere for o in observations], sphere, told_mm)
    return [replace(o, sphere=s) for o, s in zip(observations, spheres, strict=True)]


def corrected_table(observations: TableObservations, held: Held) -> list[TableObservation]:
    """Return captures of the table as a scanner without the errors that were found would have made them."""
    widths = [np.abs(o.sphere.points_in_laser_mm[:, 0]).max(initial=1.0) for o in observations]
    half_width = float(max(widths))
    names = [name for name, _ in held.state.walk.layout.mounts]
    values = [held.found.scanner[held.nuisance_row(names.index(o.sphere.scanner))] for o in observations]
    return [
        replace(o, sphere=corrected(o.sphere, own, half_width))
        for o, own in zip(observations, values, strict=True)
    ]


def _start_state(data: ChainData, tool: KnownTool, start: TableStart) -> ChainState:
    at = start.position or Position(*_mounts(tool), start.state.mounts, (start.state.axis,))
    state = ChainState.at(data, at)
    if data.tool_prior is not None:
        known = data.tool_prior
        state = replace(state.with_mounts_of(known.rotations, known.translations), scanner=known.scanner)
    return state


def _judge(
    spheres: list[SphereObservation],
    data: ChainData,
    state: ChainState,
    core: np.ndarray,
    options: TurntableOptions,
) -> tuple[Judged, EncoderScales, MirrorImage | None]:
    def judge(there: ChainState, core: np.ndarray) -> JudgedTable:
        return judge_table(spheres, data, there, core, options.sigmas, options.scale_asked)

    judged, image = likelier_side(spheres, state, core, judge, told_directions(options.axes, options.direction))
    return *judged, image


def _tool_held(judged: Judged, tool: KnownTool, move: ToolMove | None) -> tuple[ChainState, FloatArray]:
    """Return the unknowns with tool and scanner held, and their covariance with those' carried over.

    About the minimum the table follows tool and scanner by −H⁻¹ H_tool, with H of the other unknowns.
    """
    fitted = judged.fit
    if tool.sought:
        sought = hold_files(judged, False)
        return sought.state, sought.covariance
    if tool.held is None:
        return fitted.state, fitted.covariance * judged.inflation
    known, data = tool.held, judged.data
    mounts = data.walk.layout.of_mounts
    nothing = np.zeros(len(data.kinds))
    exact = replace(data.holding(mounts), tool_prior=None, nuisance_sigmas=nothing)
    answer = known.state.position
    begin = replace(
        fitted.state.with_mounts_of(answer.mount_rotations, answer.mount_translations),
        scanner=np.where(data.of_files, 0.0, known.state.scanner),
    )
    found = fit(exact, begin, fitted.sigmas)
    width = data.unknowns
    inverse = covariance_of(found.at.hessian)
    as_if_known = covariance_of(fitted.minimum.at.hessian)
    # By how much estimated sigmas enlarged the covariance of the fit with the tool free, so they do here.
    free = np.setdiff1d(np.arange(width), mounts)
    grown = np.sqrt(np.maximum(np.diag(fitted.covariance)[free] / np.diag(as_if_known)[free], 1.0))
    own = inverse[:width, :width].copy()
    own[np.ix_(free, free)] *= np.outer(grown, grown) * judged.inflation
    sigmas = nothing.copy()
    sigmas[known.active] = 1.0
    every = np.zeros(width, dtype=bool)
    whole = linearised_at(
        replace(data, held=every, tool_prior=None, nuisance_sigmas=sigmas), found.state, fitted.sigmas
    )
    # Errors that poses share are eliminated with the table's unknowns: they follow too.
    count, size = len(known.active), len(whole.hessian)
    by = np.concatenate([mounts, np.arange(width, width + count)])
    rest = np.setdiff1d(np.arange(size), by)
    rest = rest[~np.isin(rest, np.flatnonzero(exact.held))]
    follows = np.zeros((size, len(by)))
    follows[rest] = -covariance_of(whole.hessian[np.ix_(rest, rest)]) @ whole.hessian[np.ix_(rest, by)]
    follows = follows[:width]
    some = known.mounts_and_scanners
    carried = known.covariance[np.ix_(some, some)]
    if move is not None:
        carried = carried + move.share * np.outer(move.off, move.off)
    return found.state, own + follows @ carried @ follows.T
