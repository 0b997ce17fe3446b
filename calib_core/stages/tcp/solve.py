"""The tcp stage: every capture of the sphere observed, the joint solve, one row of residuals a capture."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from calib_core.captures.arm_joints import terms_of, with_arm_moves
from calib_core.captures.content import sphere_of
from calib_core.captures.contradictions import EXCLUDED, first_reasons, not_measured, unfit
from calib_core.captures.lost_rays import lost_rays_of
from calib_core.captures.observe import observe_capture
from calib_core.captures.poses import base_from_tool0_by_capture, duplicates, same_place
from calib_core.causes.flange import flange_findings
from calib_core.cell.axes import axis_that_moved, foot_moved, moved_axes, reading_sigmas, riders, scales_asked
from calib_core.cell.carriers import told_balls, told_distances
from calib_core.chain.observations import Observations, SphereObservation, SphereSize
from calib_core.errors import MeasurementError, MotionError
from calib_core.findings import Finding, has, reasons_of, sentence_of, verdict_of
from calib_core.findings.codes import several_spheres
from calib_core.findings.codes import tcp as codes
from calib_core.findings.codes.captures import CAPTURE_DUPLICATE
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import Observed, SolvedTcp, StageInput
from calib_core.messages import Value, message
from calib_core.records import Capture, Cell, Progress, ReadFile
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.sweep_rows import mark_sweeps, one_row_each
from calib_core.stages.tcp.record import TcpResidual, TcpResult
from calib_core.stages.turntable.record import TurntableResidual, TurntableResult

if TYPE_CHECKING:
    from calib_core.chain.tcp_solution import TcpOptions, TcpSolution

_MEASURING_SHARE = 0.3
_NOT_ONE_BALL_MM = 5.0  # by which one ball's places scatter: the cell is told wrongly, or there are several
_SUSPICIOUS_SCATTER_MM = 1.0  # arms that are read rightly stay below
_SUSPICIOUS_SCALE = 0.015  # scanners that are read rightly stay below


def solve(given: StageInput) -> TcpResult:
    """Return the scanner's pose on the flange from all tcp captures that are not excluded.

    Raises
    ------
    InputError
        If a file or a pose is of no use.
    MeasurementError
        If most captures do not show the sphere: then the cell's description is at fault, not a capture.
    MotionError
        If the motions do not determine the answer.
    """
    from calib_core.stages.tcp.balls import spheres_found
    from calib_core.stages.tcp.result import tcp_result
    from calib_core.stages.undetermined_places import without_open_places

    try:
        solved = solve_tcp_captures(given)
    except MeasurementError as error:
        doubts = _doubts_of_pitch(given)
        raise (error.adding(sentence_of(doubts[0])) if doubts else error) from None
    found = _findings(given, solved)
    if verdict_of(found) == "fail":
        found += _doubts_of_pitch(given)
    if not any(one.remedy for one in found) and has(found, codes.POSES_DO_NOT_FIT):
        _require_still(given)
    result = tcp_result(solved.solution, SOFTWARE, given.inputs_sha256, found)
    result = result.model_copy(update={"spheres": spheres_found(given.session.cell, solved.solution)})
    result = without_open_places(result, solved.solution.left_open.shifts)
    return with_all_rows(result, given.captures, solved.unused)


def _findings(given: StageInput, solved: SolvedTcp) -> list[Finding]:
    """Return all that is noticed of solution and captures, and what would explain doubts about the poses."""
    from calib_core.stages.tcp.arm_found import arm_findings
    from calib_core.stages.tcp.result import solution_findings
    from calib_core.stages.tcp.verdict import diameter_told, lag_findings

    found = of_several_balls(given, solved, solution_findings(solved.solution, given.captures))
    sizes = {o.sphere for o in solved.observations if o.sphere} - {solved.sphere}
    found += [diameter_told(size) for size in sorted(sizes, key=lambda size: -size.diameter_mm)]
    found += lag_findings(solved.observations, solved.solution.noise.sigmas)
    found += lost_rays_of(solved.observations)
    fit = [c for c in given.captures if not c.excluded and c.id not in solved.left_out]
    of_flange = flange_findings(given.session.cell, fit)
    found += arm_findings(given.session.cell, solved.solution.arm, [] if of_flange else fit)
    nothing_fits = has(found, codes.POSES_DO_NOT_FIT)
    causes = _causes_of_poses(given, solved, nothing_fits) if _is_doubtful(found, solved) else []
    about_causes = {name for cause in causes for name in cause.captures}
    of_all = any(not cause.captures for cause in causes)  # such as lengths, of which one or two may stick out
    told = [one for one in found if one.remedy is None or not (of_all or about_causes & set(one.captures))]
    return [*of_flange, *causes, *told, *solved.unused, *solved.noticed]


def of_several_balls(given: StageInput, solved: SolvedTcp, found: list[Finding]) -> list[Finding]:
    """Return findings in which arcs that were not told apart are no poses that do not fit."""
    from calib_core.stages.tcp.balls import findings_of_balls

    told = _balls_not_told_apart(given.session.cell, solved.observations)
    if told < 2 or not has(found, codes.POSES_DO_NOT_FIT):
        return [*findings_of_balls(given.session.cell, solved.solution.held), *found]
    others = [one for one in found if one.code != codes.POSES_DO_NOT_FIT.name]
    return [several_spheres.BALLS_NOT_TOLD_APART(count=told), *others]


def _balls_not_told_apart(cell: Cell, observations: Observations) -> int:
    """Return of how many balls the arcs may be that no ball is named for, or one while the robot's foot moved."""
    moved = (foot_moved(cell, o.readings) for o in observations)
    carriers = {o.carriers.ball for o, foot in zip(observations, moved, strict=True) if foot or not o.ball}
    return max((len(told_balls(cell, carrier)) for carrier in carriers), default=0)


