"""Whether a TCP can be trusted: everything that is noticed of a solution, as findings."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from calib_core.causes.readings import moved_poses
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.held import ScannerError
from calib_core.chain.incidents import Happened
from calib_core.chain.observations import Observations, SphereSize, named
from calib_core.chain.repeated import repeats
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.undetermined import OpenDirection, about_travel, without_turns
from calib_core.findings import Finding
from calib_core.findings.code import Code
from calib_core.findings.codes import arm as arm_codes
from calib_core.findings.codes import causes as cause_codes
from calib_core.findings.codes import tcp as codes
from calib_core.findings.codes.causes import SWAPPED_POSES
from calib_core.records import BeforeAfter, Capture, CauseKind, Changes, RootCause
from calib_core.stages.axes_found import encoder_findings

_HOPELESS_SCATTER_MM = 5.0
_HOPELESS_SIGMA_MM = 2.5  # inverted poses leave 2.9 mm and more; arms that are only untrue stay below 1 mm
_LARGE_SIGMA_MM = 1.0
_MOST_REJECTED = 1 / 3
_CHI2_6_RARE = 22.5  # 99.9 %
_LIGHT = 0.5
_RIVAL_NEAR = 1.5
_CLEAR_LOG_ODDS = 5.0  # 150 : 1
_LEAST_LAG_MM = 0.05
_MUCH_MORE = 1.5
_LEAST_SCATTER_MM = 0.02
_FEW_SPARE = 9  # of five captures six are left: the estimated scatter then may be small by chance alone


def tcp_findings(
    solution: TcpSolution, captures: Sequence[Capture] = (), with_table: bool = False
) -> list[Finding]:
    """Return what is noticed of a solution: root causes first, and not what follows from them.

    Parameters
    ----------
    solution : TcpSolution
    captures : sequence of Capture
        Those of the session, of which the causes' remedies tell.
    with_table : bool
        Whether it is solved for a table, with which the scanner is used together.
    """
    misfit = _misfit(solution)
    failures = [
        *(misfit or [*_undetermined(solution, with_table), *_mirrored(solution, captures)]),
        *_too_many_rejected(solution),
    ]
    # Of captures that do not agree, none tells whose pose another one has.
    causes = [cause for cause in solution.beside.causes if not (misfit and cause.code is SWAPPED_POSES)]
    found = [*failures, *_doubts_about_captures(solution, causes, captures)]
    if not failures:
        found += _doubts_about_motion(solution)
        layout = solution.held.state.walk.layout
        asked = solution.given.options.scales_of(layout)
        found += encoder_findings(solution.encoders, layout, asked.__getitem__)
    if not misfit:
        found += _doubts_about_noise(solution)
    return [*found, *_notes(solution)]


def _misfit(solution: TcpSolution) -> list[Finding]:
    scatter = solution.joint.center_scatter_rms_mm
    if scatter <= _HOPELESS_SCATTER_MM and solution.noise.sigmas.position_mm <= _HOPELESS_SIGMA_MM:
        return []
    return [codes.POSES_DO_NOT_FIT(scatter_mm=scatter)]


def _undetermined(solution: TcpSolution, with_table: bool) -> list[Finding]:
    found = _open(solution.left_open.undetermined, codes.ROTATION_OPEN, codes.POSITION_OPEN)
    if some := without_turns(solution.left_open.shifts.directions):
        across = sorted({axis for one in some for axis in one.across.split(", ")})
        axes = ", ".join(one.axis for one in some)
        found.append(
            codes.PLACE_NOT_NEEDED(what="position", axes=axes)
            if with_table
            else codes.POSITION_WITHOUT_TURNS(axes=axes, across=", ".join(across))
        )
    for one in about_travel(solution.left_open.shifts.travel, solution.joint.mount_from_laser):
        found.append(
            codes.PLACE_NOT_NEEDED(what="rotation", axes=one.axis)
            if with_table
            else codes.ROTATION_ABOUT_TRAVEL(axis=one.axis)
        )
    return found


def _mirrored(solution: TcpSolution, captures: Sequence[Capture]) -> list[Finding]:
    """Return that nothing tells the answer from its mirror image, where one line of profiles is all there is."""
    told = any(one.side is not None and one.id in solution.each.ids for one in captures)
    profiles = all(zone is not None for zone in solution.each.zones)
    return (
        [codes.TOOL_MIRRORED()] if solution.left_open.shifts.travel is not None and profiles and not told else []
    )


def _open(directions: Sequence[OpenDirection], rotation: Code, position: Code) -> list[Finding]:
    """Return open directions, one finding each thing to do."""
    groups: dict[tuple[bool, str], list[OpenDirection]] = {}
    for one in directions:
        groups.setdefault((one.is_rotation, one.across), []).append(one)
    found: list[Finding] = []
    for (is_rotation, across), some in groups.items():
        axes = ", ".join(one.told for one in some)
        largest = float(max(one.sigma for one in some))
        if is_rotation:
            found.append(rotation(axes=axes, uncertainty_deg=float(np.rad2deg(2 * largest))))
        else:
            found.append(position(axes=axes, across=across, uncertainty_mm=2 * largest))
    return found


def _rejected(solution: TcpSolution) -> list[str]:
    return [name for name, used in zip(solution.each.ids, solution.each.used, strict=True) if not used]


def _too_many_rejected(solution: TcpSolution) -> list[Finding]:
    rejected, reasons = _rejected(solution), solution.each.reasons
    if len(rejected) <= _MOST_REJECTED * len(solution.each.ids):
        return []
    count = len(solution.each.ids)
    names = named(solution.each.ids, solution.each.used)
    return [codes.MANY_CONTRADICT(list(reasons), each=reasons, rejected=len(rejected), count=count, names=names)]


def _doubts_about_captures(
    solution: TcpSolution, causes: Sequence[Happened], captures: Sequence[Capture]
) -> list[Finding]:
    found = [incident_finding(cause, captures) for cause in causes]
    explained = {name for cause in causes for name in cause.captures}
    rejected, reasons = _rejected(solution), solution.each.reasons
    if 0 < len(rejected) <= _MOST_REJECTED * len(solution.each.ids):
        behind = found[0].code if set(rejected) <= explained else None
        names = named(solution.each.ids, solution.each.used)
        found.append(codes.CAPTURES_CONTRADICT(list(reasons), each=reasons, behind=behind, names=names))
    if _sides_are_open(solution):
        found.append(codes.SIDE_OPEN())
    return found


def _sides_are_open(solution: TcpSolution) -> bool:
    if solution.each.side_choice.log_odds is not None:
        return solution.each.side_choice.log_odds < _CLEAR_LOG_ODDS
    rival = solution.each.side_choice.rival_scatter_mm
    return rival is not None and rival < _RIVAL_NEAR * solution.each.side_choice.scatter_mm


def _doubts_about_motion(solution: TcpSolution) -> list[Finding]:
    undetermined = [d.direction for d in solution.left_open.undetermined]
    weak = [
        one
        for one in solution.left_open.weak
        if not any(abs(float(one.direction @ known)) > 0.9 for known in undetermined)
    ]
    found = _open(weak, codes.ROTATION_WEAK, codes.POSITION_WEAK)
    count = int(solution.each.used.sum())
    spare = 3 * count - 9
    if spare < _FEW_SPARE:
        found.append(codes.FEW_CAPTURES(count=count, spare=spare))
    return found + doubts_about_two_steps(solution)


def doubts_about_two_steps(solution: TcpSolution) -> list[Finding]:
    """Return what is noticed where the joint answer and the paper's two steps contradict each other."""
    if solution.by_two_steps.answer is None or solution.by_two_steps.beside_joint is None:
        return []
    if solution.held.errors:
        return []  # of arm or scanner: they move the two steps otherwise, and are said, with what to do
    joint, two_step = solution.joint.mount_from_laser, solution.by_two_steps.answer.mount_from_laser
    difference = joint.difference(two_step)
    distance = float(difference @ np.linalg.solve(solution.by_two_steps.beside_joint, difference))
    there = solution.in_view.seen_mm
    shift_mm = float(np.linalg.norm(joint.apply(there) - two_step.apply(there)))
    if distance <= _CHI2_6_RARE or shift_mm <= solution.in_view.stated_mm:
        return []
    return [codes.TWO_STEPS_DIFFER(shift_mm=shift_mm, turn_deg=float(np.rad2deg(np.linalg.norm(difference[:3]))))]


