"""Arms of six classes before a tracker: what their own errors, solved with the tool, bring at other poses."""

import os
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from harness import Row, kept
from scipy.stats import chi2

from calib_core.arms.errors import arm_moves
from calib_core.captures.arm_joints import corrected_by
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.records.results import ArmTerms
from calib_core.review.between_sessions import SolvedSession
from calib_core.review.drift import DriftPoint, cell_drift
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.recheck.record import RecheckResult
from calib_core.stages.tcp.record import TcpResult
from calib_core.stages.verify.record import VerifyResult
from tests.arm_cell import (
    ARM_KINDS,
    ArmCell,
    ArmKind,
    held_out_rms_mm,
    later_before_a_tracker,
    later_on_an_arm,
    simulate_arm,
)


def solved(session: Session) -> TcpResult:
    """Return the tool of a session without files."""
    result = solve_stage(session, "tcp", lambda _name: b"")
    assert isinstance(result, TcpResult)
    return result


def without_arm(cell: ArmCell) -> Session:
    """Return a cell's session of which no arm is told."""
    record = cell.session.model_dump(exclude_none=True, by_alias=True)
    record["cell"]["robot"] = {}
    return Session.model_validate(record)


def held_out(cell: ArmCell, result: TcpResult) -> float:
    """Return by how much an answer predicts other poses wrong, corrected where it applies the arm's errors."""
    poses, model, arm = cell.held_poses, result.arm_model, cell.session.cell.robot.arm
    if model is not None and model.applied and arm is not None and not isinstance(arm, str):
        moves = arm_moves(arm, cell.held_joints_deg.tolist())
        placed = [RigidTransform.of(pose[:3, :3], pose[:3, 3], "base", "tool0") for pose in poses]
        both = zip(placed, moves, strict=True)
        poses = np.array([corrected_by(cell.session.cell, model, pose, own).matrix for pose, own in both])
    return held_out_rms_mm(
        cell, np.array(result.base_from_laser), np.array(result.sphere_center_in_tool0_mm), poses
    )


