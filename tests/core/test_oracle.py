"""The solvers answer as those of 2026-11 did; `scancell bench oracle --full` asks eighty cells."""

import pytest

from tests.oracle.answers import answers, kept_answers, largest_difference


@pytest.mark.parametrize("seed", [40_002, 40_003, 40_004, 40_007, 40_009, 40_010])
def test_the_solvers_answer_as_before(seed: int) -> None:
    kept, now = kept_answers()[seed], answers(seed)
    assert now["cell"] == kept["cell"]
    sigmas, others = largest_difference(kept, now)
    assert sigmas < 1e-3
    assert others == []