def _doubts_about_noise(solution: TcpSolution) -> list[Finding]:
    found: list[Finding] = []
    if solution.beside.excess > 1:
        options = solution.given.options
        told = options.position_sigma_mm is not None or options.orientation_sigma_rad is not None
        handled = "estimated" if told else "enlarged"
        found.append(codes.SCATTER_BEYOND_TOLD(times=float(np.sqrt(solution.beside.excess)), handled=handled))
    measured, given = solution.noise.measured_point_sigma_mm, solution.given.options.point_sigma_mm
    if measured and given and not 0.5 < measured / given < 2:
        found.append(codes.POINT_NOISE_DIFFERS(measured_mm=measured, told_mm=given))
    if solution.noise.sigmas.position_mm > _LARGE_SIGMA_MM:
        found.append(codes.POSES_SCATTER(scatter_mm=solution.noise.sigmas.position_mm))
    found.extend(_about(error, solution) for error in solution.held.errors)
    return found


def _about(error: ScannerError, solution: TcpSolution) -> Finding:
    values: dict[str, Any] = {"error_percent": 100 * error.error, "uncertainty_percent": 200 * error.sigma}
    if error.name == "arm_scale":
        return arm_codes.ARM_LENGTHS(error_percent=-100 * error.error, uncertainty_percent=200 * error.sigma)
    if error.name == "bow":
        return codes.SCANNER_BOW()
    handled = "applied" if solution.held.applied else "left"
    if error.name == "shear":
        return codes.SCANNER_SHEAR(handled=handled, **values)
    return codes.SCANNER_SCALE(handled=handled, axis=error.name[-1], **values)


