"""`kill -9` at random moments under load, a few times; `scancell bench kill --full` does it 300 times."""

import pytest
from bench_kill import kill_rounds


@pytest.mark.thorough(keep=1)
@pytest.mark.parametrize(("kills", "migrations"), [(2, 0), (5, 1)])
def test_kills_lose_nothing_that_was_acknowledged_and_leave_nothing_half(kills: int, migrations: int) -> None:
    counts = kill_rounds(kills=kills, seed=20, longest_s=1.0, forked=True)
    assert (counts.kills, counts.migrations) == (kills, migrations)
    assert counts.acknowledged > 0
    assert counts.found.lost == []
    assert counts.found.half == []
    assert counts.starts_failed == 0
