"""Turntable: base_from_turntable from a sphere that is fixed on the table and seen at several angles.

The model is centre = base_from_turntable · Rz(direction · scale · angle) · s_m, with a place s_m for each mounting
of the sphere.  Reads as a table of contents: find a start, fit jointly, reject what does not belong, then collect
the evidence: covariance, residuals along, across and around the axis, encoder scale, the paper's circles.

The tool is that of the stage before.  While captures are judged and scatters estimated it may move within its own
uncertainty, so that its error is not taken for theirs; the answer then holds it, because table and tool are used
together and belong together, and its uncertainty is carried into the answer's.  So is a tool that the captures of
the table see elsewhere, as far as that is more than chance: a scanner that was moved in between, by little.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib_core.chain.arrays import chain_data
from calib_core.chain.circles import PaperAxis, paper_axis
from calib_core.chain.effective import with_effective_points
from calib_core.chain.held import Held
from calib_core.chain.likelihood import fit, linearised_at
from calib_core.chain.model import ChainData, ChainState, Sigmas, ToolPrior
from calib_core.chain.observations import SphereSize, TableObservation
from calib_core.chain.rejection import Judged, core_of
from calib_core.chain.scanner import COUNT, OF_FILES, ScannerPriors, corrected
from calib_core.chain.table import SCALE_COLUMN
from calib_core.chain.table_frame import TableCovariance, TableFrame, frame_by_rule, frame_covariance
from calib_core.chain.table_judging import TABLE_COLUMN, EncoderScale, judge_table
from calib_core.chain.table_patterns import Pattern, pattern_of
from calib_core.chain.table_residuals import TableResiduals, table_residuals
from calib_core.chain.table_start import TableStart, both_centers_in_base, find_table_start, readings_of
from calib_core.chain.table_tool import ToolMove, tool_move
from calib_core.chain.tcp import pooled_point_sigma, say_nothing
from calib_core.chain.variance import GivenSigmas
from calib_core.errors import MotionError
from calib_core.estimation import covariance_of
from calib_core.frames import FloatArray, RigidTransform

Progress = Callable[[float, str], None]
_LEAST_CAPTURES = 4
_SAME_POSE_MM = 1e-6


@dataclass(frozen=True)
class KnownTool:
    """The tool of the stage before, what was found of the scanner with it (None: both exact), and the two steps'.

    `mount_from_laser` is the answer of that stage.
    """

    mount_from_laser: RigidTransform
    held: Held | None = None
    two_step: RigidTransform | None = None


@dataclass(frozen=True)
class TurntableOptions:
    """Standard deviations that the user fixes (None: estimated), and what is asked of the encoder.

    `direction` is the cell's; `encoder_scale` asks for the encoder's scale as an unknown (False: never; None: if
    the captures leave no doubt that it is off).  `angles_unknown`: the angles were found from the captures.
    """

    position_sigma_mm: float | None = None
    orientation_sigma_rad: float | None = None
    point_sigma_mm: float | None = None
    angle_sigma_rad: float | None = None
    direction: int | None = None
    encoder_scale: bool | None = None
    angles_unknown: bool = False
    priors: ScannerPriors = field(default_factory=ScannerPriors)

    @property
    def sigmas(self) -> GivenSigmas:
        """Position, orientation, angle."""
        return self.position_sigma_mm, self.orientation_sigma_rad, self.angle_sigma_rad


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
    encoder : EncoderScale
    options : TurntableOptions
    pattern : Pattern or None
        What repeats with the table's angle, beyond chance.
    tool_move : ToolMove or None
        How far the captures of the table see the tool elsewhere than those of the stage before.
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
    encoder: EncoderScale
    options: TurntableOptions
    pattern: Pattern | None = None
    tool_move: ToolMove | None = None
    by_arm_mm: float = 0.0


def solve_turntable(
    observations: Sequence[TableObservation],
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
    start = find_table_start(observations, sphere, tool.mount_from_laser)

    tell(0.3, "Fitting all captures of the table jointly")
    options = _with_still_robot(observations, options)
    point_sigma = options.point_sigma_mm or pooled_point_sigma([o.sphere for o in observations], sphere)
    data = _data(observations, sphere, point_sigma, tool, options)
    judged, encoder = _judge(observations, data, tool, start, options)

    tell(0.7, "Holding the tool")
    move = tool_move(judged)
    state, covariance = _tool_held(judged, tool, move)

    tell(0.8, "Testing the encoder, drawing the paper's circles")
    readings, mounts = readings_of(observations)
    size = slice(TABLE_COLUMN, data.unknowns)
    assert state.table is not None
    frame = frame_by_rule(state.table, options.direction)
    residuals = table_residuals(observations, readings, state, frame)
    return TurntableSolution(
        frame=frame,
        covariance=frame_covariance(state.table, covariance[size, size], options.direction),
        state=state,
        sigmas=judged.fit.sigmas,
        point_sigma_mm=point_sigma,
        captures=[o.sphere.capture for o in observations],
        mounts=mounts,
        used=judged.used,
        squared_distance=judged.squared_distance,
        excess=judged.excess,
        residuals=residuals,
        circles=paper_circles(observations, sphere, tool, residuals.sides, judged.used),
        encoder=encoder,
        options=options,
        pattern=pattern_of(judged, TABLE_COLUMN),
        tool_move=move,
        by_arm_mm=tool.held.sigmas.largest_position_mm if tool.held else 0.0,
    )


def paper_circles(
    observations: Sequence[TableObservation],
    sphere: SphereSize,
    tool: KnownTool,
    sides: np.ndarray,
    used: np.ndarray,
) -> PaperAxis:
    """Return the paper's circles and axis through the captures' own centres, by the two steps' tool if any."""
    both = both_centers_in_base(observations, sphere, tool.two_step or tool.mount_from_laser)
    centers = np.where(sides[:, None] >= 0, both[:, 0], both[:, 1])
    return paper_axis(centers, readings_of(observations)[0].mounts, used)


