"""The TCP's solution as the record that is stored, sent and archived."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np

from calib_core.arms.alike import REACH_MM, REACH_RAD
from calib_core.chain.answer import Answer
from calib_core.chain.bend import Bend
from calib_core.chain.chain_data import Sigmas
from calib_core.chain.held import Held
from calib_core.chain.moved import OpticsError
from calib_core.chain.scanner import NAMES
from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.undetermined import about_travel, without_turns
from calib_core.findings import Finding, has, judgement, reasons_of
from calib_core.findings.codes import tcp as codes
from calib_core.frame_graph import apart_moves
from calib_core.frames import FloatArray, RigidTransform
from calib_core.records import Capture, Undetermined, VarianceComponents
from calib_core.records.results import ArmErrorsFound, AtPoint, FoundFrame, LeftInFiles, OpticsShift, ScannerFound
from calib_core.stages.axes_found import axes_found
from calib_core.stages.tcp.arm_found import arm_model_found
from calib_core.stages.tcp.record import TcpResidual, TcpResult, TwoStep
from calib_core.stages.tcp.verdict import tcp_findings
from calib_core.stages.tcp.warm_up import drift_findings, session_drift

METHOD = "joint maximum likelihood over points, pose errors integrated out"
_NAMES = ("rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm")


def tcp_result(
    solution: TcpSolution, software: str, inputs_sha256: str, findings: Sequence[Finding] | None = None
) -> TcpResult:
    """Return a solution as a record; its findings are what the solution itself shows, if none are given."""
    found = solution_findings(solution) if findings is None else findings
    joint = solution.joint
    covariance = solution.covariance
    return TcpResult(
        stage="tcp",
        method=METHOD,
        software=software,
        inputs_sha256=inputs_sha256,
        **judgement(found),
        covariance=covariance[:6, :6].tolist(),
        **placed(joint),
        sphere_center_covariance=covariance[6:9, 6:9].tolist(),
        surface_rms_mm=joint.surface_rms_mm,
        leave_one_out_surface_rms_mm=joint.leave_one_out_surface_rms_mm,
        center_scatter_rms_mm=joint.center_scatter_rms_mm,
        undetermined=[
            Undetermined(direction=d.direction.tolist(), description=str(d.description))
            for d in (
                *solution.left_open.undetermined,
                *about_travel(solution.left_open.shifts.travel, joint.mount_from_laser),
                *without_turns(solution.left_open.shifts.directions),
            )
        ],
        two_step=_two_step(solution),
        variance_components=_variance_components(solution),
        **scanners_found(solution),
        frames=mounts_found(solution.held),
        axes=axes_found(solution.held.state, solution.held.covariance),
        optics=[_optics_shift(solution, error) for error in solution.beside.optics],
        workpiece=AtPoint(
            point_in_laser_mm=solution.in_view.seen_mm.tolist(), covariance=solution.in_view.at_workpiece.tolist()
        ),
        arm_errors=_arm_errors(solution),
        arm_model=arm_model_found(solution),
        confidence_95=_confidence(covariance),
        warm_up=session_drift(solution),
        residuals=_residuals(solution, found),
    )


def solution_findings(
    solution: TcpSolution, captures: Sequence[Capture] = (), with_table: bool = False
) -> list[Finding]:
    """Return what a solution shows, its drift and what it has no room for too.

    Where nothing fits, drift and lag are what a wrong answer leaves, of any size.
    """
    found, bends = tcp_findings(solution, captures, with_table), [_bent(bend) for bend in solution.beside.bends]
    if has(found, codes.POSES_DO_NOT_FIT):
        return [*found, *bends]
    lag = solution.beside.unmodelled
    return [*found, *drift_findings(solution), *bends, *([lag.finding] if lag else [])]


def _bent(bend: Bend) -> Finding:
    handled = "solved" if bend.solved else "allowed"
    size, width = abs(bend.size_mm), bend.half_width_mm
    if not bend.scanner:
        return codes.SHEET_BENT(bend_mm=size, half_width_mm=width, handled=handled)
    handled += "-of-one"
    return codes.SHEET_BENT(bend_mm=size, half_width_mm=width, handled=handled, scanner=bend.scanner)


def placed(answer: Answer) -> dict[str, Any]:
    """Return where scanner and sphere are, by the names of what carries them."""
    return {
        f"{answer.mount_from_laser.into}_from_laser": answer.mount_from_laser.to_rows(),
        f"sphere_center_in_{answer.ball}_mm": answer.center_mm.tolist(),
    }


def _confidence(covariance: FloatArray) -> dict[str, float]:
    """Return half the width of the 95 % interval of each of the six parameters."""
    half = 1.96 * np.sqrt(np.diag(covariance)[:6])
    half[:3] = np.rad2deg(half[:3])
    return {name: float(value) for name, value in zip(_NAMES, half, strict=True)}


def scanners_found(solution: TcpSolution) -> dict[str, Any]:
    """Return what was found of sphere and scanner, or of each of several by its name."""
    mounts = solution.held.state.walk.layout.mounts
    if len(mounts) == 1 and not mounts[0][0]:
        return {"scanner": scanner_found(solution)}
    each = {name: scanner_found(solution, n) for n, (name, _) in enumerate(mounts)}
    return {"scanner": mounts[0][0], "scanner_errors": each}


def mounts_found(held: Held) -> list[FoundFrame]:
    """Return where scanners are on what carries them, and of several on one thing where they are to each other."""
    layout, state, found = held.state.walk.layout, held.state, list[FoundFrame]()
    if len(layout.mounts) == 1:
        return found
    for n, (name, carrier) in enumerate(layout.mounts):
        own = held.covariance[layout.mount(n), layout.mount(n)]
        rows = state.mount(n).to_rows()
        found.append(FoundFrame(into=carrier, outof="laser", scanner=name, matrix=rows, covariance=own.tolist()))
    for one, other in combinations(range(len(layout.mounts)), 2):
        if layout.mounts[one][1] == layout.mounts[other][1]:
            found.append(_between(held, one, other))
    return found


def _between(held: Held, one: int, other: int) -> FoundFrame:
    """Return a scanner's pose in another's frame, with what both share of their errors.

    It is known far better than what errors that stay in the files turn both by: these count by what they do,
    and what is open beside them as it is without them (`chain.apart`).
    """
    layout, state = held.state.walk.layout, held.state
    known, straight = held.known_off, held.straight
    right = straight.state if straight else replace(state, position=state.position.moved(layout, -known))
    apart, as_right = (at.mount(one).inverse() @ at.mount(other) for at in (state, right))
    rows = np.zeros((6, len(held.covariance)))
    rows[:, np.r_[layout.mount(one), layout.mount(other)]] = apart_moves(right.mount(one), right.mount(other))
    names = [f"laser:{layout.mounts[n][0]}" for n in (one, other)]
    off = as_right.difference(apart)
    covariance = rows @ (held.covariance - np.outer(known, known)) @ rows.T
    if straight:  # what is doubted beside the points stays
        values, vectors = np.linalg.eigh(covariance - rows @ straight.in_files @ rows.T)
        covariance = rows @ straight.covariance @ rows.T + (vectors * np.maximum(values, 0.0)) @ vectors.T
    covariance += np.outer(off, off)
    return FoundFrame(into=names[0], outof=names[1], matrix=apart.to_rows(), covariance=covariance.tolist())


def scanner_found(solution: TcpSolution, which: int = 0) -> ScannerFound:
    """Return what was found of a sphere and a scanner with its mount."""
    held = solution.held
    some, active = held.columns_of(which), held.active[held.nuisances_of(which)]
    covariance = held.covariance[some][:, some]
    name = held.state.walk.layout.mounts[which][0]
    bends = [bend for bend in solution.beside.bends if bend.solved and bend.scanner == name]
    return ScannerFound(
        names=[NAMES[held.data.kinds[k]] for k in active],
        values=held.found.scanner[active].tolist(),
        sigmas=np.sqrt(np.diag(covariance)[6:]).tolist(),
        covariance=covariance[6:, 6:].tolist(),
        covariance_with_tool=covariance[:6, 6:].tolist(),
        applied=held.applied,
        sphere_diameter_sigma_mm=solution.given.sphere.sigma_mm,
        half_width_mm=held.half_width_mm,
        facing=held.facing,
        left_in_files=_left_in_files(held, which),
        sheet_bend_mm=next((bend.at_mm(held.half_width_mm) for bend in bends), None),
    )


def _left_in_files(held: Held, which: int) -> LeftInFiles | None:
    if held.left is None:
        return None
    some = held.left[held.columns_of(which)]
    return LeftInFiles(tool=some[:6].tolist(), scanner=some[6:].tolist())


def _arm_errors(solution: TcpSolution) -> ArmErrorsFound | None:
    held = solution.held
    if held.arm is None:
        return None
    some = held.tool_and_scanner
    arm = held.arm.of(np.eye(len(held.covariance))[some])
    poses = zip(arm.rotations, arm.translations, strict=True)
    terms: dict[str, Any] = {}
    if solution.arm is not None and solution.arm.applied:
        sizes = np.array([term.sigma for term in solution.arm.terms])
        with_terms = (arm.with_terms * sizes).tolist()
        terms = {"tool_with_terms": with_terms[:6], "scanner_with_terms": with_terms[6:]}
        terms["term_moves"] = (arm.term_moves / sizes).tolist()
        terms["terms_with_lengths"] = (arm.terms_with_lengths * sizes).tolist()
        terms["terms_with_poses"] = by_pose(arm.terms_with_poses * sizes[:, None, None])
    return ArmErrorsFound(
        poses=[RigidTransform.of(r, t, "base", "tool0").to_rows() for r, t in poses],
        middle_mm=arm.middle_mm.tolist(),
        lengths_sigma=held.lengths_sigma,
        position_sigma_mm=arm.position_sigma_mm,
        orientation_sigma_rad=arm.orientation_sigma_rad,
        tool_with_lengths=arm.with_lengths[:6].tolist(),
        tool_with_poses=by_pose(arm.with_poses[:6]),
        scanner_with_lengths=arm.with_lengths[6:].tolist(),
        scanner_with_poses=by_pose(arm.with_poses[6:]),
        **terms,
    )


def by_pose(covariances: FloatArray) -> list[list[list[float]]]:
    """Return covariances (P, m, 6) with the errors at poses as rows (P) a pose."""
    return np.moveaxis(covariances, 1, 0).tolist()


def _optics_shift(solution: TcpSolution, error: OpticsError) -> OpticsShift:
    some = solution.held.tool_and_scanner
    return OpticsShift(
        source=error.source,
        tool=error.step[:6].tolist(),
        scanner=error.step[some[6:]].tolist(),
        at_mm=error.at_mm.tolist(),
        point_mm=error.point_mm.tolist(),
        by_place=error.by_place.tolist(),
    )


def components(
    sigmas: Sigmas, point_sigma_mm: float | None, points_per_independent: float, estimated: list[str]
) -> VarianceComponents:
    """Return the standard deviations as a record; `estimated` names those that nobody gave."""
    play = {"play_sigma_mm": sigmas.play_mm} if sigmas.play_mm else {}
    return VarianceComponents(
        point_sigma_mm=point_sigma_mm,
        position_sigma_mm=sigmas.position_mm,
        orientation_sigma_rad=sigmas.orientation_rad,
        orientation_sigma_deg=float(np.rad2deg(sigmas.orientation_rad)),
        estimated=estimated,
        alike_position_sigma_mm=sigmas.alike_position_mm,
        alike_orientation_sigma_rad=sigmas.alike_orientation_rad,
        reach_mm=REACH_MM * sigmas.reach,
        reach_rad=REACH_RAD * sigmas.reach,
        points_per_independent=points_per_independent,
        degrees_of_freedom=sigmas.freedom if np.isfinite(sigmas.freedom) else None,
        **play,
    )


def _variance_components(solution: TcpSolution) -> VarianceComponents:
    options, noise = solution.given.options, solution.noise
    estimated = ["point_sigma_mm"] if options.point_sigma_mm is None else []
    estimated += estimated_of_robot(noise.sigmas, options.position_sigma_mm, options.orientation_sigma_rad)
    return components(noise.sigmas, noise.point_sigma_mm, noise.points_per_independent, estimated)


def estimated_of_robot(sigmas: Sigmas, position_mm: float | None, orientation_rad: float | None) -> list[str]:
    """Return which of a robot's sigmas were estimated: not told, or told and contradicted by the captures."""
    names: list[str] = []
    if not sigmas.largest_position_mm:  # it is not on the way
        return names
    if position_mm != sigmas.position_mm:
        names.append("position_sigma_mm")
    if orientation_rad != sigmas.orientation_rad:
        names.append("orientation_sigma_rad")
    return names


