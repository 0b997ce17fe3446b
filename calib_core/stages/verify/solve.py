"""The verify stage: the answer's tool taken as it is, the sphere seen with it by captures of their own."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from calib_core.captures.arm_joints import corrected_captures
from calib_core.captures.content import sphere_of
from calib_core.captures.contradictions import EXCLUDED
from calib_core.captures.placement import Placement
from calib_core.cell.carriers import other_end, scanner_mount
from calib_core.cell.found import known_scanner, mounts_of, told_by
from calib_core.chain.observations import Observations, SphereSize
from calib_core.errors import MotionError
from calib_core.findings import judgement, reasons_of
from calib_core.findings.codes import verify as codes
from calib_core.findings.codes.placed_scanners import SCANNER_NOT_PLACED
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import Observed, StageInput
from calib_core.messages import message
from calib_core.records import Capture, Verification
from calib_core.records.findings import Finding
from calib_core.records.results import ArmModelFound
from calib_core.stages.tcp.record import ToolResult
from calib_core.stages.tcp.solve import observe_stage
from calib_core.stages.verify.agreement import disagreeing
from calib_core.stages.verify.calibrated import that_calibrated
from calib_core.stages.verify.contradictions import contradictions
from calib_core.stages.verify.decision import (
    TITLES,
    Estimate,
    checked,
    decision_findings,
    moved_findings,
    overall,
    probing,
    scatter_findings,
    tool_error,
)
from calib_core.stages.verify.flatness import Plate, plate
from calib_core.stages.verify.held_out import HeldOut, held_out, in_one_plane, together
from calib_core.stages.verify.joint_moved import joint_findings
from calib_core.stages.verify.limits import LIMITS, limit_findings
from calib_core.stages.verify.on_axes import axes_of_answer, axis_moves, on_axes
from calib_core.stages.verify.record import VerifyCheck, VerifyResidual, VerifyResult
from calib_core.stages.verify.spacing import LEAST_CAPTURES, by_sphere, seen_once, spacing
from calib_core.stages.verify.tool import Tool
from calib_core.steps import steps_that_show

_ANSWER_SHARE = 0.6
_LEAST_PROBED = 4
_NOT_PLACED = "not-in-answer"


def solve(given: StageInput) -> VerifyResult:
    """Return how far the sphere's centre scatters over captures that the answer was not solved from.

    Where a flat plate alone was captured its flatness decides.

    Raises
    ------
    InputError
        If a file or a pose is of no use, or there is no answer to verify.
    MeasurementError
        If most captures do not show the sphere.
    MotionError
        If fewer than two captures show it, or captures of a plate alone do not tell its flatness.
    """
    tool, axes, verified, doubts, arm = _tool(given)
    given = replace(given, captures=corrected_captures(given.session.cell, given.captures, arm))
    steps = {capture.step for capture in given.captures if not capture.excluded}
    if "plate" in steps and "verify" not in steps:
        return _by_plate_alone(given, tool, axes, verified, doubts)
    of_sphere = [capture for capture in given.captures if capture.step == "verify"]
    observed = observe_stage(replace(given, captures=of_sphere))  # which asks for names where sizes are open
    sphere = sphere_of(given.session.cell, [capture for capture in of_sphere if not capture.excluded])
    observed = replace(observed, observations=on_axes(observed.observations, of_sphere, axes))
    observed = _without(observed, [*_not_placed(observed.observations, tool)])
    tool = replace(tool, axis_moves=axis_moves(of_sphere, axes))
    same = [] if verified == "known" else _that_calibrated(given, of_sphere, observed.observations, axes)
    observed = _without(observed, same)
    limits = given.session.cell.verification
    count = len({o.capture for o in observed.observations})
    if count < LEAST_CAPTURES and not (same and _limited(limits)):
        need = "{least_captures} captures with step 'verify' that show the sphere, ten are good"
        to_do = "Capture the sphere, standing still, from poses that were not used for the TCP."
        raise MotionError(need, f"{count}", to_do, "captures", least_captures=LEAST_CAPTURES)
    groups = by_sphere(observed.observations, of_sphere, tool, sphere)
    alone = seen_once(groups)
    if alone and count >= LEAST_CAPTURES:
        observed, same = _without(observed, alone), [*same, *alone]
        groups = by_sphere(observed.observations, of_sphere, tool, sphere)
        count = len({o.capture for o in observed.observations})
    if not groups and alone:
        names = [str(one.values["sphere"]) for one in alone]
        to_do = message("Capture sphere '{alone}' again, or give its capture the right `mount`.", alone=names[0])
        need = "{least_captures} captures of each sphere"
        raise MotionError(
            need, "one of '{alone}'", to_do, "captures", least_captures=LEAST_CAPTURES, alone=names[0]
        )
    flat = _plate(given, tool, axes)
    late = limit_findings(limits)
    checks = flat.checks(limits) if flat else []
    left_out = [one for one in observed.unused if one.code == SCANNER_NOT_PLACED.name]
    findings, found, doubtful, moved = [*left_out, *same], None, list[Finding](), list[Finding]()
    knows_uncertainty = bool(tool.covariance.any() or tool.position_sigma_mm or tool.orientation_sigma_rad)
    if count >= LEAST_CAPTURES:
        groups = {
            (mount, by): in_one_plane(seen, seen[0].size(sphere), tool.of_scanner(by))
            for (mount, by), seen in groups.items()
        }
        observed = replace(observed, observations=[o for seen in groups.values() for o in seen])
        parts = [
            held_out(seen, seen[0].size(sphere), tool.of_scanner(scanner)) for (_, scanner), seen in groups.items()
        ]
        found = together(parts)
        (_, scanner), first = next(iter(groups.items()))
        size = first[0].size(sphere)
        own, spheres = (
            tool.of_scanner(scanner),
            {mount: seen for (mount, by), seen in groups.items() if by == scanner},
        )
        doubtful = contradictions(first, size.radius_mm, found)
        errors = {
            by: tool_error(part.asked, tool.of_scanner(by))
            for (_, by), part in reversed([*zip(groups, parts, strict=True)])
        }
        checks = [
            *_checks(given, first, size, own, [*errors.values()], not doubtful),
            *_spacing(given, spheres, sphere, own),
            *checks,
        ]
        wrong = [*doubtful, *_disagreeing(first, size, found)]
        findings += wrong
        moved = joint_findings(given.session.cell, arm, first, size, own, parts[0])
        if not (moved or wrong) and knows_uncertainty:
            moved = moved_findings(found, checks)
    unchecked = unchecked_limits(limits, checks, flat)
    decision = overall(checks, len(unchecked))
    findings += [
        *([] if doubtful else decision_findings(checks, count)),
        *doubts,
        *(flat.findings if flat else []),
        *late,
        *unchecked,
    ]
    scattered = scatter_findings(found, knows_uncertainty, decision, moved) if found is not None else []
    findings += [*scattered, *moved]
    surfaces = np.empty(0) if found is None else found.surface_rms_mm[np.isfinite(found.surface_rms_mm)]
    return VerifyResult(
        method="centre of a still sphere over held-out captures, by their and the answer's covariance",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(findings),
        verified=verified,
        **told_by(tool.mount_from_laser),
        surface_rms_mm=float(np.sqrt(np.mean(surfaces**2))) if len(surfaces) else None,
        **_figures(found, knows_uncertainty, other_end(scanner_mount(given.session.cell))),
        checks=checks,
        decision=decision,
        limits_changed=[change.text for change in late],
        residuals=[
            *_rows(of_sphere, observed.observations, reasons_of(observed.unused), found, sphere),
            *(flat.residuals if flat is not None else []),
        ],
    )


def _figures(found: HeldOut | None, knows_uncertainty: bool, ball: str) -> dict[str, Any]:
    """Return the fields that are of the sphere, on what carries it; all null where too few captures count."""
    knows = found is not None and knows_uncertainty
    return {
        **_centers({} if found is None else {ball: found.center_mm.tolist()}),
        "sphere_center_covariance": None if found is None else found.covariance.tolist(),
        "held_out_scatter_rms_mm": None if found is None else found.scatter_rms_mm,
        "expected_scatter_rms_mm": found.expected_scatter_rms_mm if found and knows else None,
        "chi_squared": found.chi_squared if found and knows else None,
        "degrees_of_freedom": 0 if found is None else found.degrees_of_freedom,
        "chance": found.chance if found and knows else None,
        "moved_chance": found.moved_chance if found and knows else None,
    }


def _centers(found: Mapping[str, list[float]]) -> dict[str, Any]:
    """Return the fields of the sphere's centre by what carries it; both null where none is found."""
    return {f"sphere_center_in_{carrier}_mm": found.get(carrier) for carrier in ("base", "tool0")}


