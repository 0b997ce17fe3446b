"""Rows of scanners that other captures than those of step tcp place: cells whose captures are left out."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

from calib_core.findings import Finding
from calib_core.library.opened import OpenSession
from calib_core.records import Capture
from calib_core.simulation.topology import BallOptions
from calib_core.stages.turntable.verdict import scanner_move_not_checked
from tests.core.test_late_scanner import BESIDE, FIXED, HELD, MOUNTED, seen_by
from tests.every_code.made import Case, made


def seen_alone(stage: str, *, known: bool) -> Case:
    """Return what is noticed where a scanner that stands still saw the table alone."""

    def case() -> Iterable[Finding]:
        session, truth = seen_by(replace(FIXED, balls=(HELD, *MOUNTED)), lambda one: one.step != "tcp")
        brought = {"base_from_laser": truth["base_from_laser"]} if known else {}
        told = session.record.cell.known.model_copy(update=brought)
        cell = session.record.cell.model_copy(update={"known": told})
        return (
            OpenSession(session.record.model_copy(update={"cell": cell}), session.read).run(stage)[stage].findings
        )

    return case


def seen_late(by_arm: str, *by_gate: str) -> Case:
    """Return what is noticed where one scanner saw the table alone, and the other a still ball, too."""

    def case() -> Iterable[Finding]:
        return late(frozenset({by_arm, *by_gate}), frozenset(by_gate))

    return case


@cache
def late(by_arm: frozenset[str], by_gate: frozenset[str]) -> list[Finding]:
    """Return what the table's stage notices of both scanners."""
    of = {"arm": by_arm, "gate": by_gate}

    def keep(one: Capture) -> bool:
        return one.scanner == "arm" if one.step == "tcp" else one.mount in of[one.scanner or ""]

    session, _ = seen_by(replace(BESIDE, balls=(BallOptions(), HELD, *MOUNTED)), keep)
    return session.run("turntable")["turntable"].findings


def flange_after_table(many: int) -> Case:
    """Return what is said of a scanner that stands still, some captures of the flange's ball after the table's."""
    captures = made("fixed-scanner-turntable", 2).session.captures
    held = [capture for capture in captures if capture.step == "tcp"]
    on_it = [capture for capture in captures if capture.step == "turntable"]
    first = len(held) - many
    return lambda: scanner_move_not_checked([*held[:first], *on_it, *held[first:]], {""})


CASES: dict[str, tuple[Case, Case]] = {
    "table-without-base": (seen_alone("turntable", known=False), seen_alone("turntable", known=True)),
    "scanner-left-to-chain": (seen_late("low", "low", "high"), seen_late("low", "low")),
    "scanner-not-placed": (seen_late("low", "low"), seen_late("low", "low", "high")),
    "scanner-move-not-checked": (flange_after_table(0), flange_after_table(3)),
}
