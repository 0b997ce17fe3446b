"""Which changes of a verification's limits let more pass than before its first capture."""

from itertools import pairwise

import pytest

from calib_core.findings.codes.verify import LIMIT_CHANGED, LIMIT_EASED
from calib_core.records import Verification
from calib_core.records.evidence import Table
from calib_core.stages.verify.limits import changes_between, changes_table, limit_findings, said_change

AT = "2026-05-04T10:00:00Z"


def after(*limits: float | None, field: str = "form_mm") -> Verification:
    """Return limits after one was set to each of these in turn, three captures having been taken."""
    changes = []
    for old, new in pairwise(limits):
        before, now = (Verification.model_validate({field: value}) for value in (old, new))
        changes += changes_between(before, now, 3, AT, "Kim", "told wrongly")
    return Verification.model_validate({field: limits[-1], "changes": changes})


@pytest.mark.parametrize(
    ("limits", "eased"),
    [
        ((0.1, 0.2), [True]),
        ((0.2, 0.1), [False]),
        ((None, 0.1), [True]),
        ((0.1, None), [True]),
        ((0.1, 0.3, 0.2), [True, True]),
        ((0.2, 0.3, 0.1), [False, False]),
        ((0.2, 0.3, 0.2), [False, False]),
        ((0.2, 0.2), []),
    ],
)
def test_what_counts_is_the_limit_before_the_first_capture(
    limits: tuple[float | None, ...], eased: list[bool]
) -> None:
    found = [finding.code for finding in limit_findings(after(*limits))]
    assert found == [LIMIT_EASED.name if one else LIMIT_CHANGED.name for one in eased]


def test_a_ball_bar_that_is_told_otherwise_is_no_easier_limit() -> None:
    for length in ((300.0, 310.0), (300.0, None)):
        found = limit_findings(after(*length, field="ball_bar_mm"))
        assert [finding.code for finding in found] == [LIMIT_CHANGED.name]


def test_before_the_first_capture_nothing_is_kept() -> None:
    assert changes_between(Verification(), Verification(form_mm=0.2), 0, AT, "Kim") == []
    assert limit_findings(Verification(form_mm=0.2)) == []
    assert changes_table(Verification(form_mm=0.2)) == []


@pytest.mark.parametrize(
    ("limits", "words"), [((None, 0.1), "set"), ((0.1, None), "removed"), ((0.1, 0.25), "changed")]
)
def test_a_change_is_said_with_who_and_why(limits: tuple[float | None, ...], words: str) -> None:
    (change,) = after(*limits).changes or []
    said = str(said_change(change))
    assert "probing form" in said
    assert "Kim" in said
    assert "told wrongly" in said
    (table,) = changes_table(after(*limits))
    assert isinstance(table, Table)
    (row,) = table.rows
    shown = [None if value is None else f"{value:g} mm" for value in limits]
    assert row.cells[:2] == [AT, "Kim"]
    assert row.cells[3:5] == shown
    assert getattr(row.cells[5], "value", None) == 3
    assert row.cells[6] == "told wrongly"
    assert limit_findings(after(*limits))[0].values["how"] == words
