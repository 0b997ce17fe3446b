"""A radius or an error by incidence beyond what is believed of it leaves the answer less sure."""

import numpy as np
import pytest
from bench_misjudged import sharpened
from bench_trouble import Outcome, outcome

from calib_core.chain import rejection
from tests.trouble import all_troubles


def solved(trouble: str) -> Outcome:
    return outcome(sharpened(all_troubles()[trouble]), 0)


@pytest.mark.thorough
def test_captures_that_doubt_the_told_diameter_widen_the_answer() -> None:
    """Once 2.14 times its stated 95 % off under `pass`: radius and rim were found at 2.7 of their sigmas."""
    assert solved("sphere: told 0.3 mm too small").worst < 1.5


@pytest.mark.thorough
def test_a_right_cell_stays_as_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    found = solved("arms: clean")
    monkeypatch.setattr(rejection, "_IMPROBABLE", np.inf)
    assert found.errors.tolist() == solved("arms: clean").errors.tolist()
