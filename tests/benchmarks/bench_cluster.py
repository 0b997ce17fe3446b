"""Merges on a Dask cluster of local workers of one thread each, beside the same in one process."""

import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import dask.config
import psutil
from distributed import LocalCluster
from harness import Row

from server.jobs import worker
from server.jobs.dask_pool import DaskPool
from server.settings import Settings
from server.store.blob_places import open_blobs
from tests.server.s3 import running_s3, s3_client
from tests.vase import vase_session

_MOST_MB = 1200.0
"""That a worker may hold: half a gigabyte of libraries, its share of `memory_mb`, and a few scans."""


@dataclass
class Merged:
    """What a merge took, and what came of it."""

    seconds: float
    outputs: dict[str, str]
    result: dict[str, Any]
    processor_s: list[float] = field(default_factory=list[float])
    peaks_mb: list[float] = field(default_factory=list[float])


def run(full: bool) -> Iterator[Row]:
    """Yield the figures: of 72 scans of a million points with `full`, else of 12 of 90,000."""
    scans, side = (72, 1000) if full else (12, 300)
    what = f"merge of {scans} × {side * side / 1e6:g}M points"
    with tempfile.TemporaryDirectory(prefix="scancell-cluster-") as folder:
        settings = Settings(data=Path(folder))
        work = stored(settings, scans, side)
        alone = here(settings, work)
        found = {workers: on_cluster(settings, work, workers) for workers in (1, 2)}
        half = on_cluster(settings, stored(settings, scans // 2, side), 2)
    yield from rows(what, alone, found, half)
    with tempfile.TemporaryDirectory(prefix="scancell-cluster-") as folder, running_s3() as s3:
        s3_client(s3).create_bucket(Bucket="cluster")
        settings = Settings(data=Path(folder), blobs="s3://cluster", s3_endpoint=s3)
        by_s3 = on_cluster(settings, stored(settings, scans, side), 2)
    same = by_s3.outputs == alone.outputs
    yield Row(f"{what}, blobs in S3, two workers", "equal", f"{by_s3.seconds:.1f} s; equal: {same}", same)


def rows(what: str, alone: Merged, found: dict[int, Merged], half: Merged) -> Iterator[Row]:
    """Yield the figures of merges whose blobs are in a folder."""
    one, two = found[1], found[2]
    same = all(m.outputs == alone.outputs and m.result == alone.result for m in (one, two))
    yield Row(f"{what}, here without a cluster (two threads)", "", f"{alone.seconds:.1f} s")
    yield Row(f"{what}: cloud and result, byte for byte", "equal", "equal" if same else "different", same)
    ratio = one.seconds / two.seconds
    told = f"{ratio:.2f} × ({one.seconds:.1f}, {two.seconds:.1f} s)"
    yield Row(f"{what}: two workers beside one", "≥ 1.5 × faster", told, ratio >= 1.5)
    busiest = one.processor_s[0] / max(two.processor_s)
    told = f"{busiest:.2f} × ({one.processor_s[0]:.1f}; {', '.join(f'{s:.1f}' for s in two.processor_s)} s)"
    yield Row("  processor time of one beside that of the busier of two", "", told)
    peaks = ", ".join(f"{peak:.0f}" for peak in (*one.peaks_mb, *two.peaks_mb))
    holds = max(*one.peaks_mb, *two.peaks_mb) <= _MOST_MB
    yield Row("  memory of each worker at most (one; two)", f"≤ {_MOST_MB:.0f} MB", f"{peaks} MB", holds)
    yield Row("  the same of half the scans", "", ", ".join(f"{peak:.0f}" for peak in half.peaks_mb) + " MB")


def stored(settings: Settings, scans: int, side: int) -> partial[worker.Solved]:
    """Put a session's scans where the settings say, and return the work of its merge."""
    record, files = vase_session(scans, side)
    blobs = open_blobs(settings.blob_place)
    digests = {name: blobs.put(content) for name, content in files.items()}
    return partial(worker.solve, "job", record, "merge", digests, {})


def here(settings: Settings, work: partial[worker.Solved]) -> Merged:
    """Merge in this process."""
    worker.begin(settings, 0, lambda _: None)
    begin_s = time.monotonic()
    return _merged(work(), begin_s)


def on_cluster(settings: Settings, work: partial[worker.Solved], workers: int) -> Merged:
    """Merge on a cluster of so many workers of one thread each, which have all loaded what it takes."""
    with cluster(workers) as local:
        pool = DaskPool(settings.model_copy(update={"dask": local.scheduler_address}), lambda _: None)
        try:
            record, files = vase_session(4, 60)
            blobs = open_blobs(settings.blob_place)
            small = {name: blobs.put(content) for name, content in files.items()}
            pool.submit(partial(worker.solve, "job", record, "merge", small, {})).result(timeout=300)
            with watched([psutil.Process(own.pid) for own in local.workers.values()]) as (peaks, used):
                begin_s = time.monotonic()
                merged = _merged(pool.submit(work).result(), begin_s)
            merged.peaks_mb, merged.processor_s = peaks, used
        finally:
            pool.close()
    return merged


@contextmanager
def cluster(workers: int) -> Iterator[Any]:
    """Give a cluster of local processes of one thread each."""
    with (
        dask.config.set({"distributed.worker.multiprocessing-method": "spawn"}),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            host="127.0.0.1",
            protocol="tcp://",
            silence_logs=50,
        ) as local,
    ):
        yield local


@contextmanager
def watched(processes: list[psutil.Process]) -> Iterator[tuple[list[float], list[float]]]:
    """Note the most memory that processes hold meanwhile, MB, and the processor time that they use, s."""
    processes = [child for process in processes for child in (process.children(recursive=True) or [process])]
    processes = [one for one in processes if one.memory_info().rss > 60e6]
    peaks, used = [0.0] * len(processes), [-sum(p.cpu_times()[:2]) for p in processes]
    ended = threading.Event()

    def watch() -> None:
        while not ended.wait(0.1):
            peaks[:] = [max(peak, p.memory_info().rss / 1e6) for peak, p in zip(peaks, processes, strict=True)]

    thread = threading.Thread(target=watch)
    thread.start()
    try:
        yield peaks, used
    finally:
        ended.set()
        thread.join()
        used[:] = [so_far + sum(p.cpu_times()[:2]) for so_far, p in zip(used, processes, strict=True)]


def _merged(solved: worker.Solved, begin_s: float) -> Merged:
    seconds = time.monotonic() - begin_s
    return Merged(seconds, {name: output.sha256 for name, output in solved.outputs.items()}, solved.result)
