"""Warnings that right cells get although nothing is wrong: simulated cells of five classes, and both real sets."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from bench_halves import DATA, SETS
from harness import Row

from calib_core.archive.folder import load_session
from calib_core.findings.table import CODES
from calib_core.records import Session
from calib_core.stages.pipeline import solve_stage
from tests.trouble import Trouble, all_troubles, troubled

SEEDS = 60
MOST_OF_ALL = 0.02
MOST_OF_ONE = 0.005


def _good_arm(plan: Any, _: Any) -> None:
    """Sixty captures by an arm three times as true as the others."""
    plan.shifts, plan.tilts = 10, 50
    plan.position_mm, plan.orientation_rad = 0.01, 3e-5


RIGHT = {
    name: trouble
    for name, trouble in all_troubles().items()
    if name in ("arms: clean", "arms: repeats to 0.1 mm", "arms: joints 0.02°, links 0.1 mm", "sphere: certified")
} | {"good arm, 60 captures": Trouble("good arm, 60 captures", _good_arm, clean=True)}


def run(full: bool) -> list[Row]:
    """Return how many right cells are warned, by all codes together and by the most frequent one."""
    seeds = range(SEEDS if full else 4)
    count = 0
    warned: Counter[str] = Counter()
    cells = 0
    for session, read in _right(seeds):
        count += 1
        result = solve_stage(session, "tcp", read)
        codes = {one.code for one in result.findings if one.severity != "note" and one.behind is None}
        assert codes <= CODES.keys()
        cells += bool(codes)
        warned.update(codes)
    named = ", ".join(f"{code} {times}" for code, times in warned.most_common(4)) or "none"
    most = max(warned.values(), default=0)
    return [
        Row(
            "right cells, real sets with a warning; by code",
            "≤ 2 %; ≤ 0.5 %",
            f"{cells} of {count}; {named}",
            cells <= MOST_OF_ALL * count and most <= max(1, MOST_OF_ONE * count),
        )
    ]


def _right(seeds: range) -> Iterator[tuple[Session, Callable[[str], bytes]]]:
    for trouble in RIGHT.values():
        for seed in seeds:
            cell = troubled(trouble, 5000 + seed)
            yield cell.session, cell.files.__getitem__
    for name in SETS if DATA.is_dir() else ():
        yield load_session(DATA / name)