def _require_captures(observations: Sequence[TableObservation]) -> None:
    if len(observations) < _LEAST_CAPTURES:
        raise MotionError(
            f"at least {_LEAST_CAPTURES} captures of the sphere on the turntable (better 8 at each of 2 heights)",
            str(len(observations)),
            "Turn the table by 45° and capture the sphere again, all around; then do so at a second height.",
        )


def _with_still_robot(observations: Sequence[TableObservation], options: TurntableOptions) -> TurntableOptions:
    """Return options in which a robot that stood still throughout has no orientation scatter to be estimated."""
    poses = np.array([o.sphere.base_from_tool0.matrix for o in observations])
    if options.orientation_sigma_rad is None and np.abs(poses - poses[0]).max() < _SAME_POSE_MM:
        return replace(options, orientation_sigma_rad=0.0)
    return options


def _data(
    observations: Sequence[TableObservation],
    sphere: SphereSize,
    point_sigma: float | None,
    tool: KnownTool,
    options: TurntableOptions,
) -> ChainData:
    data = chain_data([o.sphere for o in observations], sphere, point_sigma)
    data = replace(data, table=readings_of(observations)[0])
    held = np.zeros(data.unknowns, dtype=bool)
    held[6:9] = True  # no sphere stands beside the table
    held[TABLE_COLUMN + SCALE_COLUMN] = not options.encoder_scale
    data = replace(data, held=held)
    if tool.held is None:
        held[:6] = True
        return replace(data, held=held)
    known = tool.held
    some = known.tool_and_scanner
    found = known.found
    # Where points are corrected by what was found, its uncertainty is left.
    values = np.where(OF_FILES, 0.0, found.scanner) if known.applied else found.scanner
    prior = ToolPrior(
        found.tool_rotation, found.tool_translation, values, covariance_of(known.covariance[np.ix_(some, some)])
    )
    sigmas = np.zeros(COUNT)
    sigmas[known.active] = 1.0  # the prior of the tool and the scanner together takes their place
    return replace(data, tool_prior=prior, nuisance_sigmas=sigmas)


