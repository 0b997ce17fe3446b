"""TCP: the scanner's pose on what carries it, mount_from_laser, from one sphere; the robot stands between both.

Reads as a table of contents: find a start, fit jointly, reject what does not belong, then collect the evidence:
covariance, residuals, leave-one-out, undetermined directions, and the paper's two steps beside it.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from calib_core.chain.answer import answer_of
from calib_core.chain.arm_model import arm_input, arm_model_of
from calib_core.chain.arm_open import corrected, settled, with_open_arm, with_poses_of
from calib_core.chain.arrays import chain_data, layout_of, visits_of
from calib_core.chain.bend import Bends, doubted, straightened
from calib_core.chain.chain_data import ChainData
from calib_core.chain.effective import with_effective_points
from calib_core.chain.encoder_scales import judge_scales
from calib_core.chain.foot_start import on_foot
from calib_core.chain.held import Held, hold_files
from calib_core.chain.incidents import named_causes
from calib_core.chain.influence import influence_of
from calib_core.chain.leave_one_out import WithoutOne, without_each
from calib_core.chain.model import ChainState
from calib_core.chain.observations import (
    Observations,
    SphereObservation,
    SphereSize,
    by_scanner,
    pooled_point_sigma,
    with_own_sigmas,
)
from calib_core.chain.paper import by_paper
from calib_core.chain.rejection import Judged, judge_from, rejection_reasons, with_doubted_priors, with_more_spread
from calib_core.chain.scanner import corrected as without_errors
from calib_core.chain.several_starts import main_balls, moving_axes, starts_of, together, with_other_balls
from calib_core.chain.sides import likeliest_sides
from calib_core.chain.start import centers_of
from calib_core.chain.tcp_solution import (
    BesideModel,
    EachCapture,
    InView,
    LeftOpen,
    SidesChosen,
    TcpGiven,
    TcpNoise,
    TcpOptions,
    TcpSolution,
    TwoStep,
)
from calib_core.chain.two_step import EQUAL_ORIENTATION_RAD, orientation_span
from calib_core.chain.undetermined import open_directions
from calib_core.chain.unmodelled import Unmodelled, unmodelled_of
from calib_core.chain.warm_up import warm_up_of
from calib_core.chain.without_turns import open_shifts
from calib_core.errors import MotionError
from calib_core.frames import FloatArray
from calib_core.messages import plural

Progress = Callable[[float, str], None]
LEAST_CAPTURES = 5
_SAME_POSE_MM = 0.05


def solve_tcp(
    observations: Observations,
    sphere: SphereSize,
    options: TcpOptions | None = None,
    progress: Progress | None = None,
) -> TcpSolution:
    """Return the scanner's pose on the flange from captures of one sphere that stands still.

    Parameters
    ----------
    observations : captures of kinds profile, cloud and center, in any mixture
    sphere : SphereSize
    options : TcpOptions, optional
        Sigmas to hold; what is left out is estimated.
    progress : callable, optional
        Called with the fraction done and what is being done.

    Raises
    ------
    MotionError
        If there are too few captures, all poses are equal or all orientations are.
    """
    options = options or TcpOptions()
    tell = progress or say_nothing
    _require_motion(observations)
    observations = with_effective_points(observations, sphere)

    tell(0.05, "Searching tool, sphere and sides")
    groups = by_scanner(observations)
    mains = main_balls(observations, groups)
    layout = layout_of(observations, moving_axes(observations, options.axes))
    axes, starts = starts_of(observations, sphere, layout, mains)

    tell(0.35, "Fitting all captures jointly")
    measured_sigma = pooled_point_sigma(observations, sphere)
    point_sigma = options.point_sigma_mm or measured_sigma
    observations = with_own_sigmas(observations, sphere, options.point_sigma_mm)
    data = chain_data(observations, sphere, point_sigma, options.priors, layout)
    data = replace(data, pose_scale=visits_of(data))
    shifts = open_shifts(data).held_at(starts[0][0])
    data = shifts.holding(data)
    first = starts[0][0].center
    starts = [[shifts.start_at_zero(one) for one in of_scanner] for of_scanner in starts]
    axes = tuple(replace(axis, origin=axis.origin + starts[0][0].center - first) for axis in axes)
    given = options.position_sigma_mm, options.orientation_sigma_rad, *options.sigmas_of(layout)
    every = [
        likeliest_sides(data.of_one_scanner(n, axes), of_scanner, given[:2]) for n, of_scanner in enumerate(starts)
    ]
    chosen, start = every[0], every[0].start
    data = replace(data, distances=layout.apart(options.distances))
    state, core, spread = together(data, mains, every, axes)
    state, core = with_other_balls(data, centers_of(on_foot(observations, layout, axes), sphere), state, core)
    asked = options.scales_of(layout)
    judged, data, encoders = judge_scales(observations, data, state, core, given, asked.__getitem__)
    observations, data, judged, bends = straightened(observations, data, judged, given)
    judged, lag = _less_sure(judged, bends, spread)
    held = hold_files(judged, options.apply_scanner)
    arm = None
    as_told: Held | None = None
    if (known := arm_input(observations, options.arm_terms)) is not None:
        tell(0.6, "Finding the arm's errors")
        arm = arm_model_of(held.data, held.state, held.sigmas, judged.used, known)
        if options.apply_arm and arm.worth_it:
            as_told, arm = held, replace(arm, applied=True)
            observations = corrected(observations, arm)
            moved = with_open_arm(with_poses_of(judged.data, observations), held.state, observations, arm)
            again = judge_from(observations, moved, judged.fit.state, judged.used, given)
            judged, lag = _less_sure(again, bends, spread)
            held = hold_files(judged, options.apply_scanner)
            arm, observations, judged, held = settled(arm, observations, judged, held)
            data = with_poses_of(data, observations)

    tell(0.7, "Leaving out each capture in turn")
    state = held.state
    seen = as_corrected(observations, data, state)
    sides = sides_of(seen, data, state)
    without = without_each(held.at)
    joint = answer_of(seen, judged.used, sides, state, left_out_states(held, without, judged.used), data)

    tell(0.85, "Computing the paper's two steps beside it")
    paper, paper_answer, paper_covariance = by_paper(seen, sphere, judged, held, sides)

    tell(0.95, "Looking for causes")
    point = seen_point(data, state, judged.used)
    warm_up = warm_up_of(observations, judged, dict(options.taken_at_s))
    causes = named_causes(observations, judged, joint.offset_mm, given)
    if warm_up is not None and warm_up.found:  # a drift explains them better than any sudden change
        causes = [cause for cause in causes if cause.kind not in ("moved-sphere", "changed-tool")]
    noise = TcpNoise(
        sigmas=judged.fit.sigmas,
        point_sigma_mm=point_sigma,
        measured_point_sigma_mm=measured_sigma,
        points_per_independent=float(np.median([o.points_per_independent for o in observations])),
    )
    each = EachCapture(
        ids=[o.capture for o in observations],
        points=[len(o.points_in_laser_mm) for o in observations],
        used=judged.used,
        sides=sides,
        zones=[o.circle_radius_mm and o.circle_radius_mm / state.radius_mm for o in seen],
        reasons=rejection_reasons(observations, judged.used, judged.squared_distance, joint.offset_mm),
        squared_distance=judged.squared_distance,
        weights=data.pose_scale / judged.data.pose_scale,
        influence=influence_of(held, without, judged.used, point),
        side_choice=SidesChosen(starts[0][0].rival_scatter_mm, start.scatter_mm, chosen.log_odds),
    )
    free = held.by_motions(point)
    return TcpSolution(
        joint=joint,
        covariance=held.covariance[:9, :9],
        held=held,
        noise=noise,
        each=each,
        left_open=LeftOpen(open_directions(free), open_directions(free, tolerance=0.2), shifts),
        by_two_steps=TwoStep(paper, *(paper_covariance or (None, None)), paper_answer),
        beside=BesideModel(judged.excess, causes, warm_up, bends, lag),
        in_view=InView(
            seen_mm=point,
            at_point=held.at_point(point, data.half_width_mm),
            at_workpiece=held.at_workpiece(point, data.half_width_mm),
        ),
        given=TcpGiven(sphere, options),
        encoders=encoders,
        arm=arm,
        as_told=as_told,
    )


def _less_sure(judged: Judged, bends: Bends, spread: FloatArray) -> tuple[Judged, Unmodelled | None]:
    """Return captures judged with what is doubted of the answer in its covariance, and how poses lag."""
    lag = unmodelled_of(judged)
    judged = doubted(with_more_spread(with_doubted_priors(judged), spread), bends)
    return (with_more_spread(judged, lag.spread), lag if lag.said else None) if lag else (judged, None)


def say_nothing(_fraction: float, _message: str) -> None:
    """Take progress and tell nobody."""


def _require_motion(observations: Observations) -> None:
    if len(groups := by_scanner(observations)) > 1:
        for some in groups:
            _require_motion([observations[k] for k in some])
        return
    count = len(observations)
    if count < LEAST_CAPTURES:
        need = "at least {least_captures} captures of the sphere (better 10 to 15)"
        to_do = "Add two shifts of the scanner without turning it, then three tilts about different axes."
        raise MotionError(need, str(count), to_do, least_captures=LEAST_CAPTURES)
    rotations = np.array([o.base_from_tool0.rotation for o in observations])
    positions = np.array([o.base_from_tool0.translation_mm for o in observations])
    if orientation_span(rotations)[0] >= EQUAL_ORIENTATION_RAD:
        return
    if np.linalg.norm(positions - positions[0], axis=1).max() < _SAME_POSE_MM:
        raise MotionError(
            "captures from different robot poses",
            plural(
                "{count} capture from one and the same pose",
                "{count} captures from one and the same pose",
                by="count",
                count=count,
            ),
            "Record the robot's pose anew at each capture: shift the scanner twice, then tilt it three times.",
        )


def as_corrected(observations: Observations, data: ChainData, state: ChainState) -> list[SphereObservation]:
    """Return observations as scanners without the errors of a state would have made them."""
    each = zip(observations, data.own(state.scanner), strict=True)
    return [without_errors(o, values, data.half_width_mm) for o, values in each]


def seen_point(data: ChainData, state: ChainState, used: np.ndarray) -> FloatArray:
    """Return where the first scanner saw the sphere on average, (3,), mm; in its plane of light, if any."""
    own = data.walk.scanner == 0
    data = data.chosen(used & own if (used & own).any() else own)
    seen = data.walk.seen(state.position).mean(axis=0)
    return seen * [1.0, 0.0, 1.0] if len(data.points) else seen


def sides_of(observations: Observations, data: ChainData, state: ChainState) -> np.ndarray:
    """Return the sign of each profile's sphere centre along y of L, as a state expects it; 0 for other kinds."""
    heights = data.walk.seen(state.position)[:, 1]
    return np.array(
        [
            0 if o.circle_radius_mm is None else (1 if y >= 0 else -1)
            for o, y in zip(observations, heights, strict=True)
        ]
    )


def left_out_states(held: Held, without: WithoutOne, used: np.ndarray) -> list[ChainState | None]:
    """Return, for each of the first captures (K,), the unknowns without it; None for a rejected one."""
    steps = without.steps[: len(used)]
    return [held.state.moved(s) if u else None for s, u in zip(steps, used, strict=True)]