def _that_calibrated(
    given: StageInput, held_out: Sequence[Capture], seen: Observations, axes: Placement | None
) -> list[Finding]:
    """Return which captures of the verification are those of the calibration."""
    verifying, steps = {c.id for c in held_out}, steps_that_show("sphere", "sphere-on-table")
    seen_before = [c for c in given.session.captures if c.step in steps and c.id not in verifying]
    used = [c for c in seen_before if not c.excluded]
    own = [capture for capture in held_out if not capture.excluded]
    still = [capture for capture in used if capture.step == "tcp"]
    before = observe_stage(replace(given, captures=still)).observations if still else []
    return that_calibrated(own, used, seen, on_axes(before, still, axes), given.read)


def _without(observed: Observed, same: Sequence[Finding]) -> Observed:
    """Return what was observed without captures that do not count."""
    out = {name for finding in same for name in finding.captures}
    kept = [o for o in observed.observations if o.capture not in out]
    return replace(observed, observations=kept, unused=[*observed.unused, *same])


def _not_placed(observations: Observations, tool: Tool) -> Iterator[Finding]:
    """Give a finding for each scanner of which the answer does not say where it is: it verifies nothing."""
    others: dict[str, list[str]] = {}
    for one in observations:
        if not tool.places(one):
            others.setdefault(one.scanner, []).append(one.capture)
    for scanner, names in others.items():
        yield SCANNER_NOT_PLACED([*dict.fromkeys(names)], scanner=scanner, why=_NOT_PLACED)


