"""Arms of six classes before a tracker: what their own errors, solved with the tool, bring at other poses."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from harness import Row

from calib_core.arms.errors import arm_moves
from calib_core.captures.arm_joints import corrected_by
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.review.between_sessions import SolvedSession
from calib_core.review.drift import cell_drift
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.advised_arm import advised_arm, elsewhere_rms_mm, planned
from tests.arm_cell import ARM_KINDS, ArmCell, held_out_rms_mm, simulate_arm


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
                    cell = simulate_arm(kind, 2000 + seed, captures, swing=swing)
                    ours.append(held_out(cell, solved(without_arm(cell))))
                    plain.append(by_least_squares(cell))
        what = f"arms without joints, {len(ours)}, {captures} captures: held-out RMS, and of plain least squares"
        rows.append(Row(what, "≤", f"{rms(ours):.3f}; {rms(plain):.3f} mm", rms(ours) <= rms(plain)))
    return rows


def of_rough_arms(each: int) -> list[Row]:
    """Return how joints that are told pay on small arms over their whole space, nominally off by about 1 mm."""
    rows: list[Row] = []
    for captures, most in ((8, 1.0), (15, 0.8), (30, 0.65), (60, 0.6)):
        cells = [
            simulate_arm("small", 4000 + seed, captures, swing="wide", errors="apply") for seed in range(each)
        ]
        found = rms([held_out(cell, solved(cell.session)) for cell in cells])
        plain = rms([by_least_squares(cell) for cell in cells])
        what = (
            f"small arms over their whole space, {each}, {captures} captures, `apply`: held-out RMS; a plain fit's"
        )
        rows.append(Row(what, f"≤ {most} mm", f"{found:.2f}; {plain:.2f} mm", found <= most))
    return rows


WRONG = {
    "order": "joints in the order 1 3 2 4 5 6",
    "sign": "joint 3 counted the other way",
    "offset": "joint 2 counted from -90°",
    "coupling": "joint 3 moving along with joint 2",
    "radians": "joints that are radians",
}
"""Joints as they are told wrongly, and what is to be named."""


def with_wrong_joints(session: Session, name: str) -> Session:
    """Return a session whose joints are told wrongly."""
    record = session.model_dump(exclude_none=True, by_alias=True)
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


def of_wrong_joints(each: int) -> Row:
    """Return how often wrong joints are named, and nothing is applied."""
    named: list[bool] = []
    for kind in ARM_KINDS:
        for seed in range(each):
            cell = simulate_arm(kind, 5000 + seed, 15, errors="apply", held=0)
            for name, said in WRONG.items():
                result = solved(with_wrong_joints(cell.session, name))
                told = [one.text for one in result.findings if one.code == "joints-read-otherwise"]
                named.append(result.arm_model is None and len(told) == 1 and said in told[0])
    share = float(np.mean(named))
    what = f"wrong joints (order, sign, 90°, coupling, radians), {len(named)}: named, nothing applied"
    return Row(what, "≥ 98 %", f"{100 * share:.0f} %", share >= 0.98)


def of_bumped_joints(each: int, bump_deg: float = 0.15) -> list[Row]:
    """Return how often a later session of other poses names the joint whose zero moved, and none other."""
    named: list[bool] = []
    still: list[bool] = []
    off: list[float] = []
    for kind in ARM_KINDS:
        for seed in range(each):
            number = 2 + seed % 4  # the first and the last are the base's and the tool's
            bumped = [bump_deg * (n == number - 1) for n in range(6)]
            cells = [simulate_arm(kind, 6000 + seed, 30, errors="apply", held=0)]
            cells += [
                simulate_arm(kind, 6000 + seed, 30, errors="apply", held=0, bumped_deg=by)
                for by in ([0.0] * 6, bumped)
            ]
            first, same, other = (solved(cell.session).to_json() for cell in cells)
            for later, as_it_should, beside in ((same, still, []), (other, named, [number])):
                sessions = [
                    SolvedSession(session=name, name=name, date=name, results={"tcp": result})
                    for name, result in (("1", first), ("2", later))
                ]
                series = [one for one in cell_drift(sessions).series if one.figure == "arm-zero"]
                flagged = [int(one.title[-1]) for one in series if one.points[-1].flagged]
                as_it_should.append(flagged == beside)
                off += [one.points[-1].change for one in series if int(one.title[-1]) in beside]
    what = f"six classes of arms, {len(named)}, a later session of other poses"
    share, quiet = 100 * float(np.mean(named)), 100 * float(np.mean(still))
    median = f"{share:.0f} %; median change {np.median(off):.2f}°"
    return [
        Row(f"the same, one joint's zero moved by {bump_deg}°: named alone", "≥ 90 %", median, share >= 90),
        Row(f"{what}, nothing moved: no joint named", "≥ 95 %", f"{quiet:.0f} %", quiet >= 95),
    ]


def of_planned_poses(each: int) -> Row:
    """Return what poses that are chosen by what they tell of the arm bring beside as many that are not."""
    ratios = [
        elsewhere_rms_mm(cell, solved(planned(cell, 15, by_arm=True)))
        / elsewhere_rms_mm(cell, solved(planned(cell, 15, by_arm=False)))
        for cell in (advised_arm(kind, seed) for seed in range(each) for kind in ARM_KINDS)
    ]
    mean, better = float(np.exp(np.mean(np.log(ratios)))), sum(one < 1.0 for one in ratios)
    what = f"six classes, {len(ratios)}, 15 planned poses: error elsewhere, chosen by the arm's errors / without"
    return Row(what, "≤ 0.9", f"{mean:.2f}; better in {better}", mean <= 0.9)


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 100 arms a class of the target."""
    each = 100 if full else 4
    rows = [
        *beside_a_plain_fit(each),
        *of_rough_arms(each),
        of_wrong_joints(max(each // 4, 1)),
        *of_bumped_joints(each),
        of_planned_poses(min(each, 6)),
    ]
    for captures in (15, 30):
        ratios: list[float] = []
        right: list[bool] = []
        for kind in ARM_KINDS:
            for seed in range(each):
                cell = simulate_arm(kind, 1000 + seed, captures, errors="apply")
                result = solved(cell.session)
                ratios.append(held_out(cell, result) / held_out(cell, solved(without_arm(cell))))
                assert result.arm_model is not None
                right.append(result.arm_model.worth_it == (ratios[-1] < 1.0))
        median, worst, share = float(np.median(ratios)), max(ratios), float(np.mean(right))
        rows += [
            Row(
                f"arms of six classes, {each} each, {captures} captures, `apply`: held-out error / without",
                "≤ 0.7; never > 1.05",
                f"median {median:.2f}, worst {worst:.2f}",
                median <= 0.7 and worst <= 1.05,
            ),
            Row(
                f"the same: `worth_it` right, {captures} captures", "≥ 95 %", f"{100 * share:.0f} %", share >= 0.95
            ),
        ]
    kept = [_right_arm(kind, seed) for kind in ARM_KINDS for seed in range(each)]
    same = float(np.mean(kept))
    rows.append(
        Row(
            f"right arms, {len(kept)}: nothing applied, the answer as without",
            "≥ 98 %",
            f"{100 * same:.0f} %",
            same >= 0.98,
        )
    )
    for captures in (30, 500):
        factor = _slower(captures)
        rows.append(
            Row(f"TCP with the arm's unknowns, {captures} captures: time", "≤ 2 ×", f"{factor:.1f} ×", factor <= 2)
        )
    return rows


def _right_arm(kind: str, seed: int) -> bool:
    cell = simulate_arm(kind, 3000 + seed, 20, size=0.0, errors="apply", held=0)
    return solved(cell.session).base_from_laser == solved(without_arm(cell)).base_from_laser


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
