"""The tcp stage: every capture of the sphere observed, the joint solve, one row of residuals a capture."""

from collections.abc import Sequence
from typing import TypeVar

from calib_core.captures.content import sphere_of
from calib_core.captures.contradictions import told_by_joints, unfit
from calib_core.captures.lost_rays import with_lost_rays
from calib_core.captures.observe import observe_capture
from calib_core.captures.poses import base_from_tool0_by_capture, duplicates, same_place
from calib_core.chain.observations import SphereObservation
from calib_core.errors import MeasurementError, MotionError
from calib_core.evidence.words import not_used
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import Observed, SolvedTcp, StageInput
from calib_core.records import Capture
from calib_core.records.callbacks import Progress, ReadFile
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.sweep_rows import mark_sweeps, one_row_each
from calib_core.stages.tcp.record import TcpResidual, TcpResult
from calib_core.stages.turntable.record import TurntableResidual, TurntableResult

_MEASURING_SHARE = 0.3
_SUSPICIOUS_SCATTER_MM = 1.0  # arms that are read rightly stay below
_SUSPICIOUS_SCALE = 0.015  # scanners that are read rightly stay below
_EXPLAINS_ALL = ("pose-reading", "scaled-profile", "sphere-diameter")


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
    from calib_core.stages.tcp.result import tcp_result
    from calib_core.stages.tcp.verdict import with_repeats

    try:
        solved = solve_tcp_captures(given)
    except MeasurementError as error:
        doubt = _doubt_of_pitch(given)
        raise (error.adding(doubt) if doubt else error) from None
    result = tcp_result(solved.solution, SOFTWARE, given.inputs_sha256)
    result = with_repeats(result, solved.observations, solved.solution.sigmas)
    result = with_lost_rays(result, solved.observations)
    result = _with_causes(with_unused(result, given.captures, solved.unused), given, solved)
    if whose := told_by_joints(given.session.cell, [c for c in given.captures if c.id not in solved.unused]):
        verdict = "warn" if result.verdict == "pass" else result.verdict
        from calib_core.causes.flange import flange_causes

        causes = flange_causes(given.session.cell, [c for c in given.captures if c.id not in solved.unused])
        told = {"verdict": verdict, "warnings": [whose, *result.warnings], "causes": [*result.causes, *causes]}
        result = result.model_copy(update=told)
    doubt = _doubt_of_pitch(given) if result.verdict == "fail" else None
    return result.model_copy(update={"warnings": [*result.warnings, doubt]}) if doubt else result


def _with_causes(result: TcpResult, given: StageInput, solved: SolvedTcp) -> TcpResult:
    """Return the result with its root causes; where poses do not belong to the scans, that is all that is said."""
    from calib_core.causes.incidents import incident_record

    happened = [incident_record(cause, given.captures) for cause in solved.solution.causes]
    if not _is_doubtful(result, solved):
        return result.model_copy(update={"causes": happened})
    from calib_core.causes.poses import pose_causes

    given.progress(0.97, "Trying other readings of the poses")
    found = pose_causes(given.session.cell, given.captures, solved.observations, solved.sphere)
    if not found and not happened:
        from calib_core.causes.scales import scale_causes

        given.progress(0.98, "Trying other lengths")
        found = scale_causes(given.session, given.captures, given.read, solved.sphere)
    if not found:
        return result.model_copy(update={"causes": happened})
    about = {name for cause in found for name in cause.captures}
    others = [cause for cause in happened if not about & set(cause.captures)]
    if any(cause.kind in _EXPLAINS_ALL for cause in found):
        return result.model_copy(update={"verdict": "fail", "warnings": [found[0].sentence], "causes": found})
    explained = {cause.sentence for cause in happened if cause not in others}
    warnings = [found[0].sentence, *(said for said in result.warnings if said not in explained)]
    verdict = "warn" if result.verdict == "pass" else result.verdict
    return result.model_copy(update={"verdict": verdict, "warnings": warnings, "causes": [*found, *others]})


def _is_doubtful(result: TcpResult, solved: SolvedTcp) -> bool:
    """Return whether the poses are to be doubted: nothing fits, or several captures contradict the others."""
    rejected = int((~solved.solution.used).sum())
    scaled = any(
        abs(error.error) > _SUSPICIOUS_SCALE
        for error in solved.solution.held.errors
        if error.name in ("scale_x", "scale_z", "arm_scale")
    )
    scattered = solved.solution.start_scatter_mm > _SUSPICIOUS_SCATTER_MM
    return result.verdict == "fail" or scattered or scaled or rejected > 1


