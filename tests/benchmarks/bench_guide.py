"""What the guide promises before a solve beside what the result of the same captures then states.

Simulated cells with scanners and arms of every kind, cut off after so many captures; real sets where they lie
beside the project.  Both are ± at the workpiece in its worst direction.  Of sessions with wrong poses (another
order, two robots' poses, swaps, other readings) the guide may promise nothing.
"""

import json
from collections.abc import Iterator, Sequence

import numpy as np
from bench_halves import DATA, SETS
from bench_order import KINDS as ORDERS
from bench_order import ordered, wrong_order
from harness import Row
from wrong_poses import reordered, rewritten, shifted, swapped, wrong_readings

from calib_core.captures.measure import measure_capture
from calib_core.errors import CalibrationError
from calib_core.evidence.numbers import COVERAGE
from calib_core.frames import FloatArray
from calib_core.guidance.advice import advice_in
from calib_core.guidance.design import worst_sigma
from calib_core.guidance.prior import situation_of
from calib_core.records import Measured, ReadFile, Session, parse_session
from calib_core.simulation import TcpScenario, simulate_tcp
from calib_core.stages.guide import guide
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import all_troubles, troubled

KINDS = (
    "arms: clean",
    "arms: repeats to 0.01 mm",
    "arms: repeats to 0.2 mm, 0.05°",
    "arms: joints 0.02°, links 0.1 mm",
    "arms: joints 0.1°, links 0.5 mm",
    "arms: one pose in ten off by 5 sigmas",
    "scanner: points alike over 5 mm",
)
COUNTS = (7, 10, 14)


def run(full: bool) -> list[Row]:
    """Return a row a kind of cell, the sum, and the real sets; `full` takes ten seeds of each."""
    rows: list[Row] = []
    every: list[float] = []
    for kind in KINDS:
        own = [ratio for seed in range(10 if full else 2) for ratio in ratios(kind, seed)]
        rows.append(Row(f"guide / result, {kind}", "", words(own)))
        every += own
    inside = float(np.mean([0.67 <= one <= 1.5 for one in every]))
    rows.append(Row("guide / result, all", "", words(every)))
    rows.append(Row("within 0.67 … 1.5", "≥ 95 %", f"{inside:.1%} of {len(every)}", inside >= 0.95))
    return [*rows, *wrong_rows(full), *real_rows()]


def wrong_rows(full: bool) -> list[Row]:
    """Return on how many sessions with wrong poses the guide says "enough", and how many it says to contradict."""
    said: list[tuple[bool, bool]] = []
    for seed in range(12 if full else 4):
        for _, session, measured in wrong_sessions(seed, 8):
            now = guide(session, measured, {}).current
            meter = now.meter
            said.append((meter is not None and meter.enough, "contradict" in now.instruction))
    enough, told = (sum(each) for each in zip(*said, strict=True))
    return [
        Row("wrong poses: the guide says enough", "0", f"{enough} of {len(said)}", enough == 0),
        Row("wrong poses: it says before a solve that captures contradict", "", f"{told} of {len(said)}"),
    ]


def wrong_sessions(seed: int, readings: int) -> Iterator[tuple[str, Session, list[Measured]]]:
    """Give a simulated session with its poses wrong in each way, so many of them other readings, by names."""
    made, other = (simulate_tcp(one, TcpScenario(orientations=7 + 2 * seed % 9)) for one in (seed, seed + 500))
    right, count = made.session, len(made.session.captures)
    measured = [measure_capture(right, capture, made.files.__getitem__) for capture in right.captures]
    draw = np.random.default_rng(seed)
    for kind in ORDERS:
        yield kind, ordered(right, wrong_order(kind, count, seed)), measured
    yield "two swapped", reordered(right, swapped(count, draw)), measured
    yield "one place on", reordered(right, shifted(count, draw)), measured
    pairs = enumerate(zip(right.captures, other.session.captures, strict=True))
    mixed = [mine.model_copy(update={"pose": theirs.pose}) if k % 2 else mine for k, (mine, theirs) in pairs]
    yield "two robots", right.model_copy(update={"captures": mixed}), measured
    every = list(wrong_readings())
    for index in draw.choice(len(every), readings, replace=False):
        wrong = every[index]
        yield wrong.name, rewritten(right, wrong.told, wrong.written), measured


def ratios(kind: str, seed: int, counts: Sequence[int] = COUNTS) -> list[float]:
    """Return what the guide says over what the result states, for growing numbers of a cell's captures."""
    cell = troubled(all_troubles()[kind], seed)
    found: list[float] = []
    for count in counts:
        session = cell.session.model_copy(update={"captures": cell.session.captures[:count]})
        try:
            said, _, stated = promises(session, cell.files.__getitem__)
        except CalibrationError:
            continue
        if stated.verdict != "fail" and stated.workpiece is not None and said is not None:
            found.append(said / uncertainty_mm(np.array(stated.workpiece.covariance)))
    return found


def promises(session: Session, read: ReadFile) -> tuple[float | None, float | None, TcpResult]:
    """Return ± at the workpiece, mm, as the guide says it before the solve and after, and the result.

    None where the guide does not know yet where tool and sphere are, or says that captures contradict each other.
    """
    result = solve_stage(session, "tcp", read)
    assert isinstance(result, TcpResult)
    measured = [measure_capture(session, capture, read) for capture in session.captures]
    said: list[float | None] = []
    for results in ({}, {"tcp": result.to_json()}):
        situation = situation_of(session, measured, results)
        silent = situation is None or (situation.apart and not results)
        said.append(None if situation is None or silent else advice_in(situation, None).meter.uncertainty_mm)
    return said[0], said[1], result


def uncertainty_mm(covariance: FloatArray) -> float:
    return COVERAGE * float(worst_sigma(covariance))


def words(own: Sequence[float]) -> str:
    low, middle, high = np.percentile(own, [5, 50, 95])
    return f"{middle:.2f} ({low:.2f}–{high:.2f})"


def real_rows() -> list[Row]:
    rows: list[Row] = []
    for name in SETS:
        folder = DATA / name
        if not folder.exists():
            continue
        session = parse_session(json.loads((folder / "session.json").read_text(encoding="utf-8")))
        before, after, result = promises(session, lambda file, folder=folder: (folder / file).read_bytes())
        assert result.workpiece is not None
        stated = uncertainty_mm(np.array(result.workpiece.covariance))
        rows.append(
            Row(f"{name}: guide before, after; result", "", f"± {before:.2f}, {after:.2f}; {stated:.2f} mm")
        )
    return rows
