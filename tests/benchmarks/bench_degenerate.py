"""Sets of three to eight captures, drawn at random from good ones: each ends with a result or a sentence.

What is asked of a result is what a user asks: the result told, every export, the report and the answer.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from harness import Row, all_kept

from calib_core.archive.folder import load_session, result_data
from calib_core.errors import CalibrationError, ConflictError, InputError, MeasurementError, MotionError
from calib_core.exports.export import export
from calib_core.exports.registry import all_exports
from calib_core.records import Session
from calib_core.review.answer import answer_of_folder
from calib_core.simulation import simulate
from calib_core.stages.evidence import text_of
from calib_core.stages.pipeline import solve_stage, stages_to_solve
from server.render.report.report import report_html

Read = Callable[[str], bytes]
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
REAL = ("tcp-sphere-80mm", "tcp-sphere-25mm")
SIMULATED = ("tcp", "tcp-spoiled", "turntable")


def run(full: bool) -> list[Row]:
    """Return one row a source of sets; `full` draws a hundred of each."""
    count = 100 if full else 12
    return [one for name in (*SIMULATED, *(REAL if DATA.is_dir() else ())) for one in rows(name, range(count))]


def rows(name: str, seeds: range) -> list[Row]:
    """Return how many sets of a source end otherwise than with a result or a sentence on what to capture."""
    session, read = of_name(name)
    sets = all_kept(
        {f"degenerate-{name}-{seed}": lambda seed=seed: [*ended(drawn(session, seed), read)] for seed in seeds}
    )
    ends = [end for of_set in sets for end in of_set]
    bad = [end for end in ends if end.startswith("thrown away")]
    verdicts = {kind: ends.count(kind) for kind in dict.fromkeys(ends) if not kind.startswith("thrown away")}
    told = ", ".join(f"{kind} {count}" for kind, count in sorted(verdicts.items()))
    measured = f"{len(bad)} of {len(sets)} ({told})" + (f": {bad[0]}" if bad else "")
    what = f"{name}: random sets of 3 to 8 captures thrown away"
    return [Row(what, "0", measured, not bad)] if sets else []


def of_name(name: str) -> tuple[Session, Read]:
    """Return a simulated session or a real one, and what reads its files."""
    if name in SIMULATED:
        simulated = simulate(name, 3)
        return simulated.session, simulated.files.__getitem__
    return load_session(DATA / name)


def drawn(session: Session, seed: int) -> Session:
    """Return the session with three to eight captures of its last step; every third set has neighbours alone.

    Neighbours of a simulated cell are translations without a turn, or table angles of one height.
    """
    rng = np.random.default_rng(seed)
    step = session.captures[-1].step
    before = [capture for capture in session.captures if capture.step != step]
    last = [capture for capture in session.captures if capture.step == step]
    count = int(rng.integers(3, 9))
    start = int(rng.integers(0, len(last) - count + 1))
    chosen = range(start, start + count) if seed % 3 == 0 else sorted(rng.permutation(len(last))[:count].tolist())
    return session.model_copy(update={"captures": [*before, *(last[k] for k in chosen)]})


def ended(session: Session, read: Read) -> Iterator[str]:
    """Yield how each stage of a set ends: its verdict, the kind of refusal, or what was raised on a result."""
    results: dict[str, dict[str, Any]] = {}
    for stage in stages_to_solve(session):
        if stage != "tcp" and "tcp" not in results:
            return  # without a tool there is nothing to solve, and the refusal before says so
        try:
            result = solve_stage(session, stage, read)
        except (MotionError, MeasurementError) as error:
            yield type(error).__name__ if error.to_do else f"thrown away: {stage}: no advice: {error}"
        except InputError as error:
            yield f"thrown away: {stage}: {error}"
        else:
            results[stage] = json.loads(json.dumps(result_data(result), allow_nan=False))
            text_of(result)
            yield result.verdict
    if results:
        yield from used(session, results, read)


def used(session: Session, results: dict[str, dict[str, Any]], read: Read) -> Iterator[str]:
    """Yield what report, answer and exports raise on results, where it is no refusal to use them."""
    try:
        report_html(session, results)
        answer_of_folder(session, results, read)
    except CalibrationError as error:
        yield f"thrown away: {error}"
    for entry in all_exports():
        try:
            export(session, results, entry.name)
        except ConflictError:
            continue
        except InputError as error:
            if not error.where or error.where.startswith("results/"):
                yield f"thrown away: {entry.name}: {error}"
