"""Drift: a step over 30 sessions of a cell, five sigmas of the difference; within one, a scanner that settles."""

from dataclasses import replace

import numpy as np
from cells import GIVEN, Cell
from harness import Row

from calib_core.chain.tcp_solution import TcpSolution
from calib_core.chain.warm_up import WarmUp
from calib_core.errors import CalibrationError
from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.review.between_sessions import Measured, SolvedSession
from calib_core.review.common_errors import common_of
from calib_core.review.drift import charted
from calib_core.simulation.motion import pose
from calib_core.stages.pipeline import stage_input
from calib_core.stages.tcp.result import scanner_found
from calib_core.stages.tcp.solve import solve_tcp_captures
from tests.trouble import Trouble, all_troubles, troubled
from tests.trouble.cell import Plan

_DRIFT_MM = 0.5
_SESSIONS, _STEP_AT = 30, 20
_POINT = np.array([0.0, 0.0, 190.0])


def run(full: bool) -> list[Row]:
    """Return the figures: 4 cells of 30 solved sessions in full, 1 of 8 otherwise; and series drawn from those."""
    kinds = [session_point(k).covariance for k in range(6)]
    return [
        *solved(range(4 if full else 1), _SESSIONS if full else 8),
        *drawn(1000 if full else 200, kinds),
        *within(range(20 if full else 2)),
    ]


def within(seeds: range) -> list[Row]:
    """Return the figures of drift within a session: found, its stated error, false alarms on other troubles."""
    found, errors = 0, []
    for seed in seeds:
        told = warm_up(warming(_DRIFT_MM, seed), seed)
        assert told is not None
        found += told.found
        errors.append((told.drift_mm - _DRIFT_MM) / (told.uncertainty_mm / 2))
    others = [trouble for trouble in all_troubles().values() if not trouble.name.startswith("drifts")]
    alarms, count = 0, 0
    for seed in range(max(len(seeds) // 5, 1)):
        for trouble in others:
            try:
                told = warm_up(trouble, seed)
            except CalibrationError:
                continue  # what cannot be solved has no drift
            alarms += told is not None and told.found
            count += 1
    middle = float(np.sqrt(np.mean(np.square(errors))))
    return [
        Row(f"{len(seeds)} sessions whose scanner settles by {_DRIFT_MM:g} mm: found", "≥ 95 %",
            f"{found / len(seeds):.1%}", found >= 0.95 * len(seeds)),
        Row("error of its size, in its own sigmas, RMS", "≤ 1.3", f"{middle:.2f}", middle <= 1.3),
        Row(f"{count} sessions with any other trouble, or none: said to drift", "≤ 1 %", f"{alarms / count:.1%}",
            alarms <= 0.01 * count),
    ]  # fmt: skip


def warming(drift_mm: float, seed: int) -> Trouble:
    """Return a scanner that shifts on the flange in a random direction and settles within the session."""

    def change(plan: Plan, rng: np.random.Generator) -> None:
        way = rng.standard_normal(3)
        way *= drift_mm / np.linalg.norm(way)
        last = plan.shifts + plan.tilts - 1
        plan.mounting = lambda k: pose(np.eye(3), way * np.exp(-5 * k / last))

    return Trouble(f"settles, {seed}", change)


def warm_up(trouble: Trouble, seed: int) -> WarmUp | None:
    """Return what the tcp's solution says of drift within a troubled session."""
    cell = troubled(trouble, seed, told=bool(seed % 2))
    solution = solve_tcp_captures(stage_input(cell.session, "tcp", cell.files.__getitem__)).solution
    return solution.beside.warm_up


def solved(cells: range, sessions: int) -> list[Row]:
    """Return the figures of sessions that are simulated and solved, each with captures of its own."""
    alarms, found = 0, 0
    for number in cells:
        series = [session_point(1000 * number + k) for k in range(sessions)]
        alarms += any(row.flagged for row in charted(series))
        found += _is_found(series, 2 * sessions // 3, np.random.default_rng([number, 61]))
    return _rows(f"{len(cells)} cells, {sessions} solved sessions", alarms, found, len(cells))


def drawn(count: int, kinds: list[FloatArray]) -> list[Row]:
    """Return the figures of series whose errors are drawn from the covariances of solved sessions."""
    alarms, found = 0, 0
    for number in range(count):
        rng = np.random.default_rng([number, 62])
        picked = [kinds[rng.integers(len(kinds))] for _ in range(_SESSIONS)]
        series = [measured(rng.multivariate_normal(np.zeros(3), c), c) for c in picked]
        alarms += any(row.flagged for row in charted(series))
        found += _is_found(series, _STEP_AT, rng)
    return _rows(f"{count} series of {_SESSIONS} sessions", alarms, found, count)


def _rows(what: str, alarms: int, found: int, count: int) -> list[Row]:
    return [
        Row(f"{what}, a step of 5 σ of the difference: found at the next", "≥ 95 %", f"{found / count:.1%}",
            found >= 0.95 * count),
        Row(f"{what}, nothing changed: series with an alarm", "≤ 2 %", f"{alarms / count:.1%}",
            alarms <= 0.02 * count),
    ]  # fmt: skip


def _is_found(series: list[Measured], at: int, rng: np.random.Generator) -> bool:
    """Return whether a step at a session is flagged there; its length is of the stated ± of that difference."""
    direction = rng.normal(size=3)
    step = 5 * charted(series)[at].uncertainty / 2 * direction / np.linalg.norm(direction)
    return charted([*series[:at], moved(series[at], step)])[at].flagged


def moved(one: Measured, shift: FloatArray) -> Measured:
    """Return a session's figure shifted by so much."""
    common = one.common
    return replace(
        one,
        value=one.value + shift,
        common=None if common is None else replace(common, value=common.value + shift),
    )


def session_point(seed: int) -> Measured:
    """Return where the scanner's point lies on the flange by one session, against the truth."""
    cell = Cell.of("tcp", seed)
    return point_of(cell, cell.solve(GIVEN))


def point_of(cell: Cell, solution: TcpSolution) -> Measured:
    """Return where a solution of a cell puts the scanner's point on the flange, against the truth."""
    return off_by(cell.truth, solution)


def off_by(truth: RigidTransform, solution: TcpSolution) -> Measured:
    """Return by how much a solution puts the scanner's point on the flange off the truth, as drift has it."""
    tool: RigidTransform = solution.joint.mount_from_laser
    rows = np.hstack([-tool.rotation @ skew(_POINT), np.eye(3)])
    value, covariance = tool.apply(_POINT) - truth.apply(_POINT), solution.covariance[:6, :6]
    common = common_of({"scanner": scanner_found(solution).to_json()}, covariance, ())
    told = measured(value, rows @ covariance @ rows.T)
    return told if common is None else replace(told, common=common.along(value, rows))


def measured(value: FloatArray, covariance: FloatArray, program: FloatArray | None = None) -> Measured:
    return Measured(SolvedSession("s", "", "", {}, program=program), value, covariance)
