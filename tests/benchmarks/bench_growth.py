"""How the time of a solve grows with the number of profiles: exponent, and beside the time of measuring them.

The TCP from so many profiles; a turntable, and tool and turntable together, from so many on the table in two
mountings, as their stages answer, evidence and all.
"""

import time

import numpy as np
from harness import Row

from calib_core.captures.content import sphere_of
from calib_core.captures.observe import observe_capture
from calib_core.chain.tcp import solve_tcp
from calib_core.frames import FloatArray
from calib_core.stages.pipeline import solve_stage
from tests.trouble import TableTrouble, Trouble, troubled
from tests.trouble.cell import Plan
from tests.trouble.table_cell import TablePlan

TABLE_STAGES = ("turntable", "chain")


def run(full: bool) -> list[Row]:
    """Return the rows; `full` goes to 2,000 profiles, otherwise to 400."""
    sizes = (100, 500, 2000) if full else (100, 400)
    rows: list[Row] = []
    timed(15)  # compiles and imports
    rows += rows_of("profiles", sizes, np.array([timed(size) for size in sizes]))
    table_sizes = (100, 400, 1000, 2000) if full else sizes
    timed_table(24)
    times = np.array([timed_table(size) for size in table_sizes])
    for column, stage in enumerate(TABLE_STAGES, start=1):
        rows += rows_of(
            f"profiles on a turntable, stage {stage}", table_sizes, times[:, [0, column]], beside=False
        )
    return rows


def rows_of(what: str, sizes: tuple[int, ...], times: FloatArray, beside: bool = True) -> list[Row]:
    """Return the rows of one kind from the seconds of measuring and solving (N, 2); `beside`: it has a limit."""
    measuring, solving = times.T
    slope = float(np.log(times[-1].sum() / times[0].sum()) / np.log(sizes[-1] / sizes[0]))
    rows = [
        Row(f"{size} {what}: measuring, solving", "", f"{m:.2f} s, {s:.2f} s")
        for size, (m, s) in zip(sizes, times, strict=True)
    ]
    text = f"{solving[-1] / measuring[-1]:.2f} ×"
    limit, holds = ("≤ 1 ×", bool(solving[-1] <= measuring[-1])) if beside else ("", None)
    return [
        *rows,
        Row(f"exponent from {sizes[0]} to {sizes[-1]} {what}", "≤ 1.15", f"{slope:.2f}", slope <= 1.15),
        Row(f"solving / measuring, {sizes[-1]} {what}", limit, text, holds),
    ]


def timed(profiles: int) -> tuple[float, float]:
    """Return the processor's time, s, that measuring and solving of so many profiles take."""

    def change(plan: Plan, rng: np.random.Generator) -> None:
        plan.shifts, plan.tilts = profiles // 5, profiles - profiles // 5

    cell = troubled(Trouble("many", change), 1)
    begin = time.process_time()
    observations = [observe_capture(cell.session, c, cell.files.__getitem__) for c in cell.session.captures]
    middle = time.process_time()
    solve_tcp(observations, sphere_of(cell.session.cell, cell.session.captures))
    return middle - begin, time.process_time() - middle


def timed_table(profiles: int) -> tuple[float, ...]:
    """Return the processor's time, s, of measuring so many profiles on a turntable, and of each of its stages."""

    def change(plan: TablePlan, rng: np.random.Generator) -> None:
        each = profiles // len(plan.heights_mm)
        plan.angles_deg = tuple(float(angle) for angle in rng.permutation(360.0 * np.arange(each) / each))

    cell = troubled(TableTrouble("many", change), 1)
    session, read = cell.session, cell.files.__getitem__
    times = [time.process_time()]
    for capture in session.captures:
        observe_capture(session, capture, read)
    times.append(time.process_time())
    for stage in TABLE_STAGES:
        solve_stage(session, stage, read)
        times.append(time.process_time())
    return tuple(np.diff(times).tolist())