def _doubt_of_pitch(given: StageInput) -> str | None:
    """Return what frames that do not fit the sphere say of the board's pitch, None where no board gave lengths."""
    if not any(capture.kind == "frame" for capture in given.captures):
        return None
    from calib_core.captures.pitch import suspected_pitch

    given.progress(0.99, "Asking the sphere for the board's pitch")
    return suspected_pitch(given.session, given.captures, given.read)


def solve_tcp_captures(given: StageInput) -> SolvedTcp:
    """Return the tcp captures' solution, with what it was solved from; raises as `solve` does."""
    if given.kept.tcp is None:
        given.kept.tcp = _solve_tcp_captures(given)
    return given.kept.tcp


def _solve_tcp_captures(given: StageInput) -> SolvedTcp:
    from calib_core.chain.tcp import TcpOptions, solve_tcp

    cell = given.session.cell
    sphere = sphere_of(cell, [capture for capture in given.captures if not capture.excluded])
    observed = observe_stage(given)
    options = TcpOptions(
        position_sigma_mm=cell.robot.position_sigma_mm,
        orientation_sigma_rad=cell.robot.orientation_sigma_rad,
        point_sigma_mm=cell.scanner.point_sigma_mm,
        apply_scanner=cell.scanner.errors == "apply",
        taken_at_s=tuple((c.id, c.device_time_s) for c in given.captures if c.device_time_s is not None),
    )
    try:
        solution = solve_tcp(observed.observations, sphere, options, _later(given.progress))
    except MotionError as error:
        raise error.with_failures(observed.failed) from None
    if any(capture.kind in ("frame", "sweep") for capture in given.captures):
        from calib_core.captures.frame_uncertainty import with_calibration_uncertainty

        solution = with_calibration_uncertainty(given.session, given.read, solution)
    return SolvedTcp(solution, observed.observations, sphere, observed.unused)


def observe_stage(given: StageInput) -> Observed:
    """Return the sphere as the stage's captures saw it, and why some are of no use."""
    cell = given.session.cell
    captures = [capture for capture in given.captures if not capture.excluded]
    base_from_tool0_by_capture(cell, captures)
    unused = {capture.id: "excluded by the user" for capture in given.captures if capture.excluded}
    unused |= unfit(cell, captures)
    unused |= copies_of(captures, given.read)
    observations, failed = observe_all(given, [c for c in captures if c.id not in unused])
    return Observed(
        observations, failed, unused | {name: error.reason.removesuffix(".") for name, error in failed.items()}
    )


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
        given.progress(_MEASURING_SHARE * number / len(captures), f"Finding the sphere in {capture.id}")
        try:
            observations += _observe(given, capture)
            seen += 1
        except MeasurementError as error:
            failed[capture.id] = error
    if len(failed) > seen:
        first = next(iter(failed.values()))
        got = f"{first.got} ({len(failed)} of {len(captures)} captures do not show the sphere)"
        raise MeasurementError(first.need, got, first.to_do, first.where)
    return observations, failed


def _observe(given: StageInput, capture: Capture) -> list[SphereObservation]:
    """Return one observation of a capture, or one of each profile of a sweep that shows the sphere."""
    if capture.kind == "sweep":
        from calib_core.captures.sweep_sphere import observe_sweep

        return observe_sweep(given.session, capture, given.read)
    return [observe_capture(given.session, capture, given.read)]


def copies_of(captures: Sequence[Capture], read: ReadFile) -> dict[str, str]:
    """Return why captures that repeat another are left out; a copy at another pose is left to the solver."""
    by_id = {capture.id: capture for capture in captures}
    return {
        copy: f"a duplicate of {original}: the same file and pose, counted once"
        for copy, original in duplicates(captures, read).items()
        if same_place(by_id, copy, original)
    }


def _later(progress: Progress) -> Progress:
    return lambda fraction, message: progress(_MEASURING_SHARE + (1 - _MEASURING_SHARE) * fraction, message)


_R = TypeVar("_R", TcpResult, TurntableResult, ChainResult)


def with_unused(result: _R, captures: Sequence[Capture], unused: dict[str, str]) -> _R:
    """Return the result with a row for every capture, in their order, and a warning for those of no use."""
    rows: dict[str, TcpResidual | TurntableResidual] = one_row_each(result.residuals)
    for capture in captures:
        if capture.id in unused:
            row = TurntableResidual if capture.step == "turntable" else TcpResidual
            rows[capture.id] = row(capture=capture.id, used=False, reason=unused[capture.id])
    warnings = list(result.warnings)
    order = [capture.id for capture in captures]
    warnings += not_used({c.id: unused[c.id] for c in captures if c.id in unused and not c.excluded}, order)
    return result.model_copy(
        update={
            "residuals": mark_sweeps([rows[capture.id] for capture in captures], captures),
            "warnings": warnings,
            "verdict": "warn"
            if result.verdict == "pass" and len(warnings) > len(result.warnings)
            else result.verdict,
        }
    )
