"""Warnings that right cells get although nothing is wrong: simulated cells of five classes, and both real sets."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from bench_halves import DATA, SETS
from harness import Row

from calib_core.archive.folder import load_session
from calib_core.records import Session
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
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
    return [
        Row(
            "right cells with a warning, most by one code",
            "≤ 2 %; ≤ 0.5 %",
            f"{cells} of {count}, {most}",
            cells <= MOST_OF_ALL * count and most <= max(1, MOST_OF_ONE * count),
        ),
        *map(of_real, SETS if DATA.is_dir() else ()),
    ]


def of_real(name: str) -> Row:
    """Return what a real set is warned of, and whether its answer gets better by what the warnings ask for.

    What is weakly determined is judged by its ±; errors of the scanner, by captures that were left out in turn.
    """
    session, read = load_session(DATA / name)
    told = sorted(_codes(session, read))
    scanner = session.cell.scanner.model_copy(update={"errors": "apply"})
    applied = session.model_copy(update={"cell": session.cell.model_copy(update={"scanner": scanner})})
    before, after = (solve_stage(one, "tcp", read) for one in (session, applied))
    assert isinstance(before, TcpResult)
    assert isinstance(after, TcpResult)
    left_out = [one.leave_one_out_surface_rms_mm or float("nan") for one in (before, after)]
    better = f"; errors applied, {left_out[1]:.2f} for {left_out[0]:.2f} mm left out"
    told_of_scanner = any(code.startswith("scanner-") for code in told)
    return Row(
        f"{name}: warnings",
        "only what is to be acted on",
        (", ".join(told) or "none") + (better if told_of_scanner else ""),
        not told_of_scanner or left_out[1] < left_out[0],
    )


def _codes(session: Session, read: Callable[[str], bytes]) -> set[str]:
    found = solve_stage(session, "tcp", read).findings
    return {one.code for one in found if one.severity != "note" and one.behind is None}


def _right(seeds: range) -> Iterator[tuple[Session, Callable[[str], bytes]]]:
    for trouble in RIGHT.values():
        for seed in seeds:
            cell = troubled(trouble, 5000 + seed)
            yield cell.session, cell.files.__getitem__
