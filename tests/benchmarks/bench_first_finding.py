"""One fault a session: does the first finding name it, and does its remedy, applied, repair the answer?

Which codes count for which fault stands here, written before anything was measured.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from bench_trouble import errors_over_stated
from harness import Row, all_kept
from wrong_lengths import scaled_files
from wrong_poses import reordered, rewritten, writer

from calib_core.causes.apply import applied, changes_for
from calib_core.errors import CalibrationError
from calib_core.findings import Finding
from calib_core.records import Session, parse_session
from calib_core.stages.pipeline import solve_stage
from calib_core.stages.tcp.record import TcpResult
from tests.trouble import Trouble, Troubled, all_troubles, troubled

SEEDS = 20
MOST_OFF = 3.0
"""Of a stated 95 %: a repaired answer lies nearer to the truth."""

_KINDS = all_troubles()
_CLEAN = _KINDS["arms: clean"]


@dataclass(frozen=True)
class Fault:
    """A fault, the codes that name it, and whether the program may mend it."""

    name: str
    codes: tuple[str, ...]
    made: Callable[[int], Troubled]


def _plain(seed: int, trouble: Trouble = _CLEAN) -> Troubled:
    return troubled(trouble, 7000 + seed)


def _session(change: Callable[[Session, int], Session]) -> Callable[[int], Troubled]:
    def made(seed: int) -> Troubled:
        cell = _plain(seed)
        return replace(cell, session=change(cell.session, seed))

    return made


def _told(told: str, inverted: bool = False) -> Callable[[int], Troubled]:
    return _session(lambda session, _: rewritten(session, told, writer("fanuc", 1.0, inverted)))


def _rows(order: Callable[[list[int], np.random.Generator], list[int]]) -> Callable[[int], Troubled]:
    def change(session: Session, seed: int) -> Session:
        return reordered(session, order(list(range(len(session.captures))), np.random.default_rng(seed)))

    return _session(change)


def _swapped(places: list[int], rng: np.random.Generator) -> list[int]:
    first, second = sorted(rng.choice(np.arange(4, len(places)), 2, replace=False).tolist())
    places[first], places[second] = places[second], places[first]
    return places


def _by_name(places: list[int], _: np.random.Generator) -> list[int]:
    """Return the places in the order of names without leading noughts: 1, 10, 11, …, 2."""
    return sorted(places, key=lambda place: str(place + 1))


def _diameter(session: Session, _: int) -> Session:
    data = session.to_json()
    data["cell"]["sphere_diameter_mm"] *= 0.9
    return parse_session(data)


def _scaled(x: float, z: float, seed: int) -> Troubled:
    cell = _plain(seed)
    return replace(cell, files=scaled_files(cell.files, x, z))


FAULTS = (
    Fault("poses told in another convention", ("pose-reading",), _told("kuka")),
    Fault("poses of the base in the flange", ("pose-reading",), _told("fanuc", inverted=True)),
    Fault("two poses swapped", ("swapped-poses",), _rows(_swapped)),
    Fault("poses in the order of names", ("pose-list-order", "shifted-poses"), _rows(_by_name)),
    Fault("poses in reverse", ("pose-list-order",), _rows(lambda places, _: places[::-1])),
    Fault("diameter told a tenth too small", ("sphere-diameter",), _session(_diameter)),
    Fault("profiles' x 0.8 of what it is", ("scaled-profile",), partial(_scaled, 0.8, 1.0)),
    Fault(
        "sphere moved by 5 mm for good",
        ("moved-sphere",),
        lambda seed: _plain(seed, _KINDS["sphere: moved by 5 mm for good"]),
    ),
    Fault(
        "sphere moved by 3 mm in one capture",
        ("captures-contradict", "moved-sphere"),
        lambda seed: _plain(seed, _KINDS["sphere: moved by 3 mm in one capture"]),
    ),
    Fault(
        "tool changed midway by 2 mm, 1°",
        ("changed-tool", "moved-sphere"),
        lambda seed: _plain(seed, _KINDS["books: tool changed midway by 2 mm, 1°"]),
    ),
)


def run(full: bool) -> list[Row]:
    """Return of how many sessions the first finding names the fault, and how many remedies repair."""
    told = all_kept({f"first-{fault.name}-{seed}": partial(_told_of, fault, seed) for fault, seed in _cases(full)})
    for one in told:
        if one["missed"]:
            print(one["missed"])
    named, count = sum(one["named"] for one in told), len(told)
    offered = [one["mended"] for one in told if one["mended"] is not None]
    return [
        Row(
            "one fault a session: the first finding names it",
            "≥ 95 %",
            f"{named} of {count}",
            named >= 0.95 * count,
        ),
        Row(
            "the same: its remedy, applied, repairs the answer",
            "≥ 90 % of those that have one",
            f"{sum(offered)} of {len(offered)}",
            sum(offered) >= 0.9 * len(offered),
        ),
    ]


def _told_of(fault: Fault, seed: int) -> dict[str, Any]:
    """Return whether the first finding of a session, or of its refusal, names its fault, and is mended."""
    cell = fault.made(seed)
    found = _findings(cell.session, cell)
    first = next((one for one in found if one.severity != "note"), None)
    if first is None or first.code not in fault.codes:
        return {
            "named": False,
            "mended": None,
            "missed": f"{fault.name} {seed}: {first.code if first else 'nothing'}",
        }
    if first.remedy is None or first.remedy.changes is None:
        return {"named": True, "mended": None, "missed": ""}
    session, _ = applied(cell.session, changes_for(cell.session, first.remedy))
    mended = _holds(session, cell)
    return {"named": True, "mended": mended, "missed": "" if mended else f"{fault.name} {seed}: not repaired"}


def _cases(full: bool) -> Iterator[tuple[Fault, int]]:
    for seed in range(SEEDS if full else 2):
        for fault in FAULTS:
            yield fault, seed


def _findings(session: Session, cell: Troubled) -> Sequence[Finding]:
    try:
        return solve_stage(session, "tcp", cell.files.__getitem__).findings
    except CalibrationError as error:
        return error.findings


def _holds(session: Session, cell: Troubled) -> bool:
    """Return whether an answer is near the truth by what it states; scaled files count in their true lengths.

    The truth is the tool of the captures that are left: before or after it was changed.
    """
    try:
        result = solve_stage(session, "tcp", cell.files.__getitem__)
    except CalibrationError:
        return False
    assert isinstance(result, TcpResult)
    left = [k for k, capture in enumerate(session.captures) if not capture.excluded]
    truth = replace(cell, tool0_from_laser=cell.tool0_from_laser @ cell.mounting(left[-1]))
    return result.verdict != "fail" and bool(np.max(errors_over_stated(result, truth)[:6]) < MOST_OFF)
