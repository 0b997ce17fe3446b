"""Warnings that right cells get although nothing is wrong: simulated cells of five classes, and both real sets."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from bench_halves import DATA, SETS
from harness import Row

from calib_core.archive.folder import load_session
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
    told = [_codes(session, read) for session, read in _right(range(SEEDS if full else 4))]
    warned = Counter(code for codes in told for code in codes)
    cells, count = sum(map(bool, told)), len(told)
    most = max(warned.values(), default=0)
    # Whether what is said of a real set is so, and to be acted on, nobody but a reader can judge.
    real = [", ".join(sorted(_codes(*load_session(DATA / name)))) or "none" for name in SETS if DATA.is_dir()]
    return [
        Row(
            "right cells with a warning, most by one code; real sets' warnings",
            "≤ 2 %; ≤ 0.5 %",
            f"{cells} of {count}, {most}; {'; '.join(real)}",
            cells <= MOST_OF_ALL * count and most <= max(1, MOST_OF_ONE * count),
        )
    ]


def _codes(session: Session, read: Callable[[str], bytes]) -> set[str]:
    found = solve_stage(session, "tcp", read).findings
    return {one.code for one in found if one.severity != "note" and one.behind is None}


def _right(seeds: range) -> Iterator[tuple[Session, Callable[[str], bytes]]]:
    for trouble in RIGHT.values():
        for seed in seeds:
            cell = troubled(trouble, 5000 + seed)
            yield cell.session, cell.files.__getitem__