def _disagreeing(observations: Observations, sphere: SphereSize, found: HeldOut) -> list[Finding]:
    """Return which captures the others contradict."""
    named = disagreeing(observations, sphere.radius_mm, found.asked)
    each = {name: {"sigmas": round(sigmas, 1)} for name, sigmas in named.items()}
    return [codes.CAPTURES_DISAGREE(list(named), each=each)] if named else []


def _limited(limits: Verification) -> bool:
    return any(value is not None for name, value in limits.model_dump().items() if name in LIMITS)


def _plate(given: StageInput, tool: Tool, axes: Placement | None) -> Plate | None:
    captures = [capture for capture in given.captures if capture.step == "plate"]
    return plate(
        given.session,
        captures,
        given.read,
        axes or Placement(tool.mount_from_laser, None, sheet_per_mm=tool.sheet_per_mm),
    )


def _by_plate_alone(
    given: StageInput, tool: Tool, axes: Placement | None, verified: str, doubts: list[Finding]
) -> VerifyResult:
    """Return what a flat plate says of the tool, where no sphere was captured."""
    limits = given.session.cell.verification
    flat = _plate(given, tool, axes)
    if flat is None or not (checks := flat.checks(limits)):
        to_do = "" if flat is None else flat.why_not
        raise MotionError("captures of a plate that tell its flatness", "too few of use", to_do, "captures")
    late, unchecked = limit_findings(limits), unchecked_limits(limits, checks, flat)
    decision = overall(checks, len(unchecked))
    count = sum(row.used for row in flat.residuals)
    findings = [*decision_findings(checks, count), *doubts, *unchecked, *flat.findings, *late, codes.PLATE_ALONE()]
    findings += [codes.PLATE_WITHOUT_LIMIT()] if decision is None else []
    return VerifyResult(
        method="flatness of a plate over held-out captures, with the answer's tool",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement(findings),
        verified=verified,
        **told_by(tool.mount_from_laser),
        **_centers({}),
        sphere_center_covariance=None,
        surface_rms_mm=None,
        held_out_scatter_rms_mm=None,
        expected_scatter_rms_mm=None,
        chi_squared=None,
        degrees_of_freedom=0,
        chance=None,
        checks=checks,
        decision=decision,
        limits_changed=[change.text for change in late],
        residuals=flat.residuals,
    )


def _checks(
    given: StageInput,
    observations: Observations,
    sphere: SphereSize,
    tool: Tool,
    errors: Sequence[Estimate],
    sound: bool,
) -> list[VerifyCheck]:
    """Return the figures that limits may be set for, each with its limit; unsound captures decide none."""
    limits = given.session.cell.verification
    error = max(errors, key=lambda one: one.value_mm)
    count = len({o.capture for o in observations}) if sound else 0
    checks = [checked("tool", error, limits.tool_mm, count)]
    points = [
        (o.ball_from_scanner @ tool.mount_from_laser).apply(o.points_in_laser_mm)
        for o in observations
        if len(o.points_in_laser_mm)
    ]
    if len(points) >= _LEAST_PROBED:
        figures = probing(points, sphere.diameter_mm, sphere.sigma_mm)
        checks += [
            checked("form", figures["form"], limits.form_mm, count),
            checked("form_95", figures["form_95"], limits.form_95_mm, count),
            checked("size", figures["size"], limits.size_mm, count),
        ]
    return checks


