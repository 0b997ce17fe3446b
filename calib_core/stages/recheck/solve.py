"""The recheck stage: repeated captures found by their poses and compared, round by round."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from calib_core.arms.errors import places_of_zeros
from calib_core.captures.arm_joints import terms_of
from calib_core.captures.content import sphere_of
from calib_core.captures.contradictions import EXCLUDED
from calib_core.chain.observations import SphereObservation, SphereSize
from calib_core.errors import MotionError
from calib_core.findings import Finding, judgement, reasons_of, sentence_of
from calib_core.findings.codes import recheck as codes
from calib_core.frames import FloatArray, RigidTransform
from calib_core.graph.stage import SOFTWARE
from calib_core.graph.stage_input import StageInput
from calib_core.records import Session
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.recheck.compare import Alike, Change, compared
from calib_core.stages.recheck.record import RecheckResidual, RecheckResult, RecheckRound
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.tcp.solve import observe_stage
from calib_core.stages.verify.held_out import held_out
from calib_core.stages.verify.on_axes import axes_of_answer, on_axes
from calib_core.stages.verify.tool import Tool

ENOUGH = 3
_ANSWER_SHARE = 0.6
_NEAR_MM, _NEAR_RAD = 20.0, float(np.deg2rad(3.0))


@dataclass(frozen=True, eq=False)
class _Stop:
    """What was seen with the flange where the axes brought it, the arm's own pose, the ball's centre (3,)."""

    seen: SphereObservation
    arm: RigidTransform
    center_mm: FloatArray


@dataclass(frozen=True, eq=False)
class _Pair:
    then: SphereObservation
    now: SphereObservation
    center_mm: FloatArray
    round: int


def solve(given: StageInput) -> RecheckResult:
    """Return whether the calibration still holds.

    Raises
    ------
    InputError
        If a file or a pose is of no use, or the tool was brought: then nothing was captured to compare with.
    MeasurementError
        If most captures do not show the sphere.
    MotionError
        If no capture repeats a pose of the calibration.
    """
    require_still_sphere(given.session)
    observed = observe_stage(given)
    stage = "chain" if any(capture.step == "turntable" for capture in given.session.captures) else "tcp"
    answer = given.solve_other(stage, lambda fraction, message: given.progress(_ANSWER_SHARE * fraction, message))
    assert isinstance(answer, TcpResult | ChainResult)
    own = {capture.id for capture in given.captures if capture.step == "recheck"}
    used = {row.capture for row in answer.residuals if row.used}
    on = on_axes(observed.observations, given.captures, axes_of_answer(given.session.cell, answer))
    sphere = sphere_of(given.session.cell, [capture for capture in given.captures if not capture.excluded])
    tool = Tool.of(answer).exact
    centers = _centers(on, used - own, sphere, tool)
    on = tool.straightened(on, np.array(centers), sphere.radius_mm)
    each = zip(on, observed.observations, centers, strict=True)
    stops = [_Stop(seen, o.base_from_tool0, center) for seen, o, center in each]
    before = [stop for stop in stops if stop.seen.capture not in own and stop.seen.capture in used]
    pairs, alone = _paired([stop for stop in stops if stop.seen.capture in own], before)
    if not pairs:
        lost = [reason for name, reason in reasons_of(observed.unused).items() if name in own]
        need = "captures with step 'recheck' from poses of the calibration"
        to_do = "Drive to poses of the calibration again and capture the sphere there, still in its place."
        raise MotionError(
            need, lost[0] if lost else "none within 20 mm and 3° of one that was used", to_do, "captures"
        )
    rounds = sorted({pair.round for pair in pairs})
    parts = answer.variance_components
    alike = Alike(
        parts.alike_position_sigma_mm, parts.alike_orientation_sigma_rad, parts.reach_mm, parts.reach_rad
    )
    zeros = places_of_zeros([term.name for term in terms_of(given.session.cell)])
    told: list[RecheckRound] = []
    rows: list[RecheckResidual] = []
    for number in rounds:
        changes: list[tuple[list[_Pair], Change]] = []
        scanners = list(dict.fromkeys(pair.now.scanner for pair in pairs if pair.round == number))
        for scanner in scanners:
            own = [pair for pair in pairs if (pair.round, pair.now.scanner) == (number, scanner)]
            then, now = [pair.then for pair in own], [pair.now for pair in own]
            center = np.array([pair.center_mm for pair in own])
            mount, many = tool.of_scanner(scanner), len(scanners)
            changes.append((own, compared(then, now, sphere.radius_mm, center, mount, alike, zeros, many)))
            rows += _rows(*changes[-1])
        told.append(_told(changes))
    out = {capture.id: str(EXCLUDED) for capture in given.captures if capture.excluded}
    not_repeated = [codes.POSE_NOT_REPEATED(alone)] if alone else []
    reasons = {**out, **reasons_of([*observed.unused, *not_repeated])}
    unused = {name: reason for name, reason in reasons.items() if name in own}
    rows += [RecheckResidual(capture=name, used=False, reason=reason) for name, reason in unused.items()]
    order = [capture.id for capture in given.captures if capture.step == "recheck"]
    last = told[-1]
    again = {(pair.now.scanner, pair.now.capture) for pair in pairs if pair.round == rounds[-1]}
    used_by = {stop.seen.scanner for stop in before}
    found = _noticed(last, {name: sum(name == by for by, _ in again) for name in used_by})
    return RecheckResult(
        method="figures of repeated captures, now minus then, by their noise and the robot's repeatability",
        software=SOFTWARE,
        inputs_sha256=given.inputs_sha256,
        **judgement([*found, *not_repeated]),
        rechecked=stage,
        holds=last.changed == "nothing",
        changed=last.changed,
        change_mm=last.change_mm,
        uncertainty_mm=last.uncertainty_mm,
        rounds=told,
        residuals=sorted(rows, key=lambda row: order.index(row.capture)),
    )


def require_still_sphere(session: Session) -> None:
    """Refuse a session that spheres on axes alone calibrated: no pose of it can be repeated by itself."""
    steps = {capture.step for capture in session.captures if not capture.excluded}
    if "turntable" in steps and "tcp" not in steps:
        raise MotionError(
            "a calibration by a sphere that stood still",
            "one by spheres on axes alone",
            "Capture some of its angles again as a session of their own, solve it, and let `scancell drift` hold "
            "both against each other.",
            "captures",
        )


def _centers(
    seen: Sequence[SphereObservation], used: Collection[str], sphere: SphereSize, tool: Tool
) -> list[FloatArray]:
    """Return the centre (3,) on its carrier of the ball that each capture shows, as the calibration has it.

    Where it leaves that open, the captures that it used say it, by the tool as it is used.
    """
    found = [tool.nearest_ball(one, sphere) for one in seen]
    centers = [center for _, _, center in found]
    for scanner in {one.scanner for one, (ball, _, _) in zip(seen, found, strict=True) if not ball}:
        some = [one for one in seen if one.scanner == scanner and one.capture in used]
        if len(some) > 1:
            center = held_out(some, sphere, tool.of_scanner(scanner)).center_mm
            centers = [center if one.scanner == scanner else at for one, at in zip(seen, centers, strict=True)]
    return centers


def _paired(now: Sequence[_Stop], then: Sequence[_Stop]) -> tuple[list[_Pair], list[str]]:
    """Return each capture with the nearest of the calibration; a pose that comes again begins a round."""
    pairs: list[_Pair] = []
    alone: list[str] = []
    number, repeated = 1, dict[str, str]()
    for stop in now:
        one, alike = stop.seen, [other for other in then if _alike(stop.seen, other.seen)]
        nearest = min(alike, key=lambda other: (_distance(stop, other), _beside(stop, other)), default=None)
        if nearest is None or _distance(stop, nearest) > 1:
            alone.append(one.capture)
            continue
        if repeated.get(nearest.seen.capture, one.capture) != one.capture:
            number, repeated = number + 1, {}
        repeated[nearest.seen.capture] = one.capture
        pairs.append(_Pair(nearest.seen, one, nearest.center_mm, number))
    paired = {pair.now.capture for pair in pairs}
    return pairs, [name for name in dict.fromkeys(alone) if name not in paired]


def is_repeated(one: RigidTransform, other: RigidTransform) -> bool:
    """Return whether a pose counts as another one repeated."""
    return _apart(one, other) <= 1


def _alike(one: SphereObservation, other: SphereObservation) -> bool:
    return (one.kind, one.scanner) == (other.kind, other.scanner)


def _beside(one: _Stop, other: _Stop) -> float:
    """Return how far apart two balls are in view: which of several it is."""
    return float(np.linalg.norm(one.seen.center_in_laser_mm - other.seen.center_in_laser_mm))


def _distance(one: _Stop, other: _Stop) -> float:
    by_axes = _apart(one.seen.base_from_tool0, other.seen.base_from_tool0)
    return max(by_axes, _apart(one.arm, other.arm))  # an arm that stands elsewhere errs in another way


def _apart(one: RigidTransform, other: RigidTransform) -> float:
    """Return how far two poses lie apart, 1 at the edge of what counts as repeated."""
    step = one.difference(other)
    return max(float(np.linalg.norm(step[3:])) / _NEAR_MM, float(np.linalg.norm(step[:3])) / _NEAR_RAD)


def _told(changes: Sequence[tuple[Sequence[_Pair], Change]]) -> RecheckRound:
    """Return what a round says: of several scanners the one whose change is least likely chance."""
    pairs, change = min(changes, key=lambda one: one[1].chance)
    bump = change.bump
    told = RecheckRound(
        captures=list(dict.fromkeys(pair.now.capture for own, _ in changes for pair in own)),
        scanner=pairs[0].now.scanner or None,
        change_mm=change.change_mm,
        uncertainty_mm=change.uncertainty_mm,
        change_in_laser_mm=change.shift_in_laser_mm.tolist(),
        chance=min(1.0, len(changes) * change.chance),
        changed=change.changed,
        joint=bump and bump.joint,
        joint_deg=bump and bump.change_deg,
        joint_uncertainty_deg=bump and 2 * bump.sigma_deg,
        sentence="",
    )
    return told.model_copy(update={"sentence": sentence_of(_finding(told))})


def _rows(pairs: Sequence[_Pair], change: Change) -> list[RecheckResidual]:
    rows: list[RecheckResidual] = []
    for name in dict.fromkeys(pair.now.capture for pair in pairs):
        places = [k for k, pair in enumerate(pairs) if pair.now.capture == name]
        pair = pairs[places[0]]
        step = pair.now.base_from_tool0.difference(pair.then.base_from_tool0)
        spread = np.trace(change.covariances[places], axis1=1, axis2=2)
        rows.append(
            RecheckResidual(
                capture=name,
                used=True,
                repeats=pair.then.capture,
                round=pair.round,
                change_mm=float(np.sqrt(np.mean(np.sum(change.differences[places] ** 2, axis=1)))),
                expected_mm=float(np.sqrt(spread.mean())),
                mahalanobis=float(np.sqrt(np.mean(change.mahalanobis[places] ** 2))),
                pose_distance_mm=float(np.linalg.norm(step[3:])),
                pose_turn_deg=float(np.rad2deg(np.linalg.norm(step[:3]))),
            )
        )
    return rows


def _finding(told: RecheckRound) -> Finding:
    change: dict[str, Any] = {"change_mm": told.change_mm, "uncertainty_mm": told.uncertainty_mm}
    if told.changed == "nothing":
        return codes.STILL_HOLDS(**change)
    if told.scanner is not None:
        change["scanner"] = told.scanner
    if told.joint is not None and told.joint_deg is not None and told.joint_uncertainty_deg is not None:
        change |= {"joint": told.joint, "deg": told.joint_deg, "uncertainty_deg": told.joint_uncertainty_deg}
    of_one = told.scanner is not None and told.changed in ("tool", "tool-or-sphere")
    return codes.CALIBRATION_CHANGED(changed=f"{told.changed}-of-one" if of_one else told.changed, **change)


def _noticed(last: RecheckRound, repeated: Mapping[str, int]) -> list[Finding]:
    """Return whether the calibration holds, and whether so few captures of each scanner can tell."""
    found, enough = [_finding(last)], ENOUGH * len(repeated)
    count = sum(min(ENOUGH, own) for own in repeated.values())
    if last.changed == "nothing" and count < enough:
        found.append(codes.FEW_REPEATED(count=count, enough=enough))
    return found
