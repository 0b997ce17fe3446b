"""Turntable: base_from_turntable from a sphere that is fixed on the table and seen at several angles.

The model is centre = base_from_turntable · Rz(direction · scale · angle) · s_m, with a place s_m for each mounting
of the sphere.  Reads as a table of contents: find a start, fit jointly, reject what does not belong, then collect
the evidence: covariance, residuals along, across and around the axis, encoder scale, the paper's circles.

The tool is that of the stage before.  While captures are judged and scatters estimated it may move within its own
uncertainty, so that its error is not taken for theirs; the answer then holds it, because table and tool are used
together and belong together, and its uncertainty is carried into the answer's.  So is a tool that the captures of
the table see elsewhere, as far as that is more than chance: a scanner that was moved in between, by little.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calib_core.chain.bend import unbent
from calib_core.chain.chain_data import ChainData, Sigmas
from calib_core.chain.circles import PaperAxis, paper_axis
from calib_core.chain.encoder_scales import EncoderScale, EncoderScales
from calib_core.chain.mirrored import (
    JudgedTable,
    MirrorImage,
    likelier_side,
    mirror_spread,
    told_directions,
    with_spread,
)
from calib_core.chain.model import ChainState
from calib_core.chain.observations import (
    SphereObservation,
    SphereSize,
    TableObservations,
    pooled_point_sigma,
)
from calib_core.chain.rejection import Judged, core_of
from calib_core.chain.table_captures import (
    corrected_table,
    require_captures,
    start_of,
    start_state,
    table_data,
    table_with_effective_points,
    with_table_sigmas,
)
from calib_core.chain.table_errors import table_errors_of
from calib_core.chain.table_frame import TableCovariance, TableFrame, frame_by_rule, frame_covariance
from calib_core.chain.table_given import KnownTool, TurntableOptions
from calib_core.chain.table_held import with_tool_held
from calib_core.chain.table_judging import judge_table
from calib_core.chain.table_moves import TableMove
from calib_core.chain.table_patterns import Pattern
from calib_core.chain.table_residuals import TableResiduals, table_residuals
from calib_core.chain.table_start import Mounts, both_centers_in_base, readings_of
from calib_core.chain.table_tool import ToolMove, tool_move
from calib_core.chain.tcp import say_nothing
from calib_core.frames import FloatArray, RigidTransform

Progress = Callable[[float, str], None]
_SAME_POSE_MM = 1e-6
_LEANED_RAD = np.deg2rad(10.0)


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
    image : MirrorImage or None
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
    image: MirrorImage | None = None
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
    require_captures(observations)
    observations = table_with_effective_points(observations, sphere)
    if tool.held is not None and tool.held.applied:
        observations = corrected_table(observations, tool.held)

    tell(0.1, "Searching the axis and the sphere's sides")
    start = start_of(observations, sphere, tool, options)

    tell(0.3, "Fitting all captures of the table jointly")
    options = _with_still_robot(observations, options)
    point_sigma = options.point_sigma_mm or pooled_point_sigma([o.sphere for o in observations], sphere)
    observations = with_table_sigmas(observations, sphere, options.point_sigma_mm)
    data = table_data(observations, sphere, point_sigma, tool, options)
    flat = [o.placed for o in observations]
    begin = start_state(data, tool, start)
    spheres, bent = unbent(flat, data, begin, tool.bends)
    judged, encoders, image = _judge(spheres, bent, begin, core_of(start.misfit_mm), options)
    if tool.bends:  # where the balls are is known better now
        spheres, bent = unbent(flat, data, judged.fit.state, tool.bends)
        judged, encoders, image = _judge(spheres, bent, judged.fit.state, judged.used, options)
    observations = [o.seen_as(sphere) for o, sphere in zip(observations, spheres, strict=True)]

    tell(0.7, "Holding the tool")
    move = tool_move(judged)
    errors = table_errors_of(judged, len(observations))
    state, covariance = with_tool_held(judged, tool, move)
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
        image=image,
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


def _with_still_robot(observations: TableObservations, options: TurntableOptions) -> TurntableOptions:
    """Return options in which a robot that stood still throughout has no orientation scatter to be estimated."""
    poses = np.array([o.sphere.base_from_tool0.matrix for o in observations])
    if options.orientation_sigma_rad is None and np.abs(poses - poses[0]).max() < _SAME_POSE_MM:
        return replace(options, orientation_sigma_rad=0.0)
    return options


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
