"""The whole chain: tool and turntable from all captures in one likelihood, so that each improves the other.

The captures of the still sphere fix the tool up to what is hard to see from one place; those of the table see the
sphere all around its axis.  Together they know both better than one after the other; the stages' answers stay
beside it and say whether the two kinds of captures contradict each other.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib_core.cell.layout import Layout
from calib_core.cell.walk import Position
from calib_core.chain.answer import answer_of
from calib_core.chain.arm_errors import ArmErrors
from calib_core.chain.arm_open import settled, with_open_arm
from calib_core.chain.arrays import chain_data, layout_of, visits_of
from calib_core.chain.bend import by_all, doubted, unbent
from calib_core.chain.chain_data import ChainData
from calib_core.chain.effective import with_effective_points
from calib_core.chain.encoder_scales import EncoderScales
from calib_core.chain.held import Held, hold_files
from calib_core.chain.influence import influence_of
from calib_core.chain.late_scanner import LateScanner
from calib_core.chain.leave_one_out import without_each
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
    TableObservation,
    pooled_point_sigma,
    with_own_sigmas,
)
from calib_core.chain.rejection import Judged, rejection_reasons, with_more_spread
from calib_core.chain.table_captures import corrected_table, table_with_effective_points, with_table_sigmas
from calib_core.chain.table_errors import table_errors_of
from calib_core.chain.table_frame import frame_by_rule, frame_covariance
from calib_core.chain.table_given import KnownTool, TurntableOptions
from calib_core.chain.table_judging import judge_table
from calib_core.chain.table_residuals import table_residuals
from calib_core.chain.table_tool import ToolMove, with_tool_move
from calib_core.chain.tcp import Progress, as_corrected, left_out_states, say_nothing, seen_point, sides_of
from calib_core.chain.tcp_solution import EachCapture, InView, LeftOpen, TcpSolution
from calib_core.chain.turntable import TurntableSolution, mirror_of, paper_circles
from calib_core.chain.undetermined import open_directions
from calib_core.frames import FloatArray

_WITHOUT_RZ = [0, 1, 3, 4, 5]  # T's rotation about its own z follows from the others


@dataclass(frozen=True, eq=False)
class ChainSolution:
    """Tool and turntable from all captures.

    Attributes
    ----------
    tcp : TcpSolution
        Of the captures of the still sphere, by the whole chain's tool.
    turntable : TurntableSolution
        Of those of the table, by the same.
    cross_covariance : (6, 6)
        Of mount_from_laser with base_from_turntable.
    scanner_with_table : (6, n)
        Of base_from_turntable with the nuisances.
    arm_with_table : ArmErrors or None
        How base_from_turntable errs together with the arm, (6, …).
    left_of_table : (6,) or None
        By how much base_from_turntable is off for what stays in the scanner's files: see `Held.left`.
    tcp_distance, turntable_distance : float
        Squared Mahalanobis distance of the stages' own answers from the whole chain's: 6 and 5 degrees of freedom.
    tcp_difference, turntable_difference : (6,)
        From the stages' answers to the whole chain's, rx ry rz tx ty tz.
    """

    tcp: TcpSolution
    turntable: TurntableSolution
    cross_covariance: FloatArray
    scanner_with_table: FloatArray
    tcp_distance: float
    turntable_distance: float
    tcp_difference: FloatArray
    turntable_difference: FloatArray
    arm_with_table: ArmErrors | None = None
    left_of_table: FloatArray | None = None


def solve_chain(
    tcp_observations: Sequence[SphereObservation],
    table_observations: Sequence[TableObservation],
    sphere: SphereSize,
    tcp: TcpSolution,
    turntable: TurntableSolution,
    options: TurntableOptions,
    progress: Progress | None = None,
    late: Sequence[LateScanner] = (),
) -> ChainSolution:
    """Return tool and turntable from all captures, beginning with the stages' own answers.

    Parameters
    ----------
    tcp_observations, table_observations
        The same captures, in the same order, from which the stages were solved.
    sphere : SphereSize
    tcp, turntable
        The stages' answers.
    options : TurntableOptions
    progress : callable, optional
        Called with the fraction done and what is being done.
    late : sequence of LateScanner
        Scanners that the table places, whose captures count last.

    Notes
    -----
    Where no ball stood still, `tcp` is what balls on axes said of scanners, and its captures are none.
    """
    tell = progress or say_nothing
    tell(0.1, "Fitting all captures of both kinds jointly")
    tcp_observations = with_effective_points(tcp_observations, sphere)
    table_observations = [*table_observations, *(o for one in late for o in one.observations)]
    table_observations = table_with_effective_points(table_observations, sphere)
    tcp_observations = with_own_sigmas(tcp_observations, sphere, options.point_sigma_mm)
    table_observations = with_table_sigmas(table_observations, sphere, options.point_sigma_mm)
    spheres, (judged, encoders), image, point_sigma = _judge(
        tcp_observations, table_observations, sphere, tcp, turntable, options, late
    )
    tcp = replace(tcp, beside=replace(tcp.beside, bends=by_all(judged, tcp.beside.bends)))
    errors = table_errors_of(judged, len(table_observations), turntable.pattern)
    judged = with_more_spread(doubted(judged, tcp.beside.bends), errors.spread)

    tell(0.8, "Comparing with the stages' own answers")
    unmoved = hold_files(judged, tcp.given.options.apply_scanner)
    if tcp.arm is not None and tcp.arm.applied:
        arm, spheres, judged, unmoved = settled(tcp.arm, spheres, judged, unmoved)
        tcp = replace(tcp, arm=arm)
    tcp_observations, on_table = spheres[: len(tcp_observations)], spheres[len(tcp_observations) :]
    table_observations = [o.seen_as(seen) for o, seen in zip(table_observations, on_table, strict=True)]
    held = with_tool_move(unmoved, _of_every_mount(turntable.tool_move, tcp, late), len(tcp_observations))
    spread = mirror_spread(judged.data, held.state, image)
    held = replace(held, covariance=with_spread(held.covariance, spread))
    covariance = held.covariance
    still = _tcp_part(tcp_observations or spheres, tcp, judged, held, point_sigma)
    turning = _table_part(table_observations, sphere, tcp, judged, held, point_sigma, encoders, options)
    mirror = mirror_of(spread, held.state, options.direction)
    turning = replace(
        turning,
        pattern=errors.pattern,
        move=errors.move,
        tool_move=turntable.tool_move,
        by_arm_mm=turntable.by_arm_mm,
        mirror=mirror,
        image=image,
    )
    layout = judged.data.walk.layout
    size = layout.axis_and_places(layout.table)
    tool_shift = tcp.joint.mount_from_laser.difference(still.joint.mount_from_laser)
    table_shift = turntable.frame.base_from_turntable.difference(turning.frame.base_from_turntable)
    some = np.ix_(_WITHOUT_RZ, _WITHOUT_RZ)
    # A tool that moved is what these would tell: they are held against what the captures say without it.
    table_unmoved = frame_covariance(
        unmoved.state.table, unmoved.covariance[np.ix_(size, size)], options.direction
    )
    by_unknowns = np.zeros((6, len(covariance)))
    by_unknowns[:, size] = turning.covariance.pose_by_unknowns
    return ChainSolution(
        tcp=still,
        turntable=turning,
        cross_covariance=covariance[:6, size] @ turning.covariance.pose_by_unknowns.T,
        scanner_with_table=turning.covariance.pose_by_unknowns
        @ covariance[np.ix_(size, held.tool_and_scanner[6:])],
        tcp_distance=_distance(tool_shift, tcp.covariance[:6, :6], unmoved.covariance[:6, :6]),
        turntable_distance=_distance(
            table_shift[_WITHOUT_RZ], turntable.covariance.pose[some], table_unmoved.pose[some]
        ),
        tcp_difference=tool_shift,
        turntable_difference=table_shift,
        arm_with_table=held.arm and held.arm.of(by_unknowns),
        left_of_table=None if held.left is None else by_unknowns @ held.left,
    )


def _of_every_mount(move: ToolMove | None, tcp: TcpSolution, late: Sequence[LateScanner]) -> ToolMove | None:
    """Return how the tool moved with room for scanners that were placed later, which did not."""
    before = 6 * len(tcp.held.state.position.mount_rotations)
    return move and replace(move, off=np.insert(move.off, before, np.zeros(6 * len(late))))


def _layout(
    spheres: Sequence[SphereObservation],
    tcp: TcpSolution,
    turntable: TurntableSolution,
    options: TurntableOptions,
    late: Sequence[LateScanner],
) -> Layout:
    """Return the layout of all captures in the order of what the stages found: their own first, late ones last."""
    still, turning = tcp.held.state.walk.layout, turntable.state.walk.layout
    layout = layout_of(spheres, options.axes)
    found = [
        still,
        turning,
        *(layout_of([o.placed for o in one.observations]) for one in late if one.observations),
    ]
    mounts = dict.fromkeys(mount for one in found for mount in one.mounts)
    places = dict.fromkeys(place for one in found for place in one.places if place in layout.places)
    return replace(layout, mounts=tuple(mounts), places=tuple(places))


def _judge(
    tcp_observations: Sequence[SphereObservation],
    table_observations: Sequence[TableObservation],
    sphere: SphereSize,
    tcp: TcpSolution,
    turntable: TurntableSolution,
    options: TurntableOptions,
    late: Sequence[LateScanner],
) -> tuple[list[SphereObservation], JudgedTable, MirrorImage | None, float | None]:
    spheres = [*tcp_observations, *(o.placed for o in table_observations)]
    point_sigma = options.point_sigma_mm or pooled_point_sigma(spheres, sphere)
    still = len(tcp_observations)
    layout = _layout(spheres, tcp, turntable, options, late)
    data = chain_data(spheres, sphere, point_sigma, options.priors, layout)
    repeated = visits_of(data.chosen(np.arange(data.count) < still))
    data = replace(data, pose_scale=np.concatenate([repeated, np.ones(len(table_observations))]))
    data = tcp.left_open.shifts.holding(data)
    data = replace(data, distances=layout.apart(tcp.given.options.distances or options.distances))
    names = [axis.name for axis in layout.axes]
    for stage in (tcp.held.state.walk.layout, tcp.encoders), (turntable.state.walk.layout, turntable.encoders):
        for axis, encoder in stage[1].items():
            own = layout.scale(names.index(stage[0].axes[axis].name))
            data = data.holding(own, not encoder.applied)
    one, other = tcp.held.state.position, turntable.state.position
    mounts = (
        np.array([*one.mount_rotations, *(own.rotation for own in late)]),
        np.array([*one.mount_translations, *(own.translation for own in late)]),
    )
    of_tcp = (one.places, tcp.each.used) if still else (one.places[:0], tcp.each.used[:0])
    places = np.concatenate([of_tcp[0], other.places, *(own.places for own in late)])
    start = ChainState.at(data, Position(*mounts, places, other.axes))
    known = np.zeros(len(data.nuisance_sigmas))
    known[: len(tcp.held.state.scanner)] = tcp.held.state.scanner
    start = replace(start, scanner=np.where(data.nuisance_sigmas > 0, known, 0.0))
    if tcp.arm is not None and tcp.arm.applied:
        data = with_open_arm(data, start, spheres, tcp.arm)
    core = np.concatenate([of_tcp[1], turntable.used, *(own.core for own in late)])
    spheres, data = unbent(spheres, data, start, tcp.beside.bends)

    def judge(there: ChainState, core: np.ndarray) -> JudgedTable:
        return judge_table(spheres, data, there, core, options.sigmas, options.scale_asked)

    directions = told_directions(options.axes, options.direction)
    return spheres, *likelier_side(spheres, start, core, judge, directions), point_sigma


def _tcp_part(
    observations: Sequence[SphereObservation],
    alone: TcpSolution,
    judged: Judged,
    held: Held,
    point_sigma: float | None,
) -> TcpSolution:
    """Return the tcp stage's solution with the whole chain's answer in it."""
    state, count = held.state, len(observations)
    used = judged.used[:count]
    without = without_each(held.at)
    left_out = left_out_states(held, without, used)
    data = judged.data.chosen(np.arange(judged.data.count) < count)
    seen = as_corrected(observations, data, state)
    sides = sides_of(seen, data, state)
    joint = answer_of(seen, used, sides, state, left_out, data)
    point = seen_point(data, state, used)
    squared = judged.squared_distance[:count]
    at_rest, follows = _ball_at_rest(data, held)
    free = held.by_motions(point)
    return replace(
        alone,
        joint=replace(joint, center_mm=at_rest),
        covariance=follows @ held.covariance @ follows.T,
        held=held,
        noise=replace(alone.noise, sigmas=judged.fit.sigmas, point_sigma_mm=point_sigma),
        each=EachCapture(
            ids=[o.capture for o in observations],
            points=[len(o.points_in_laser_mm) for o in observations],
            used=used,
            sides=sides,
            zones=[o.circle_radius_mm and o.circle_radius_mm / state.radius_mm for o in seen],
            reasons=rejection_reasons(observations, used, squared, joint.offset_mm),
            squared_distance=squared,
            weights=np.minimum(1 / judged.data.pose_scale[:count], 1.0),
            influence=influence_of(held, without, used, point),
            side_choice=alone.each.side_choice,
        ),
        left_open=LeftOpen(open_directions(free), open_directions(free, tolerance=0.2), alone.left_open.shifts),
        beside=replace(alone.beside, excess=judged.excess),
        encoders={},  # told with the table's
        in_view=InView(
            seen_mm=point,
            at_point=held.at_point(point, judged.data.half_width_mm),
            at_workpiece=held.at_workpiece(point, judged.data.half_width_mm),
        ),
    )


def _ball_at_rest(data: ChainData, held: Held) -> tuple[FloatArray, FloatArray]:
    """Return the first ball's place (3,) with axes at zero; how the first mount and it follow all (9, P)."""
    walk, state, follows = data.walk, held.state, np.eye(9, len(held.covariance))
    if not walk.layout.rides[0].any():
        return state.center, follows
    first = walk.chosen(np.flatnonzero(walk.place == 0)[:1])
    points, moves, _ = replace(first, readings=np.zeros_like(first.readings)).balls(state.position)
    assert moves is not None
    follows[6:, : data.unknowns] = moves[0]
    return points[0], follows


