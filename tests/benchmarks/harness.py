"""What every benchmark shares: rows of figures, and interleaved timing of peers in one process."""

import json
import os
import statistics
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

T = TypeVar("T")


@dataclass(frozen=True)
class Row:
    """One figure: what, its target, what was measured, and whether it holds (None: no target)."""

    what: str
    target: str
    measured: str
    holds: bool | None = None

    def __post_init__(self) -> None:
        if self.holds is not None:
            object.__setattr__(self, "holds", bool(self.holds))  # numpy's own truth is not JSON's


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


def kept(name: str, step: Callable[[], T]) -> T:
    """Return what a step of a long bench gives, as JSON; with SCANCELL_BENCH_KEPT, a folder, each is done once.

    A bench of hours that was stopped goes on where it was; the folder is for one state of the product.
    """
    folder = os.environ.get("SCANCELL_BENCH_KEPT")
    if not folder:
        return step()
    path = Path(folder, f"{name}.json")
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        value = json.dumps(step())
        path.with_suffix(".part").write_text(value, encoding="utf-8")
        path.with_suffix(".part").replace(path)
    return json.loads(path.read_text(encoding="utf-8"))


def all_kept(steps: Mapping[str, Callable[[], T]]) -> list[T]:
    """Return what steps of a long bench give; with SCANCELL_BENCH_SUM what was kept so far, without doing more."""
    folder = os.environ.get("SCANCELL_BENCH_KEPT", "")
    some = [
        name for name in steps if not os.environ.get("SCANCELL_BENCH_SUM") or Path(folder, f"{name}.json").exists()
    ]
    return [kept(name, steps[name]) for name in some]