def diameter_told(size: SphereSize) -> Finding:
    """Return what the solution takes a sphere's diameter to be."""
    return codes.SPHERE_DIAMETER(diameter_mm=size.diameter_mm, uncertainty_mm=2 * size.sigma_mm)


def _notes(solution: TcpSolution) -> list[Finding]:
    """Return what is worth knowing of a solution beside its doubts: what was assumed, and what counts less."""
    found: list[Finding] = []
    if any(solution.each.points):
        found.append(diameter_told(solution.given.sphere))
    light = {
        name: weight
        for name, used, weight in zip(solution.each.ids, solution.each.used, solution.each.weights, strict=True)
        if used and weight < _LIGHT
    }
    if light:
        weights = ", ".join(f"{name} ({weight:.0%})" for name, weight in light.items())
        found.append(codes.COUNT_LESS(list(light), weights=weights))
    return found + beyond_told_sigma(solution.noise.sigmas, solution.given.options.position_sigma_mm)


def beyond_told_sigma(sigmas: Sigmas, told_mm: float | None) -> list[Finding]:
    """Return a note where poses are less true than the sigma that was told of them.

    No reason for doubt: makers tell how well an arm repeats, and what it errs beyond that, alike where poses are
    alike, is estimated whatever is told.  Arms that repeat to some hundredths of a millimetre are true to tenths.

    Parameters
    ----------
    sigmas : Sigmas
        As found.
    told_mm : float or None
        Of a pose's position.
    """
    found_mm = sigmas.largest_position_mm
    if told_mm is None or not is_beyond(found_mm, told_mm):
        return []
    return [arm_codes.ARM_LESS_TRUE(found_mm=found_mm, told_mm=told_mm)]


def is_beyond(scatter_mm: float, expected_mm: float) -> bool:
    """Return whether a scatter is clearly larger than what was expected."""
    return scatter_mm > _MUCH_MORE * max(expected_mm, _LEAST_SCATTER_MM)


def lag_findings(observations: Observations, sigmas: Sigmas) -> list[Finding]:
    """Return what captures of a pose that was taken twice say of lag and play, or that nothing says it.

    Parameters
    ----------
    observations : the captures of the still sphere, in the order in which they were taken
    sigmas : Sigmas
        A pose's own scatter counts twice in a difference.
    """
    found = repeats(observations)
    if not found:
        return [arm_codes.LAG_NOT_CHECKED()]
    largest = max(found, key=lambda one: one.shift_mm)
    names = [largest.first, largest.again]
    usual_mm = 3 * np.sqrt(2) * sigmas.position_mm
    if largest.is_shift and largest.shift_mm > max(usual_mm, _LEAST_LAG_MM):
        return [arm_codes.LAG_NOT_CHECKED(), arm_codes.ARM_LAGS(names, shift_mm=largest.shift_mm)]
    return [arm_codes.POSES_REPEAT(names, shift_mm=largest.shift_mm)]


def incident_finding(happened: Happened, captures: Sequence[Capture] = ()) -> Finding:
    """Return a cause with its remedy: the smaller part of the session left out, or two poses exchanged."""
    return happened.code(list(happened.captures), remedy=_remedy(happened, captures), **happened.values)


def _remedy(happened: Happened, captures: Sequence[Capture]) -> RootCause:
    since = happened.captures[0]
    given: dict[str, str] = {}
    if happened.code is cause_codes.SWAPPED_POSES:
        one, other = happened.captures
        given = {one: other, other: one}
    shift = happened.values.get("shift_mm")
    evidence = [BeforeAfter(label="Moved by", unit="mm", before=shift, after=None)] if shift is not None else []
    return RootCause(
        id=f"{happened.kind}-{since}"[:64],
        kind=cast(CauseKind, happened.kind),
        evidence=evidence,
        captures=list(happened.captures),
        changes=_changes(given, happened, captures),
        poses_from=given,
    )


def _changes(given: dict[str, str], happened: Happened, captures: Sequence[Capture]) -> Changes | None:
    if not given:
        return _fewer(happened, captures)
    # Arrays that come without records have nothing to change.
    return moved_poses(given, (), captures) if given.keys() <= {capture.id for capture in captures} else None


def _fewer(happened: Happened, captures: Sequence[Capture]) -> Changes | None:
    used = [capture.id for capture in captures if not capture.excluded]
    after = [name for name in used if name in happened.captures]
    before = [name for name in used if name not in happened.captures]
    fewer = after if len(after) <= len(before) else before
    return Changes(captures={name: {"excluded": True} for name in fewer}) if fewer else None