def table_with_effective_points(
    observations: Sequence[TableObservation], sphere: SphereSize
) -> list[TableObservation]:
    """Return captures of the table that say how many of their points count as one independent one."""
    spheres = with_effective_points([o.sphere for o in observations], sphere)
    return [replace(o, sphere=s) for o, s in zip(observations, spheres, strict=True)]


def corrected_table(observations: Sequence[TableObservation], held: Held) -> list[TableObservation]:
    """Return captures of the table as a scanner without the errors that were found would have made them."""
    widths = [np.abs(o.sphere.points_in_laser_mm[:, 0]).max(initial=1.0) for o in observations]
    half_width = float(max(widths))
    return [replace(o, sphere=corrected(o.sphere, held.found.scanner, half_width)) for o in observations]


def _judge(
    observations: Sequence[TableObservation],
    data: ChainData,
    tool: KnownTool,
    start: TableStart,
    options: TurntableOptions,
) -> tuple[Judged, EncoderScale]:
    mounting = tool.mount_from_laser
    state = ChainState.predicted(data, mounting.rotation, mounting.translation_mm, np.zeros(3), start.state)
    spheres = [o.sphere for o in observations]
    if tool.held is not None:
        found = tool.held.found
        values = data.tool_prior.scanner if data.tool_prior else state.scanner
        state = replace(
            state, tool_rotation=found.tool_rotation, tool_translation=found.tool_translation, scanner=values
        )
    return judge_table(
        spheres, data, state, core_of(start.misfit_mm), options.sigmas, options.encoder_scale is False
    )


def _tool_held(judged: Judged, tool: KnownTool, move: ToolMove | None) -> tuple[ChainState, FloatArray]:
    """Return the unknowns with tool and scanner held, and their covariance with those' carried over.

    About the minimum the table follows tool and scanner by −H⁻¹ H_tool, with H of the other unknowns.
    """
    fitted = judged.fit
    if tool.held is None:
        return fitted.state, fitted.covariance * judged.inflation
    known, data = tool.held, judged.data
    assert data.held is not None
    held = data.held.copy()
    held[:6] = True
    nothing = np.zeros(COUNT)
    exact = replace(data, held=held, tool_prior=None, nuisance_sigmas=nothing)
    answer = known.state
    begin = replace(
        fitted.state,
        tool_rotation=answer.tool_rotation,
        tool_translation=answer.tool_translation,
        scanner=np.where(OF_FILES, 0.0, answer.scanner),
    )
    found = fit(exact, begin, fitted.sigmas)
    width = data.unknowns
    inverse = covariance_of(found.at.hessian)
    as_if_known = covariance_of(fitted.minimum.at.hessian)
    # By how much estimated sigmas enlarged the covariance of the fit with the tool free, so they do here.
    grown = np.sqrt(np.maximum(np.diag(fitted.covariance)[6:width] / np.diag(as_if_known)[6:width], 1.0))
    own = inverse[:width, :width].copy()
    own[6:, 6:] *= np.outer(grown, grown) * judged.inflation
    sigmas = np.zeros(COUNT)
    sigmas[known.active] = 1.0
    whole = linearised_at(
        replace(data, held=None, tool_prior=None, nuisance_sigmas=sigmas), found.state, fitted.sigmas
    )
    # Errors that poses share are eliminated with the table's unknowns: they follow too.
    count, size = len(known.active), len(whole.hessian)
    by = np.concatenate([np.arange(6), np.arange(width, width + count)])
    rest = np.setdiff1d(np.arange(size), by)
    rest = rest[~np.isin(rest, np.flatnonzero(held))]
    follows = np.zeros((size, len(by)))
    follows[rest] = -covariance_of(whole.hessian[np.ix_(rest, rest)]) @ whole.hessian[np.ix_(rest, by)]
    follows = follows[:width]
    some = known.tool_and_scanner
    carried = known.covariance[np.ix_(some, some)]
    if move is not None:
        carried = carried + move.share * np.outer(move.off, move.off)
    return found.state, own + follows @ carried @ follows.T