def _causes_of_poses(given: StageInput, solved: SolvedTcp, nothing_fits: bool) -> list[Finding]:
    """Return what would make doubtful captures fit: another reading of the poses, or other lengths.

    Where nothing fits, what seems to have happened to a few is no reason not to look for what is wrong in all.
    Otherwise it explains the doubt, but for circles that are seen as ellipses: no incident makes these.
    """
    from calib_core.causes.poses import pose_causes

    given.progress(0.97, "Trying other readings of the poses")
    found = pose_causes(given.session.cell, given.captures, solved.observations, solved.sphere)
    if found:
        return found
    from calib_core.causes.mirror import mirror_causes
    from calib_core.causes.scales import scale_causes

    explained = bool(solved.solution.beside.causes) and not nothing_fits
    given.progress(0.98, "Trying other lengths")
    found = scale_causes(given.session, given.captures, given.read, solved.sphere, by_shape=explained)
    return found if found or explained else mirror_causes(given.session, solved.observations, solved.sphere)


def _is_doubtful(found: Sequence[Finding], solved: SolvedTcp) -> bool:
    """Return whether the poses are to be doubted: nothing fits, or several captures contradict the others."""
    rejected = int((~solved.solution.each.used).sum())
    scaled = any(
        abs(error.error) > _SUSPICIOUS_SCALE
        for error in solved.solution.held.errors
        if error.name in ("scale_x", "scale_z", "arm_scale")
    )
    scattered = solved.solution.each.side_choice.scatter_mm > _SUSPICIOUS_SCATTER_MM
    return verdict_of(found) == "fail" or scattered or scaled or rejected > 1


def _doubts_of_pitch(given: StageInput) -> list[Finding]:
    """Return what frames that do not fit the sphere say of the board's pitch, where a board gave lengths."""
    if not any(capture.kind == "frame" for capture in given.captures):
        return []
    from calib_core.captures.pitch import suspected_pitch

    given.progress(0.99, "Asking the sphere for the board's pitch")
    doubt = suspected_pitch(given.session, given.captures, given.read)
    return [doubt] if doubt else []


def _require_still(given: StageInput, ball: str = "") -> None:
    """Refuse captures, or those of one ball, where an axis that carries the object moved between them."""
    some = [c for c in given.captures if not c.excluded and (not ball or c.mount == ball)]
    if (axis := axis_that_moved(given.session.cell, some)) is not None:
        need = "a sphere that stands still in captures with step 'tcp'"
        to_do = "Give captures of a sphere on an axis the step 'turntable', and capture one that stands still."
        raise MotionError(
            need, "one that seems to ride on the axis '{axis}', which moved", to_do, "captures", axis=axis
        )


