"""Drift over 30 sessions of a cell: a step of five sigmas of the difference found at once, and false alarms."""

import numpy as np
from cells import GIVEN, Cell
from harness import Row

from calib_core.frames import FloatArray, RigidTransform, skew
from calib_core.review.drift import Measured, SolvedSession, charted

_SESSIONS, _STEP_AT = 30, 20
_POINT = np.array([0.0, 0.0, 190.0])


def run(full: bool) -> list[Row]:
    """Return the figures: 4 cells of 30 solved sessions in full, 1 of 8 otherwise; and series drawn from those."""
    kinds = [_session(k).covariance for k in range(6)]
    return [*solved(range(4 if full else 1), _SESSIONS if full else 8), *drawn(1000 if full else 200, kinds)]


def solved(cells: range, sessions: int) -> list[Row]:
    """Return the figures of sessions that are simulated and solved, each with captures of its own."""
    alarms, found = 0, 0
    for number in cells:
        series = [_session(1000 * number + k) for k in range(sessions)]
        alarms += any(row[3] for row in charted(series))
        found += _is_found(series, 2 * sessions // 3, np.random.default_rng([number, 61]))
    return _rows(f"{len(cells)} cells, {sessions} solved sessions", alarms, found, len(cells))


def drawn(count: int, kinds: list[FloatArray]) -> list[Row]:
    """Return the figures of series whose errors are drawn from the covariances of solved sessions."""
    alarms, found = 0, 0
    for number in range(count):
        rng = np.random.default_rng([number, 62])
        picked = [kinds[rng.integers(len(kinds))] for _ in range(_SESSIONS)]
        series = [_measured(rng.multivariate_normal(np.zeros(3), c), c) for c in picked]
        alarms += any(row[3] for row in charted(series))
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
    step = 5 * charted(series)[at][1] / 2 * direction / np.linalg.norm(direction)
    stepped = [
        Measured(one.session, one.value + (step if k >= at else 0.0), one.covariance)
        for k, one in enumerate(series[: at + 1])
    ]
    return charted(stepped)[at][3]


def _session(seed: int) -> Measured:
    """Return where the scanner's point lies on the flange by one session, against the truth."""
    cell = Cell.of("tcp", seed)
    solution = cell.solve(GIVEN)
    tool: RigidTransform = solution.joint.tool0_from_laser
    follows = np.hstack([-tool.rotation @ skew(_POINT), np.eye(3)])
    covariance = follows @ solution.covariance[:6, :6] @ follows.T
    return _measured(tool.apply(_POINT) - cell.truth.apply(_POINT), covariance)


def _measured(value: FloatArray, covariance: FloatArray) -> Measured:
    return Measured(SolvedSession("s", "", "", {}), value, covariance)
