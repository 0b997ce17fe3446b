"""Tool and turntable from all captures of the simulated cell: against the bound, the truth and the paper's way."""

from dataclasses import dataclass

import numpy as np
from harness import Row, interleaved_medians_s

from calib_core.frames import FloatArray, RigidTransform
from calib_core.simulation import SimulatedSession, simulate
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from tests.chain_bound import chain_bound

MOST = 1.1
_FREE = [0, 1, 3, 4, 5]  # T's rotation about its own z follows from the tilts


@dataclass(frozen=True, eq=False)
class Run:
    """One seed: errors of the chain and of the paper's axis, the bounds, and the normalised squared errors."""

    axis_rad: float
    paper_axis_rad: float
    axis_bound: FloatArray
    tool: FloatArray
    tool_bound: FloatArray
    tool_nees: float
    table_nees: float


def angle_rad(direction: object, truth: object) -> float:
    return float(np.linalg.norm(np.cross(np.asarray(direction, dtype=float), np.asarray(truth, dtype=float))))


def solve(simulated: SimulatedSession) -> ChainResult:
    result = solve_stage(simulated.session, "chain", simulated.files.__getitem__)
    assert isinstance(result, ChainResult)
    return result


def one(seed: int) -> Run:
    simulated = simulate("turntable", seed)
    truth, bound, result = simulated.truth, chain_bound(simulated), solve(simulated)
    tool = RigidTransform.from_rounded(result.tool0_from_laser, "tool0", "laser").difference(
        RigidTransform.from_rounded(truth["tool0_from_laser"], "tool0", "laser")
    )
    table = RigidTransform.from_rounded(result.base_from_turntable, "base", "turntable").difference(
        RigidTransform.from_rounded(truth["base_from_turntable"], "base", "turntable")
    )[_FREE]
    covariance = np.array(result.turntable_covariance)[np.ix_(_FREE, _FREE)]
    true_axis = truth["axis_direction_in_base"]
    return Run(
        axis_rad=angle_rad(result.axis_direction_in_base, true_axis),
        paper_axis_rad=angle_rad(result.circles_axis_direction_in_base, true_axis),
        axis_bound=bound.axis_direction,
        tool=tool,
        tool_bound=bound.tool,
        tool_nees=float(tool @ np.linalg.solve(np.array(result.covariance), tool)),
        table_nees=float(table @ np.linalg.solve(covariance, table)),
    )


def rms(values: object) -> float:
    return float(np.sqrt(np.mean(np.square(np.asarray(values, dtype=float)))))


def spread(bounds: FloatArray) -> float:
    """Return the standard deviation of an RMS error / bound, over seeds whose errors have covariances (N, d, d).

    The squared length of an error has the mean tr C and the variance 2 tr C²; that of the root is half as large.
    """
    traces = np.trace(bounds, axis1=1, axis2=2)
    return float(np.sqrt(2 * np.sum(bounds**2)) / np.sum(traces) / 2)


def ratio_row(what: str, error: float, bounds: FloatArray, unit: str, full: bool) -> Row:
    """Compare an RMS error with its bound; with fewer seeds than the target's, their known spread is allowed."""
    bound, sigma = float(np.sqrt(np.mean(np.trace(bounds, axis1=1, axis2=2)))), spread(bounds)
    most = MOST if full else MOST + 2 * sigma
    target = f"≤ {MOST:g} × bound" if full else f"≤ {MOST:g} + 2 σ of {len(bounds)} seeds = {most:.2f} × bound"
    measured = f"{error / bound:.3f} × ({error:.4f} of {bound:.4f} {unit})"
    return Row(f"{what}, {len(bounds)} seeds", target, measured, error <= most * bound)


def nees_row(what: str, values: list[float], freedom: int) -> Row:
    half = 1.96 * np.sqrt(2 * freedom / len(values))
    mean = float(np.mean(values))
    target = f"{freedom - half:.2f} to {freedom + half:.2f}"
    return Row(what, target, f"{mean:.2f}", abs(mean - freedom) <= half)


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 100 seeds of the target."""
    seeds = 100 if full else 30
    runs = [one(seed) for seed in range(seeds)]
    axis, papers = rms([r.axis_rad for r in runs]), rms([r.paper_axis_rad for r in runs])
    turn, shift = rms([np.linalg.norm(r.tool[:3]) for r in runs]), rms([np.linalg.norm(r.tool[3:]) for r in runs])
    axis_bounds = np.array([r.axis_bound for r in runs]) * np.rad2deg(1) ** 2
    tool_bounds = np.array([r.tool_bound for r in runs])
    turn_bounds = tool_bounds[:, :3, :3] * np.rad2deg(1) ** 2
    rows = [
        ratio_row("axis direction", np.rad2deg(axis), axis_bounds, "°", full),
        ratio_row("TCP rotation", np.rad2deg(turn), turn_bounds, "°", full),
        ratio_row("TCP translation", shift, tool_bounds[:, 3:, 3:], "mm", full),
        nees_row("mean NEES of the TCP, 6 parameters", [r.tool_nees for r in runs], 6),
        nees_row("mean NEES of the table, 5 parameters", [r.table_nees for r in runs], 5),
        Row(
            "axis against the paper's way, same captures",
            "≥ 2.2 × better",
            f"{papers / axis:.2f} × ({np.rad2deg(papers):.4f}°)",
            papers >= 2.2 * axis,
        ),
    ]
    simulated = simulate("turntable", 0)
    duration = interleaved_medians_s({"chain": lambda: solve(simulated)}, rounds=5)["chain"]
    rows.append(Row("30 profiles: fits, tcp, turntable and chain", "", f"{1e3 * duration:.0f} ms"))
    return rows