def solve_tcp_captures(given: StageInput) -> SolvedTcp:
    """Return the tcp captures' solution, with what it was solved from; raises as `solve` does."""
    if given.kept.tcp is None:
        given.kept.tcp = _solve_tcp_captures(given)
    return given.kept.tcp


def _solve_tcp_captures(given: StageInput) -> SolvedTcp:
    from calib_core.chain.arm_open import corrected
    from calib_core.chain.tcp import solve_tcp
    from calib_core.chain.tcp_solution import TcpOptions
    from calib_core.stages.tcp.balls import named_by_distances, of_no_ball, other_arcs, with_all_balls

    cell = given.session.cell
    for ball in riders(cell):
        _require_still(given, ball)
    sphere = sphere_of(cell, [capture for capture in given.captures if not capture.excluded])
    clearest = observe_stage(given)
    observed = with_all_balls(given, clearest, sphere)
    options = TcpOptions(
        position_sigma_mm=cell.robot.position_sigma_mm,
        orientation_sigma_rad=cell.robot.orientation_sigma_rad,
        point_sigma_mm=cell.scanner.point_sigma_mm,
        apply_scanner=cell.scanner.errors == "apply",
        arm_terms=terms_of(cell),
        apply_arm=cell.robot.errors == "apply",
        axes=moved_axes(cell),
        axis_sigmas=reading_sigmas(cell),
        axis_scales=scales_asked(cell),
        taken_at_s=tuple((c.id, c.device_time_s) for c in given.captures if c.device_time_s is not None),
    )
    seen, noticed = observed.observations, _second_arcs(clearest.observations, observed.observations)
    try:
        seen, solution = _solved(given, seen, sphere, options)
        if (others := other_arcs(given, seen, solution.each.used)) is not None:
            again = solve_tcp(others, sphere, options)
            if len(fit := np.flatnonzero(again.each.used & ~solution.each.used)):
                noticed.append(several_spheres.SECOND_ARC([seen[k].capture for k in fit]))
                seen, solution = others, again
        if (named := named_by_distances(cell, seen, solution)) is not None:  # whose distances are measurements
            seen = named
            solution = solve_tcp(seen, sphere, replace(options, distances=told_distances(cell)))
    except MotionError as error:
        raise observed.explaining(_of_balls(error, _balls_not_told_apart(cell, seen))) from None
    if any(capture.kind in ("frame", "sweep") for capture in given.captures):
        from calib_core.captures.frame_uncertainty import with_calibration_uncertainty

        solution = with_calibration_uncertainty(given.session, given.read, solution)
    if solution.arm is not None and solution.arm.applied:
        seen = corrected(seen, solution.arm)
    stray = of_no_ball([o.capture for o in observed.observations], seen)
    return SolvedTcp(solution, seen, sphere, [*observed.unused, *stray], noticed)


def _solved(
    given: StageInput, seen: list[SphereObservation], sphere: SphereSize, options: "TcpOptions"
) -> "tuple[list[SphereObservation], TcpSolution]":
    """Return the solution of captures, as of several balls where those of one do not fit; and these captures."""
    from calib_core.chain.tcp import solve_tcp
    from calib_core.stages.tcp.balls import balls_in_turn

    try:
        solution = solve_tcp(seen, sphere, options, _later(given.progress))
    except MotionError:
        if (balls := balls_in_turn(given, seen, sphere)) is None:
            raise
        return balls, solve_tcp(balls, sphere, options)
    if solution.joint.center_scatter_rms_mm < _NOT_ONE_BALL_MM:
        return seen, solution
    balls = balls_in_turn(given, seen, sphere)
    return (seen, solution) if balls is None else (balls, solve_tcp(balls, sphere, options))


def _second_arcs(clearest: Observations, seen: Observations) -> list[Finding]:
    """Return which captures of one ball show something rounder where no ball is."""
    if any(o.ball for o in seen):
        return []
    own = {id(o.points_in_laser_mm) for o in clearest}
    others = [o.capture for o in seen if id(o.points_in_laser_mm) not in own]
    return [several_spheres.SECOND_ARC(others)] if others else []


def _of_balls(error: MotionError, told: int) -> MotionError:
    """Return an error that says that balls were not told apart, where the cell tells of several."""
    return error if told < 2 else _not_told_apart(told, error.got, error.where)


