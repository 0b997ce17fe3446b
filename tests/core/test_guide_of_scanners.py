"""The guide of a cell with several scanners: each is led by its own captures, and never held against another."""

from itertools import chain

import pytest

import calib_core as cc
from calib_core.captures.measure import measure_capture
from calib_core.records import Session
from calib_core.records.session import Known
from calib_core.records.topology import KnownFrame
from calib_core.stages.guide import guide


def in_turn(seed: int, first: str = "gate", second: str = "arm") -> tuple[cc.OpenSession, Session]:
    """Return a cell with a scanner on the flange and one in base, which captured one after the other."""
    opened, _ = cc.simulate("scanners-on-flange-and-base", seed)
    by = [[c for c in opened.captures if c.scanner == name] for name in (first, second)]
    return opened, opened.record.model_copy(update={"captures": [*chain(*zip(*by, strict=True))]})


@pytest.mark.parametrize("count", [3, 7, 16])
def test_good_captures_of_two_scanners_contradict_none(count: int) -> None:
    opened, session = in_turn(1)
    some = session.model_copy(update={"captures": session.captures[:count]})
    now = guide(some, [measure_capture(some, one, opened.read) for one in some.captures], {}).current
    assert "contradict" not in now.instruction
    assert now.suggested_pose is not None
    assert str(now.progress).startswith(("Scanner gate: ", "Scanner arm: "))
    if count < 16:  # then the best pose is known, whoever carries what
        assert ("the ball" in f"{now.instruction} {now.suggested_note}") == ("gate" in now.progress)


@pytest.mark.parametrize("order", [("gate", "arm"), ("arm", "gate")])
def test_once_they_are_solved_it_goes_on_by_the_one_in_hand(order: tuple[str, str]) -> None:
    opened, session = in_turn(1, *order)
    session = session.model_copy(update={"captures": session.captures[:-1]})  # the second has taken fewer
    results = {name: one.to_json() for name, one in cc.OpenSession(session, opened.read).run().items()}
    assert guide(session, [], results).current.action == "review"
    wanted = session.model_copy(update={"cell": session.cell.model_copy(update={"wanted_mm": 0.05})})
    measured = [measure_capture(session, one, opened.read) for one in session.captures]
    now = guide(wanted, measured, results).current
    assert now.meter is not None
    assert now.meter.uncertainty_mm is not None
    assert now.meter.uncertainty_mm < 1.0


def test_a_scanner_that_took_nothing_yet_is_asked_for_before_the_solve() -> None:
    opened, _ = cc.simulate("two-scanners-in-turn", 5)
    session = opened.record
    left = session.model_copy(update={"captures": [c for c in session.captures if c.scanner == "left"]})
    measured = [measure_capture(left, one, opened.read) for one in left.captures]
    now = guide(left, measured, {}).current
    assert (now.action, str(now.progress)) == ("capture", "Scanner right: 0 of 10 captures")
    some = [c for c in session.captures if c.scanner == "right"][:3]
    few = left.model_copy(update={"captures": [*left.captures, *some]})
    now = guide(few, [measure_capture(few, one, opened.read) for one in few.captures], {}).current
    assert (now.action, str(now.progress)[:14]) == ("capture", "Scanner right:")
    result = cc.OpenSession(left, opened.read).run("tcp")["tcp"].to_json()
    assert guide(left, measured, {"tcp": result}).current.action == "capture"
    known = KnownFrame(into="tool0", outof="laser", scanner="right", matrix=result["tool0_from_laser"])
    cell = left.cell.model_copy(update={"known": Known(frames=[known])})
    told = left.model_copy(update={"cell": cell})
    assert guide(told, measured, {}).current.action == "solve"  # nothing of it is to be found


def test_captures_that_name_no_scanner_are_told_with_whose_they_count_as() -> None:
    _, session = in_turn(1)
    some = session.captures[:4]
    silent = session.model_copy(update={"captures": [some[0].model_copy(update={"scanner": None}), *some[1:]]})
    found = [one for one in guide(silent, [], {}).findings if one.code == "capture-without-scanner"]
    assert [(one.captures, one.values["scanner"]) for one in found] == [([some[0].id], "arm")]
    assert "capture-without-scanner" not in {one.code for one in guide(session, [], {}).findings}
