"""Tables, and spheres on them, that move while they are captured: how often that is found, and falsely."""

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np
from bench_halves import DATA
from bench_table_trouble import STAGES, errors_over_stated
from harness import Row, all_kept

from calib_core.archive.folder import load_session
from calib_core.graph.stage_input import Kept
from calib_core.stages.chain.record import ChainResult
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.turntable.record import TurntableResult
from tests.trouble import all_table_troubles, troubled

End = tuple[str, list[str], float]
CODES = ("table-pushed", "table-creeps", "sphere-reseated", "sphere-remounted", "clamp-gives")
SOUGHT = (
    ("pushed by 1 mm between the mountings", 0.95),
    ("pushed by 0.3 mm between the mountings", 0.60),
    ("pushed by 1 mm within a mounting", 0.95),
    ("creeps by 0.3 mm", 0.50),
    ("sphere slips by 0.5 mm", 0.90),
    ("a clamp gives by 0.5 mm", 0.50),
)
_CLEAN = ("clean", "repeats to 0.1 mm", "joints 0.01°, links 0.05 mm")


def run(full: bool) -> list[Row]:
    """Return each stage's rows; `full` takes 100 tables a move and 300 that stand still, otherwise 12 and 36.

    Both stages judge the same tables.
    """
    count = 100 if full else 12
    moves = [row for name, least in SOUGHT for row in found(name, least, range(count))]
    return [*moves, *still(range(500, 500 + 3 * count)), *real()]


def real() -> list[Row]:
    """Return how many real positioners, each of one turn at one height, are said to have moved."""
    folders = sorted(DATA.glob("turntable-*"))
    said: list[str] = []
    for folder in folders:
        session, read = load_session(folder)
        said += {finding.code for finding in solve_stage(session, "turntable", read).findings} & set(CODES)
    told = f"{len(said)} of {len(folders)}" + "".join(f", {code}" for code in sorted(set(said)))
    return [Row("turntable, real positioners: said to move", "none", told, not said)] if folders else []


def found(name: str, least: float, seeds: Iterable[int]) -> list[Row]:
    """Return how often each stage tells by its code that something moved, and its worst, in stated 95 %."""
    tables = all_kept(steps((name, seed) for seed in seeds))
    rows: list[Row] = []
    for stage, ends in _by_stage(tables):
        said = sum(any(code in CODES for code in codes) for _, codes, _ in ends)
        worst = max((off for verdict, _, off in ends if verdict == "pass"), default=0.0)
        share, worst_warned = (
            said / len(ends),
            max((off for verdict, _, off in ends if verdict == "warn"), default=0.0),
        )
        rows += [
            Row(f"{stage}, {name}: told", f"≥ {least:.0%}", f"{said} of {len(ends)}", share >= least),
            Row(f"{stage}, {name}: worst `pass` over its stated 95 %", "≤ 3 ×", f"{worst:.1f} ×", worst <= 3),
            Row(f"{stage}, {name}: worst `warn` over its stated 95 %", "–", f"{worst_warned:.1f} ×"),
        ]
    return rows


def still(seeds: Iterable[int]) -> list[Row]:
    """Return how often each stage says of a table that stands still that it moves."""
    tables = all_kept(steps((_CLEAN[seed % len(_CLEAN)], seed) for seed in seeds))
    rows: list[Row] = []
    for stage, ends in _by_stage(tables):
        said = sum(any(code in CODES for code in codes) for _, codes, _ in ends)
        what, told = f"{stage}, tables that stand still: said to move", f"{said} of {len(ends)}"
        rows.append(Row(what, "≤ 0.5 %", told, said <= 0.005 * len(ends)))
    return rows


def _by_stage(tables: list[dict[str, End]]) -> list[tuple[str, list[End]]]:
    return [(stage, [table[stage] for table in tables]) for stage in STAGES] if tables else []


def steps(tables: Iterable[tuple[str, int]]) -> dict[str, Callable[[], dict[str, End]]]:
    """Return what is to be done with tables of a kind and seed, by names of the steps."""
    return {f"table-{name}-{seed}".replace(" ", "-"): partial(ended, name, seed) for name, seed in tables}


def ended(name: str, seed: int) -> dict[str, End]:
    """Return each stage's verdict on one table, its codes, and its worst error over half the stated 95 %."""
    cell = troubled(all_table_troubles()[name], seed)
    kept, ends = Kept(), dict[str, End]()
    for stage in STAGES:
        result = solve_stage(cell.session, stage, cell.files.__getitem__, kept=kept)
        assert isinstance(result, TurntableResult | ChainResult)
        off = float(np.max(errors_over_stated(result, cell)))
        ends[stage] = result.verdict, [finding.code for finding in result.findings], off
    return ends