def _two_step(solution: TcpSolution) -> TwoStep:
    names = [
        list(dict.fromkeys(solution.each.ids[k] for k in group)) for group in solution.by_two_steps.groups.groups
    ]
    paper = solution.by_two_steps.answer
    if paper is None:
        return TwoStep(translations=names, reason=solution.by_two_steps.groups.reason)
    covariance = solution.by_two_steps.covariance
    return TwoStep(
        **placed(paper),
        surface_rms_mm=paper.surface_rms_mm,
        leave_one_out_surface_rms_mm=paper.leave_one_out_surface_rms_mm,
        center_scatter_rms_mm=paper.center_scatter_rms_mm,
        covariance=None if covariance is None else covariance.tolist(),
        translations=names,
        reason=None,
    )


def _residuals(solution: TcpSolution, findings: Sequence[Finding]) -> list[TcpResidual]:
    reasons = reasons_of(findings)
    joint, influence = solution.joint, solution.each.influence
    return [
        TcpResidual(
            capture=name,
            used=bool(solution.each.used[k]),
            reason=None if solution.each.used[k] else reasons.get(name),
            points=solution.each.points[k],
            surface_rms_mm=float(joint.capture_rms_mm[k]),
            center_distance_mm=float(np.linalg.norm(joint.offset_mm[k])),
            **{f"center_offset_in_{joint.ball}_mm": joint.offset_mm[k].tolist()},
            leave_one_out_rms_mm=_finite(joint.leave_one_out_rms_mm[k]),
            two_step_surface_rms_mm=_two_step_rms(solution.by_two_steps.answer, k),
            mahalanobis=float(np.sqrt(solution.each.squared_distance[k])),
            weight=float(solution.each.weights[k]),
            side=int(solution.each.sides[k]) or None,
            zone=solution.each.zones[k],
            shift_without_mm=_finite(influence.shift_mm[k]),
            turn_without_deg=_finite(np.rad2deg(influence.turn_rad[k])),
            growth_without=_finite(influence.growth[k]),
        )
        for k, name in enumerate(solution.each.ids)
    ]


def _two_step_rms(paper: Answer | None, capture: int) -> float | None:
    return None if paper is None else float(paper.capture_rms_mm[capture])


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
