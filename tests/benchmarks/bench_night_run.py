"""The night run of docs/examples: a cell that drifts, through 60 nights, with the two faults built in."""

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from bench_load import served
from harness import Row

from tests.server.test_night_run import go_through


def run(full: bool) -> Iterator[Row]:
    """Yield the figures; 12 nights without `full`."""
    nights = 60 if full else 12
    with tempfile.TemporaryDirectory() as folder, served(Path(folder)) as (address, _):
        start_s = time.monotonic()
        done = go_through(address, nights, hit_in=nights // 3, knocked_in=nights * 2 // 3)
        took_s = (time.monotonic() - start_s) / nights
    counts = {what: sum(night.did == what for night in done) for what in ("approve", "hold", "alarm")}
    told = ", ".join(f"{count} {what}" for what, count in counts.items())
    again = sum(night.rechecked for night in done)
    right = counts == {"approve": nights - 1, "hold": 0, "alarm": 1}
    yield Row(
        f"{nights} nights, each done right", "all", f"{told}; {again} rechecks; {took_s:.1f} s a night", right
    )