def _table_part(
    observations: Sequence[TableObservation],
    sphere: SphereSize,
    tcp: TcpSolution,
    judged: Judged,
    held: Held,
    point_sigma: float | None,
    encoders: EncoderScales,
    options: TurntableOptions,
) -> TurntableSolution:
    """Return the turntable by the whole chain's answer."""
    state, count = held.state, len(observations)
    if held.applied:
        observations = corrected_table(observations, held)
    walk = judged.data.walk.chosen(np.arange(judged.data.count) >= judged.data.count - count)
    frame = frame_by_rule(state.table, options.direction)
    residuals = table_residuals(observations, walk, state, frame)
    used = judged.used[-count:]
    two_step = tcp.by_two_steps.answer.mount_from_laser if tcp.by_two_steps.answer else None
    all_known = len(tcp.held.state.walk.layout.mounts) == len(state.walk.layout.mounts)
    tool = KnownTool(tcp.joint.mount_from_laser, tcp.held if all_known else held, two_step)
    size = judged.data.walk.layout.axis_and_places(judged.data.walk.layout.table)
    return TurntableSolution(
        frame=frame,
        covariance=frame_covariance(state.table, held.covariance[np.ix_(size, size)], options.direction),
        state=state,
        sigmas=judged.fit.sigmas,
        point_sigma_mm=point_sigma,
        captures=[o.sphere.capture for o in observations],
        mounts=state.walk.layout.mountings,
        used=used,
        squared_distance=judged.squared_distance[-count:],
        excess=judged.excess,
        residuals=residuals,
        circles=paper_circles(observations, sphere, tool, residuals.sides, used),
        encoders=encoders,
        options=options,
        unknowns_covariance=held.covariance,
    )


def _distance(shift: FloatArray, alone: FloatArray, together: FloatArray) -> float:
    """Return the squared Mahalanobis distance of an answer of some captures from that of all.

    What alike poses share is estimated by each for itself, even where sigmas are told: so the difference is not as
    uncertain as the first is worse, C_some − C_all, and the sum of both counts.
    """
    return float(shift @ np.linalg.solve(alone + together, shift))
