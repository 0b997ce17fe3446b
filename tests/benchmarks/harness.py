"""What every benchmark shares: rows of figures, and interleaved timing of peers in one process."""

import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Row:
    """One figure: what, its target, what was measured, and whether it holds (None: no target)."""

    what: str
    target: str
    measured: str
    holds: bool | None = None


def interleaved_medians_s(jobs: Mapping[str, Callable[[], object]], rounds: int = 9) -> dict[str, float]:
    """Return each job's median duration in seconds; the jobs take turns, after one warming call each."""
    for job in jobs.values():
        job()
    durations: dict[str, list[float]] = {name: [] for name in jobs}
    for _ in range(rounds):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            durations[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in durations.items()}
