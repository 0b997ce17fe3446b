"""The command line under odd use; `scancell bench invocations` goes through all that there is."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

from odd_invocations import invocations


@pytest.mark.thorough
def test_odd_invocations_end_with_their_status_and_one_sentence() -> None:
    outcomes = list(invocations(seed=2, count=45))
    assert len(outcomes) == 45
    assert [(odd.wrong, odd.words, odd.said[-300:]) for odd in outcomes if odd.wrong] == []
