"""Histories of 60 sessions of a cell: creep, steps, nothing at all; errors drawn from solved covariances."""

import numpy as np
from bench_drift import measured, session_point
from harness import Row

from calib_core.frames import FloatArray
from calib_core.review.drift import charted
from calib_core.review.drift_trend import Measured, trend_of

_LONG, _STEP_AT, _FOUND_BEFORE_MM = 60, 20, 0.3


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the 200 histories of the target."""
    kinds = [session_point(seed).covariance for seed in range(6)]
    count = 200 if full else 40
    return [
        *histories(count, kinds, "the paper's arm"),
        *best_possible(count, kinds, "the paper's arm"),
        *histories(count, [one / 9 for one in kinds], "an arm three times as good"),
    ]


def histories(count: int, kinds: list[FloatArray], arm: str) -> list[Row]:
    """Return what is told of long histories: cells that creep, that make a step, and that stay as they are."""
    quiet = [_history(kinds, [number, 63]) for number in range(count)]
    steps = sum(any(row.flagged for row in charted(history)) for history in quiet)
    trends = sum(_trend_begins(history) is not None for history in quiet)
    rows = [
        Row(f"{arm}, {count} quiet histories of {_LONG}: false steps", "≤ 2.5 %", f"{steps / count:.1%}",
            steps <= 0.025 * count + 1),
        Row(f"{arm}, the same: false trends", "≤ 20 %", f"{trends / count:.1%}", trends <= 0.2 * count),
    ]  # fmt: skip
    for creep_mm in (0.01, 0.03):
        begins = [_trend_begins(_history(kinds, [number, 64], creep_mm)) for number in range(count)]
        found = sum(at is not None and at * creep_mm < _FOUND_BEFORE_MM for at in begins)
        what = f"{arm}, creeping {creep_mm:g} mm a session: found before {_FOUND_BEFORE_MM:g} mm"
        rows.append(Row(what, "≥ 90 %", f"{found / count:.1%}", found >= 0.9 * count))
    for step_mm in (0.3, 1.0):
        found = sum(_finds_step(history, step_mm, number) for number, history in enumerate(quiet))
        what = f"{arm}, a step of {step_mm:g} mm: found at once"
        rows.append(Row(what, "≥ 95 %", f"{found / count:.1%}", found >= 0.95 * count))
    return rows


def best_possible(count: int, kinds: list[FloatArray], arm: str) -> list[Row]:
    """Return what a test finds that knows the direction, at the same false alarms: none finds more."""
    ways = [np.random.default_rng([number, 66]).normal(size=3) for number in range(count)]
    ways = [way / np.linalg.norm(way) for way in ways]
    quiet = [_along(_history(kinds, [number, 67]), way) for number, way in enumerate(ways)]
    creeping, stepping = [], []
    for number, way in enumerate(ways):
        history = _history(kinds, [number, 68])
        creep = [measured(one.value + 0.03 * k * way, one.covariance) for k, one in enumerate(history)]
        creeping.append(_along(creep, way))
        last = history[_STEP_AT]
        moved = measured(last.value + 0.3 * way, last.covariance)
        stepping.append(_along([*history[:_STEP_AT], moved], way))
    slope = np.quantile([max(_slopes(*one)) for one in quiet], 0.8)
    step = np.quantile([max(_steps(*one)) for one in quiet], 0.975)
    begins = [next((k for k, z in enumerate(_slopes(*one), 2) if z > slope), _LONG) for one in creeping]
    early = sum(0.03 * at < _FOUND_BEFORE_MM for at in begins) / count
    at_once = sum(_steps(*one)[-1] > step for one in stepping) / count
    what = f"{arm}, a test that knows the direction, same false alarms"
    return [
        Row(f"{what}: creep of 0.03 mm found before {_FOUND_BEFORE_MM:g} mm", "", f"{early:.1%}", None),
        Row(f"{what}: step of 0.3 mm found at once", "", f"{at_once:.1%}", None),
    ]


def _along(history: list[Measured], way: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return each session's best estimate along a direction, and its weight."""
    known = [np.linalg.inv(one.covariance) @ way for one in history]
    weights = np.array([way @ one for one in known])
    return np.array([one @ m.value for one, m in zip(known, history, strict=True)]) / weights, weights


def _slopes(values: FloatArray, weights: FloatArray) -> list[float]:
    found: list[float] = []
    for count in range(3, len(values) + 1):
        place, w = np.arange(count), weights[:count]
        from_mean = place - (w @ place) / w.sum()
        found.append(float((w * from_mean) @ values[:count] / np.sqrt(w @ from_mean**2)))
    return found


def _steps(values: FloatArray, weights: FloatArray) -> list[float]:
    sums, weighed = np.cumsum(weights), np.cumsum(weights * values)
    before = weighed[:-1] / sums[:-1]
    return ((values[1:] - before) / np.sqrt(1 / weights[1:] + 1 / sums[:-1])).tolist()


def _history(kinds: list[FloatArray], seed: list[int], creep_mm: float = 0.0) -> list[Measured]:
    rng = np.random.default_rng(seed)
    way = rng.normal(size=3)
    way *= creep_mm / np.linalg.norm(way)
    picked = [kinds[rng.integers(len(kinds))] for _ in range(_LONG)]
    return [measured(rng.multivariate_normal(k * way, c), c) for k, c in enumerate(picked)]


def _trend_begins(history: list[Measured]) -> int | None:
    """Return the session with which a trend is told for the first time."""
    for at in range(len(history)):
        trend = trend_of(history[: at + 1])
        if trend is not None and trend.found:
            return at
    return None


def _finds_step(history: list[Measured], step_mm: float, seed: int) -> bool:
    way = np.random.default_rng([seed, 65]).normal(size=3)
    last = history[_STEP_AT]
    moved = measured(last.value + step_mm * way / np.linalg.norm(way), last.covariance)
    return charted([*history[:_STEP_AT], moved])[-1].flagged
