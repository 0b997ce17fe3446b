"""Arms of six classes before a tracker: what their own errors, solved with the tool, bring at other poses."""

import time

import numpy as np
from harness import Row

from calib_core.arms.errors import arm_moves
from calib_core.captures.arm_joints import corrected_by
from calib_core.frames import RigidTransform
from calib_core.records import Session
from calib_core.simulation.arm_cell import ARM_KINDS, ArmCell, held_out_rms_mm, simulate_arm
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult


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


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 100 arms a class of the target."""
    each = 100 if full else 4
    rows: list[Row] = []
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