def _not_told_apart(told: int, got: str, where: str) -> MotionError:
    need = message("arcs of the cell's {count} spheres that can be told apart", count=told)
    return MotionError(need, got, str(several_spheres.BALLS_NOT_TOLD_APART.to_do), where)


def require_told_apart(given: StageInput, solved: SolvedTcp) -> None:
    """Refuse an answer whose arcs may be of several balls and fit no one: nothing can rest on it."""
    from calib_core.stages.tcp.verdict import tcp_findings

    found = of_several_balls(given, solved, tcp_findings(solved.solution, given.captures))
    if has(found, several_spheres.BALLS_NOT_TOLD_APART):
        raise _not_told_apart(_balls_not_told_apart(given.session.cell, solved.observations), "none", "tcp")


def observe_stage(given: StageInput) -> Observed:
    """Return the sphere as the stage's captures saw it, and why some are of no use."""
    cell = given.session.cell
    captures = [capture for capture in given.captures if not capture.excluded]
    base_from_tool0_by_capture(cell, captures)
    unused = [*unfit(cell, captures), *copies_of(captures, given.read)]
    out = {name for finding in unused for name in finding.captures}
    fit = [c for c in captures if c.id not in out]
    observations, failed = observe_all(given, fit)
    if cell.robot.arm is not None and not flange_findings(cell, fit):
        observations = with_arm_moves(cell, fit, observations)
    return Observed(observations, failed, first_reasons([*unused, *not_measured(failed)]))


def observe_all(
    given: StageInput, captures: Sequence[Capture]
) -> tuple[list[SphereObservation], dict[str, MeasurementError]]:
    """Return captures of the sphere as the solvers take them, and the errors of those that do not show it.

    Raises
    ------
    MeasurementError
        If most do not show it.
    """
    observations: list[SphereObservation] = []
    failed: dict[str, MeasurementError] = {}
    seen = 0
    for number, capture in enumerate(captures):
        given.progress(
            _MEASURING_SHARE * number / len(captures),
            message("Finding the sphere in {capture}", capture=capture.id),
        )
        try:
            observations += _observe(given, capture)
            seen += 1
        except MeasurementError as error:
            failed[capture.id] = error
    if len(failed) > seen:
        first = next(iter(failed.values()))
        got = message(
            "{found} ({count} of {count_other} captures do not show the sphere)",
            found=first.got,
            count=len(failed),
            count_other=len(captures),
        )
        raise MeasurementError(first.need, got, first.to_do, first.where)
    return observations, failed


def _observe(given: StageInput, capture: Capture) -> list[SphereObservation]:
    """Return one observation of a capture, or one of each profile of a sweep that shows the sphere."""
    if capture.kind == "sweep":
        from calib_core.captures.sweep_sphere import observe_sweep

        return observe_sweep(given.session, capture, given.read)
    return [observe_capture(given.session, capture, given.read)]


def copies_of(captures: Sequence[Capture], read: ReadFile) -> list[Finding]:
    """Return the captures that repeat another and are left out; a copy at another pose is left to the solver."""
    by_id = {capture.id: capture for capture in captures}
    each: dict[str, dict[str, Value]] = {
        copy: {"original": original}
        for copy, original in duplicates(captures, read).items()
        if same_place(by_id, copy, original)
    }
    return [CAPTURE_DUPLICATE(list(each), each=each)] if each else []


def _later(progress: Progress) -> Progress:
    return lambda fraction, message: progress(_MEASURING_SHARE + (1 - _MEASURING_SHARE) * fraction, message)


_R = TypeVar("_R", TcpResult, TurntableResult, ChainResult)


def with_all_rows(result: _R, captures: Sequence[Capture], unused: Sequence[Finding]) -> _R:
    """Return the result with a row for every capture, in their order, those of no use with their reasons."""
    rows: dict[str, TcpResidual | TurntableResidual] = one_row_each(result.residuals)
    reasons = {capture.id: EXCLUDED for capture in captures if capture.excluded} | reasons_of(unused)
    for capture in captures:
        if capture.id in reasons:
            row = TurntableResidual if capture.step == "turntable" else TcpResidual
            rows[capture.id] = row(capture=capture.id, used=False, reason=str(reasons[capture.id]))
    return result.model_copy(
        update={"residuals": mark_sweeps([rows[capture.id] for capture in captures], captures)}
    )