def unchecked_limits(limits: Verification, checks: Sequence[VerifyCheck], flat: Plate | None) -> list[Finding]:
    """Return the limits that were set and that these captures cannot be held to."""
    found = {check.name for check in checks}
    of_plate = (
        flat.why_not if flat is not None else message("It needs captures of a flat plate, with step 'plate'.")
    )
    probing = message("It needs points on the sphere from {least} captures or more.", least=_LEAST_PROBED)
    of_bar = message("It needs the ball bar's length, and captures of both spheres, told apart by their mounting.")
    to_do = dict.fromkeys(TITLES, probing) | {"spacing": of_bar, "flatness": of_plate, "flatness_95": of_plate}
    to_do["tool"] = message("It needs captures of the sphere, with step 'verify'.")
    told = {name: getattr(limits, f"{name}_mm") for name in TITLES}
    return [
        codes.LIMIT_NOT_CHECKED(what=TITLES[name], limit_mm=limit_mm, to_do=to_do[name])
        for name, limit_mm in told.items()
        if limit_mm is not None and name not in found
    ]


def _spacing(
    given: StageInput, spheres: Mapping[str, Observations], sphere: SphereSize, tool: Tool
) -> list[VerifyCheck]:
    """Return the ball bar's figure, where its calibrated length is told and both of its spheres were captured."""
    told = given.session.cell.verification
    if told.ball_bar_mm is None:
        return []
    error = spacing(spheres, sphere, tool, told.ball_bar_mm, told.ball_bar_sigma_mm or 0.0)
    return [] if error is None else [checked("spacing", error, told.spacing_mm)]


def _tool(given: StageInput) -> tuple[Tool, Placement | None, str, list[Finding], ArmModelFound | None]:
    """Return the tool to verify, the axes, its stage or "known", what is to be doubted, and the arm's errors."""
    cell = given.session.cell
    if (tool := known_scanner(cell)) is not None:
        robot = cell.robot.position_sigma_mm or 0.0, cell.robot.orientation_sigma_rad or 0.0
        mounts = mounts_of(cell.known.frames or [])
        return Tool(tool, np.zeros((6, 6)), *robot, others=mounts), None, "known", [], None
    stage = "chain" if any(capture.step == "turntable" for capture in given.session.captures) else "tcp"
    answer = given.solve_other(stage, lambda fraction, message: given.progress(_ANSWER_SHARE * fraction, message))
    assert isinstance(answer, ToolResult)
    failed = answer.verdict == "fail"
    doubts = [codes.VERIFIED_ANSWER_FAILS(stage=stage)] if failed else []
    return Tool.of(answer), axes_of_answer(cell, answer), stage, doubts, answer.arm_model


def _rows(
    captures: Sequence[Capture],
    observations: Observations,
    unused: dict[str, str],
    found: HeldOut | None,
    sphere: SphereSize,
) -> list[VerifyResidual]:
    """Return one row a capture; of a sweep the root mean squares over its profiles, and their mean offset."""
    places: dict[str, list[int]] = {}
    for k, observation in enumerate(observations):
        places.setdefault(observation.capture, []).append(k)
    rows: list[VerifyResidual] = []
    for capture in captures:
        own = places.get(capture.id)
        if own is None or found is None:
            reason = str(EXCLUDED) if capture.excluded else unused.get(capture.id)
            rows.append(VerifyResidual(capture=capture.id, used=False, reason=reason))
            continue
        offsets, surfaces = found.offsets_mm[own], found.surface_rms_mm[own]
        circles = [observations[k].circle_radius_mm for k in own]
        radius_mm = observations[own[0]].size(sphere).radius_mm
        sides = set(found.sides[own].tolist())
        rows.append(
            VerifyResidual(
                capture=capture.id,
                used=True,
                points=sum(len(observations[k].points_in_laser_mm) for k in own),
                surface_rms_mm=_root_mean_square(surfaces) if np.isfinite(surfaces).all() else None,
                center_offset_in_base_mm=offsets.mean(axis=0).tolist(),
                center_distance_mm=_root_mean_square(np.linalg.norm(offsets, axis=1)),
                expected_center_distance_mm=_root_mean_square(found.expected_offsets_mm[own]),
                mahalanobis=_root_mean_square(np.sqrt(found.squared_distances[own])),
                side=(int(sides.pop()) or None) if len(sides) == 1 and circles[0] is not None else None,
                zone=max((c / radius_mm for c in circles if c is not None), default=None),
                profiles=len(own) if capture.kind == "sweep" else None,
            )
        )
    return rows


def _root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))
