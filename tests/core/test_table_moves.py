"""A table, or a sphere on it, that moves while it is captured is told: `scancell bench table_moves` has many."""

import pytest

from calib_core.stages.pipeline import solve_stage
from tests.trouble import all_table_troubles, troubled_table

MOVES = {"table-pushed", "table-creeps", "sphere-reseated", "clamp-gives"}


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize("when", ["between the mountings", "within a mounting"])
def test_a_table_that_was_pushed_is_said(when: str) -> None:
    cell = troubled_table(all_table_troubles()[f"pushed by 1 mm {when}"], 0)
    result = solve_stage(cell.session, "chain", cell.files.__getitem__)
    assert result.verdict == "warn"  # pushes passed up to 3.6 times off
    assert [f.code for f in result.findings if f.code in MOVES] == ["table-pushed"]