def by_least_squares(cell: ArmCell) -> float:
    """Return by how much a plain fit of nominal poses predicts other poses wrong, RMS."""
    from scipy.optimize import least_squares

    poses = np.array([one.pose for one in cell.session.captures], dtype=float).reshape(-1, 4, 4)
    seen = np.array([one.center_mm for one in cell.session.captures], dtype=float)

    def placed(ball: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        in_base = poses[:, :3, :3] @ ball + poses[:, :3, 3]
        middle, mean = in_base.mean(axis=0), seen.mean(axis=0)
        u, _, vt = np.linalg.svd((in_base - middle).T @ (seen - mean))
        found = np.eye(4)
        found[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
        found[:3, 3] = middle - found[:3, :3] @ mean
        return found, in_base

    def off(ball: np.ndarray) -> np.ndarray:
        found, in_base = placed(ball)
        return ((in_base - found[:3, 3]) @ found[:3, :3] - seen).ravel()

    ball = least_squares(off, np.array([0.0, 0.0, 90.0]), x_scale=10.0).x
    return held_out_rms_mm(cell, placed(ball)[0], ball, cell.held_poses)


ROUGH = replace(ARM_KINDS["small"], ripple_rad=7e-4, backlash_rad=3e-4, cable_mm=0.15)
"""A small arm of whose errors the model has not the half, as a tracker found one: 0.5 of 0.9 mm stay."""


def rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def beside_a_plain_fit(each: int) -> list[Row]:
    """Return how the answer without joints predicts other poses, beside a plain fit of nominal poses."""
    rows: list[Row] = []
    for captures in (8, 15, 30):
        ours, plain = [], []
        for kind in ("small", "cobot", "medium"):
            for swing in ("usual", "wide"):
                for seed in range(each):
                    step = f"arm plain {kind} {swing} {seed} {captures}"
                    found = kept(
                        step, lambda k=kind, n=seed, c=captures, w=swing: _beside(k, 2000 + n, c, w, None)
                    )
                    ours.append(found[0])
                    plain.append(found[1])
        what = f"arms without joints, {len(ours)}, {captures} captures: held-out RMS, and of plain least squares"
        rows.append(Row(what, "≤", f"{rms(ours):.3f}; {rms(plain):.3f} mm", rms(ours) <= rms(plain)))
    return rows


def _beside(kind: str | ArmKind, seed: int, captures: int, swing: str, errors: str | None) -> tuple[float, float]:
    """Return the error at other poses of the answer, with joints where `errors` says so, and of a plain fit."""
    cell = simulate_arm(kind, seed, captures, swing=swing, errors=errors)
    return held_out(cell, solved(cell.session if errors else without_arm(cell))), by_least_squares(cell)


def of_rough_arms(each: int) -> list[Row]:
    """Return how joints that are told pay on small arms over their whole space, nominally off by about 1 mm."""
    rows: list[Row] = []
    for captures, most in ((8, 1.0), (15, 0.8), (30, 0.65), (60, 0.6)):
        both = [
            kept(
                f"arm rough {seed} {captures}",
                lambda n=seed, c=captures: _beside(ROUGH, 4000 + n, c, "wide", "apply"),
            )
            for seed in range(each)
        ]
        found, plain = rms([one[0] for one in both]), rms([one[1] for one in both])
        what = f"rough small arms, whole space, {each}, {captures} captures, `apply`: held-out RMS; a plain fit's"
        rows.append(Row(what, f"≤ {most} mm", f"{found:.2f}; {plain:.2f} mm", found <= most))
    return rows


WRONG = {
    "order": "joints in the order 1 3 2 4 5 6",
    "sign": "joint 3 counted the other way",
    "offset": "joint 2 counted from -90°",
    "coupling": "joint 3 moving along with joint 2",
    "radians": "joints that are radians",
    "table": "do not give their poses",
}
"""Joints, or the arm, as they are told wrongly, and what is to be named."""


def with_wrong_joints(session: Session, name: str) -> Session:
    """Return a session whose joints are told wrongly."""
    record = session.model_dump(exclude_none=True, by_alias=True)
    if name == "table":
        own = record["cell"]["robot"]["arm"]["joints"]
        record["cell"]["robot"]["arm"]["joints"] = _another(own)
        return Session.model_validate(record)
    for capture in record["captures"]:
        joints = np.array(capture["joints_deg"])
        found = joints.copy()
        match name:
            case "order":
                found[[1, 2]] = joints[[2, 1]]
            case "sign":
                found[2] *= -1
            case "offset":
                found[1] += 90
            case "coupling":
                found[2] -= joints[1]
            case _:
                found = np.deg2rad(joints)
        capture["joints_deg"] = found.tolist()
    return Session.model_validate(record)


def _another(own: list[dict[str, float]]) -> list[dict[str, float]]:
    """Return the table of the arm of another class that follows one's own."""
    kinds = list(ARM_KINDS.values())
    place = next(n for n, kind in enumerate(kinds) if kind.rows[1][0] == own[1]["a_mm"])
    rows = kinds[(place + 1) % len(kinds)].rows
    return [dict(zip(("a_mm", "alpha_deg", "d_mm", "theta_deg"), row, strict=True)) for row in rows]


def _named(kind: str, seed: int) -> list[bool]:
    """Return of each way in which joints are told wrongly whether it is named, and nothing applied."""
    cell, named = simulate_arm(kind, seed, 15, errors="apply", held=0), list[bool]()
    for name, said in WRONG.items():
        result = solved(with_wrong_joints(cell.session, name))
        codes = "joints-read-otherwise", "joints-contradict-poses"
        told = [one.text for one in result.findings if one.code in codes]
        named.append(result.arm_model is None and len(told) == 1 and said in told[0])
    return named


def of_wrong_joints(each: int) -> Row:
    """Return how often wrong joints are named, and nothing is applied."""
    named = [
        told
        for kind in ARM_KINDS
        for seed in range(each)
        for told in kept(f"arm wrong {kind} {seed}", lambda k=kind, n=seed: _named(k, 5000 + n))
    ]
    share = float(np.mean(named))
    what = (
        f"wrong joints (order, sign, 90°, coupling, radians, another arm's), {len(named)}: named, nothing applied"
    )
    return Row(what, "≥ 98 %", f"{sum(named)} of {len(named)}", share >= 0.98)


def _later(kind: str, seed: int, number: int, bump_deg: float) -> dict[str, Any]:
    """Return what later sessions of other poses tell of an arm: as it was, and with one joint's zero moved."""
    bumped = [bump_deg * (n == number - 1) for n in range(6)]
    cells = [simulate_arm(kind, seed, 30, errors="apply", held=0)]
    cells += [simulate_arm(kind, seed, 30, errors="apply", held=0, bumped_deg=by) for by in ([0.0] * 6, bumped)]
    results = [solved(cell.session) for cell in cells]
    first, same, other = (result.to_json() for result in results)
    still, moved = _zeros(first, same), _zeros(first, other)
    alone = [number] == [joint for joint, point in moved.items() if point.flagged]
    quiet = not any(point.flagged for point in still.values())
    told = [result.arm_model.told for result in results[:2] if result.arm_model is not None]
    return {"quiet": quiet, "alone": alone, "change": moved[number].change, "apart": _apart(*told)}


def _zeros(first: dict[str, Any], later: dict[str, Any]) -> dict[int, DriftPoint]:
    sessions = [
        SolvedSession(session=name, name=name, date=name, results={"tcp": result})
        for name, result in (("1", first), ("2", later))
    ]
    return {int(one.title[-1]): one.points[-1] for one in cell_drift(sessions).series if one.figure == "arm-zero"}


def _apart(first: ArmTerms | None, later: ArmTerms | None) -> tuple[float, int]:
    """Return χ² between two sessions of an arm, and of how many directions both tell more than is believed."""
    assert first is not None
    assert later is not None
    values, covariance = np.zeros(len(first.vector)), np.zeros((len(first.vector), len(first.vector)))
    for sign, told in ((1, first), (-1, later)):
        own = np.linalg.inv(np.array(told.information) + 1e-9 * np.eye(len(values)))
        values, covariance = values + sign * own @ np.array(told.vector), covariance + own
    sizes, along = np.linalg.eigh(covariance)
    known = sizes < 1.0
    return float(np.sum((along[:, known].T @ values) ** 2 / sizes[known])), int(known.sum())


def of_later_sessions(each: int, bump_deg: float = 0.15) -> list[Row]:
    """Return how often a later session of other poses names the joint whose zero moved, and none other."""
    found = [
        kept(f"arm later {kind} {seed}", lambda k=kind, n=seed: _later(k, 6000 + n, 2 + n % 4, bump_deg))
        for kind in ARM_KINDS
        for seed in range(each)  # the first joint and the last are the base's and the tool's
    ]
    count = len(found)
    quiet, alone = (sum(one[name] for one in found) for name in ("quiet", "alone"))
    median = float(np.median([one["change"] for one in found]))
    inside = [chi2.ppf(0.025, n) < squared < chi2.ppf(0.975, n) for squared, n in (one["apart"] for one in found)]
    nees = float(np.mean([squared / n for squared, n in (one["apart"] for one in found)]))
    what = f"six classes of arms, {count}, a later session of other poses"
    moved = f"{alone} of {count}; median change {median:.2f}°"
    return [
        Row(f"{what}, nothing moved: no joint named", "≥ 95 %", f"{quiet} of {count}", quiet >= 0.95 * count),
        Row(
            f"the same, one joint's zero moved by {bump_deg}°: named alone", "≥ 90 %", moved, alone >= 0.9 * count
        ),
        Row(
            "the same, nothing moved: NEES of the arm's unknowns between both sessions within its 95 %; mean",
            "≥ 90 %",
            f"{sum(inside)} of {count}; {nees:.2f}",
            sum(inside) >= 0.9 * count,
        ),
    ]


def _since(kind: str, seed: int, step: str, bump_deg: float, errors: str = "apply") -> tuple[int | None, bool]:
    """Return which joint captures since the calibration name, and whether they hold; joint 2 to 5 moved."""
    bumped = [bump_deg * (n == 1 + seed % 4) for n in range(6)]
    session = later_on_an_arm(kind, seed, step, bumped_deg=bumped, errors=errors)
    result = solve_stage(session, step, lambda _name: b"")
    if isinstance(result, RecheckResult):
        return result.rounds[-1].joint, result.holds
    assert isinstance(result, VerifyResult)
    joints = [one.values["joint"] for one in result.findings if one.code == "joint-zero-moved"]
    return (int(joints[0]) if joints else None), result.chance is None or result.chance >= 0.01


def of_captures_since(each: int, bump_deg: float = 0.15) -> list[Row]:
    """Return how often captures since name the joint whose zero moved, and what they say of arms as they were."""
    rows: list[Row] = []
    for step, what in (("recheck", "repeated poses"), ("verify", "poses of a verification")):
        still, moved = (
            [
                kept(f"arm since {kind} {n} {step} {by}", lambda k=kind, n=n, s=step, by=by: _since(k, n, s, by))
                for kind in ARM_KINDS
                for n in range(8000, 8000 + each)
            ]
            for by in (0.0, bump_deg)
        )
        joints = [2 + n % 4 for _ in ARM_KINDS for n in range(8000, 8000 + each)]
        count, named = len(still), sum(one[0] == joint for one, joint in zip(moved, joints, strict=True))
        wrong = sum(one[0] not in (None, joint) for one, joint in zip(moved, joints, strict=True))
        quiet, alarms = sum(one[0] is None for one in still), sum(not one[1] for one in still)
        rows += [
            Row(
                f"six classes of arms, {count}, {what}, one joint's zero moved by {bump_deg}°: named",
                "–",
                f"{named}; another {wrong}",
                wrong <= 0.02 * count,
            ),
            Row(
                f"six classes of arms, {count}, {what}, nothing moved: no joint named; alarms",
                "all; ≤ 2 %",
                f"{quiet} of {count}; {alarms}",
                quiet == count and alarms <= 0.02 * count,
            ),
        ]
    seeds = [(kind, n) for kind in ARM_KINDS for n in range(8000, 8000 + each)]
    covered = [
        kept(f"arm covered {k} {n}", lambda k=k, n=n: _since(k, n, "verify", 0.0, "cover")) for k, n in seeds
    ]
    alarms, what = (
        sum(not one[1] for one in covered),
        f"the same, {len(covered)}, the arm's errors covered: alarms",
    )
    return [*rows, Row(what, "≤ 2 %", f"{alarms}", alarms <= 0.02 * len(covered))]


def _before_a_tracker(kind: str | ArmKind, seed: int, captures: int, errors: str | None, mm: float) -> bool:
    """Return whether a verification at 30 other poses warns of the answer, the tracker moved by so much since."""
    swing = "wide" if isinstance(kind, ArmKind) else "usual"
    session = later_before_a_tracker(kind, seed, captures, swing=swing, errors=errors, mm=mm)
    said = {one.code for one in solve_stage(session, "verify", lambda _name: b"").findings}
    return bool(said & {"verify-scatter-large", "verify-scatter-fails", "verify-tool-moved"})


def of_trackers(each: int, moved_mm: float = 0.6) -> list[Row]:
    """Return how often a verification warns of a tracker that stood still, and of one that was moved."""
    kinds: dict[str, str | ArmKind] = {**{name: name for name in ARM_KINDS}, "rough": ROUGH}
    told: dict[tuple[str | None, float], list[bool]] = {}
    for seed in range(99000, 99000 + each):
        for name, kind in kinds.items():
            for captures in (15, 30):
                for errors, mm in ((None, 0.0), ("apply", 0.0), (None, moved_mm), ("apply", moved_mm)):
                    step = f"arm tracker {name} {seed} {captures} {errors} {mm}"
                    own = told.setdefault((errors, mm), [])
                    own.append(
                        kept(
                            step,
                            lambda k=kind, n=seed, c=captures, e=errors, mm=mm: _before_a_tracker(k, n, c, e, mm),
                        )
                    )
    still = [*told[None, 0.0], *told["apply", 0.0]]
    moved = told[None, moved_mm], told["apply", moved_mm]
    what = f"arms before a tracker, {len(still)} verified at 30 other poses, nothing moved: alarms"
    ours = f"{sum(moved[1])} of {len(moved[1])}; {sum(moved[0])} of {len(moved[0])}"
    return [
        Row(what, "≤ 2 %", f"{sum(still)}", sum(still) <= 0.02 * len(still)),
        Row(f"the same, the tracker moved by {moved_mm} mm: told, the arm corrected; not", "–", ours),
    ]


def _classes(kind: str | ArmKind, seed: int, captures: int) -> tuple[float, bool]:
    """Return the error at other poses over that without the arm's errors, and whether it was told worth it."""
    cell = simulate_arm(kind, seed, captures, errors="apply")
    result = solved(cell.session)
    assert result.arm_model is not None
    return held_out(cell, result) / held_out(cell, solved(without_arm(cell))), result.arm_model.worth_it


def of_six_classes(each: int) -> list[Row]:
    """Return what the arm's errors bring at other poses, and whether that is told rightly."""
    rows: list[Row] = []
    for captures in (8, 15, 30):
        found = [
            kept(
                f"arm classes {kind} {seed} {captures}",
                lambda k=kind, n=seed, c=captures: _classes(k, 1000 + n, c),
            )
            for kind in ARM_KINDS
            for seed in range(each)
        ]
        ratios, count = [one[0] for one in found], len(found)
        right, median = sum(worth == (ratio < 1.0) for ratio, worth in found), float(np.median(ratios))
        what = f"arms of six classes, {each} each, {captures} captures, `apply`: held-out error / without"
        measured = f"median {median:.2f}, worst {max(ratios):.2f}; {sum(one <= 0.7 for one in ratios)} of {count}"
        rows += [
            Row(what, "≤ 0.7; never > 1.05", measured, median <= 0.7 and max(ratios) <= 1.05),
            Row(
                f"the same: `worth_it` right, {captures} captures",
                "≥ 95 %",
                f"{right} of {count}",
                right >= 0.95 * count,
            ),
        ]
    return rows


def of_errors_that_are_not_modelled(each: int) -> Row:
    """Return what 8 captures do to right links whose gears, warm-up and cable err four times as usual."""
    found: list[tuple[float, bool]] = []
    for name, kind in ARM_KINDS.items():
        odd = replace(
            kind, offset_rad=0.0, link_mm=0.0, axis_rad=0.0, sag_rad=0.0, coupling=0.0,
            ripple_rad=4 * kind.ripple_rad, backlash_rad=4 * kind.backlash_rad, warm_mm=4 * kind.warm_mm,
            cable_mm=3 * kind.cable_mm,
        )  # fmt: skip
        found += [kept(f"arm odd {name} {n}", lambda k=odd, n=n: _classes(k, 31000 + n, 8)) for n in range(each)]
    ratios = [one[0] for one in found]
    what = f"right links, gears, warm-up, cable 4 ×, {len(found)}, 8 captures: held-out error / without"
    worse = sum(one > 1.05 for one in ratios)
    return Row(what, "never > 1.05", f"{worse} worse, worst {max(ratios):.2f}", worse == 0)


def _right(kind: str, seed: int) -> tuple[bool, list[str]]:
    """Return whether a right arm's answer is as without, and which warnings there are more."""
    cell = simulate_arm(kind, seed, 20, size=0.0, errors="apply", held=0)
    result, plain = solved(cell.session), solved(without_arm(cell))
    more = {one.code for one in result.findings if one.severity != "note"} - {one.code for one in plain.findings}
    return result.base_from_laser == plain.base_from_laser, sorted(more)


def of_right_arms(each: int) -> Row:
    """Return how often a right arm's answer stays as it is, and no finding is false."""
    found = [
        kept(f"arm right {kind} {seed}", lambda k=kind, n=seed: _right(k, 3000 + n))
        for kind in ARM_KINDS
        for seed in range(each)
    ]
    same = sum(as_without and not more for as_without, more in found)
    what = f"right arms, {len(found)}: nothing applied, the answer as without, no warning more"
    return Row(what, "≥ 98 %", f"{same} of {len(found)}", same >= 0.98 * len(found))


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes 100 arms a class, or as many as SCANCELL_BENCH_ARMS says."""
    each = int(os.environ.get("SCANCELL_BENCH_ARMS", 100 if full else 4))
    some = min(each, 17)  # a hundred in all
    rows = [
        *beside_a_plain_fit(min(each, 4)),
        *of_rough_arms(min(each, 30)),
        of_wrong_joints(some),
        *of_later_sessions(min(each, 4)),
        *of_captures_since(some),
        *of_trackers(min(each, 8)),
        *of_six_classes(each),
        of_errors_that_are_not_modelled(some),
        of_right_arms(some),
    ]
    for captures in (30, 500):
        factor = _slower(captures)
        what = f"TCP with the arm's unknowns, {captures} captures: time"
        rows.append(Row(what, "≤ 2 ×", f"{factor:.1f} ×", factor <= 2))
    return rows


def _slower(captures: int) -> float:
    """Return the processor's time with the arm's unknowns applied over that without them, the least of three."""
    cell = simulate_arm("small", 5, captures, errors="apply", held=0)
    times: list[list[float]] = []
    for _ in range(3):
        times.append([])
        for session in (without_arm(cell), cell.session):
            began = time.process_time()
            solved(session)
            times[-1].append(time.process_time() - began)
    least = np.min(times, axis=0)
    return float(least[1] / least[0])
