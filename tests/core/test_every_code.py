"""Every code: something that raises it, and something near it that does not."""

import pytest

from calib_core.findings import CODES
from tests.every_code import CASES


@pytest.mark.thorough(keep=16)
@pytest.mark.parametrize("code", CASES)
def test_a_code_is_raised_and_what_is_near_does_not_raise_it(code: str) -> None:
    raises, near = CASES[code]
    assert code in {finding.code for finding in raises()}
    assert code not in {finding.code for finding in near()}


def test_every_code_has_its_row() -> None:
    assert set(CODES) == set(CASES)
