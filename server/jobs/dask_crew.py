"""A merge on a Dask cluster: its workers read and clean scans, and each sums the points of some regions.

A job's own worker only says what is to be done next; scans go from the blobs to the worker that cleans them, and
from there the points of each region to the worker that sums it.  What is summed goes from task to task, and
is changed in place: a worker that ends takes the job with it, and nothing is left behind on the others.
"""

from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from operator import attrgetter, itemgetter, methodcaller
from typing import Any

from distributed import Client, wait, worker_client

from calib_core.archive.spill import FileSpill
from calib_core.captures.observation_cache import plain
from calib_core.captures.scans import SessionScans
from calib_core.fusion.crew import (
    REGIONS,
    Crew,
    Extent,
    MergeOptions,
    RegionGrids,
    RegionPoints,
    ScanReport,
    ScanTask,
    Tell,
    look_at,
)
from calib_core.fusion.merge import VoxelCloud
from calib_core.fusion.scan import Scan

_SCANS_AT_ONCE = 2  # a worker: one that it cleans, one that waits for its turn to be summed
_SUM_FIRST = 10
_LOOK_S = 5.0


class LostWorkError(Exception):
    """What was summed went with a worker that ended."""


@contextmanager
def dask_crew(options: MergeOptions) -> Generator[Crew]:
    """Give the workers of the cluster whose task this is; the task's own worker is one of them meanwhile."""
    with worker_client(timeout=30, separate_thread=True) as client:
        yield DaskCrew(client, options)


class DaskCrew(Crew):
    """The workers of a cluster.

    Parameters
    ----------
    client : Client
    options : MergeOptions
    """

    def __init__(self, client: Client, options: MergeOptions) -> None:
        self._client: Any = client
        self._workers: list[str] = sorted(client.scheduler_info(n_workers=-1)["workers"])
        shares = min(len(self._workers), REGIONS)
        self._shares = [tuple(range(first, REGIONS, shares)) for first in range(shares)]
        self._at_once = _SCANS_AT_ONCE * len(self._workers)
        # One thread a worker, here too: a worker that has more is given more tasks instead.
        self._one_thread = replace(options.clean, workers=1)
        self._owners = self._workers[: len(self._shares)]
        self._sums = [
            self._submit(_begin, options, share, workers=[worker])
            for share, worker in zip(self._shares, self._owners, strict=True)
        ]
        self._summed = 0
        self._busy = False

    def look_through(
        self, scans: Sequence[Scan], numbers: Sequence[int], task: ScanTask, tell: Tell
    ) -> Iterator[ScanReport]:
        """Have scans cleaned and summed, a few at a time; see `Crew`."""
        assert isinstance(scans, SessionScans)
        names = scans.names
        task = replace(task, options=replace(task.options, clean=self._one_thread))
        given = self._client.scatter([(scans.read_by(plain(scans.reader)), task)], hash=False)[0]
        under_way: deque[_UnderWay] = deque()
        cleaned = dict.fromkeys(self._workers, 0)
        self._busy = True
        for done, number in enumerate(numbers):
            tell(done, names[number])
            to_clean = {worker: sum(one.waits_for(worker) for one in under_way) for worker in self._workers}
            free = min(self._workers, key=lambda worker: (to_clean[worker], cleaned[worker]))
            cleaned[free] += 1
            under_way.append(self._begin(given, number, task.fuse, free))
            while len(under_way) > self._at_once:
                yield self._ended(under_way.popleft())
        while under_way:
            yield self._ended(under_way.popleft())
        self._busy = False

    def _begin(self, given: Any, number: int, fuse: bool, worker: str) -> "_UnderWay":
        """Have a scan cleaned by a worker; left to itself Dask would choose the one that has `given`."""
        looked = self._submit(_look, given, number, self._shares, workers=[worker])
        begun = _UnderWay(self._submit(itemgetter(0), looked, priority=_SUM_FIRST), worker)
        if fuse:
            for place, owner in enumerate(self._owners):
                part = self._submit(_part, looked, place, priority=_SUM_FIRST)
                told = {"workers": [owner], "priority": _SUM_FIRST}
                self._sums[place] = self._submit(_add, self._sums[place], part, self._summed, **told)
                begun.sums.append(self._sums[place])
            self._summed += 1
        return begun

    def _ended(self, begun: "_UnderWay") -> ScanReport:
        """Wait until a scan is summed, and return what is told of it; raises what went wrong."""
        every = [begun.report, *begun.sums]
        while any(not one.done() for one in every):
            with suppress(TimeoutError):
                wait(every, timeout=_LOOK_S)
            if not set(self._workers) <= set(self._client.scheduler_info(n_workers=-1)["workers"]):
                raise LostWorkError("a worker ended that had a share of the merge")
        for one in every:
            if one.status != "finished":
                one.result()
        return begun.report.result()

    def _submit(self, work: Any, *given: Any, **how: Any) -> Any:
        return self._client.submit(work, *given, pure=False, **how)

    @property
    def spills(self) -> int:
        """How often memory was emptied to the disk; 0 while scans are under way: asking would wait for them."""
        return 0 if self._busy or not self._summed else sum(self._of_each(attrgetter("spills")))

    def extent(self) -> Extent:
        """Return how far the merged cloud reaches."""
        first, *others = self._of_each(methodcaller("extent"))
        for other in others:
            first = first.joined(other)
        return first

    def pieces(self) -> Iterator[VoxelCloud]:
        """Give the merged cloud piece by piece, in the regions' order."""
        pieces = self._of_each(methodcaller("pieces"))
        every = sorted((piece, place) for place, own in enumerate(pieces) for piece in own)
        for piece, place in every:
            cloud_of = methodcaller("cloud_of", *piece)
            yield self._submit(cloud_of, self._sums[place], workers=[self._owners[place]]).result()

    def _of_each(self, ask: Any) -> list[Any]:
        asked = zip(self._sums, self._owners, strict=True)
        return self._client.gather([self._submit(ask, sums, workers=[owner]) for sums, owner in asked])


@dataclass
class _UnderWay:
    """A scan that is worked on: what will be told of it, and the sums that it goes into."""

    report: Any
    worker: str
    sums: list[Any] = field(default_factory=list[Any])

    def waits_for(self, worker: str) -> bool:
        """Return whether this worker has still to clean it."""
        return self.worker == worker and not self.report.done()


def _begin(options: MergeOptions, regions: Sequence[int]) -> RegionGrids:
    return RegionGrids(options, FileSpill(), regions)


def _look(
    given: tuple[SessionScans, ScanTask], number: int, shares: Sequence[Sequence[int]]
) -> tuple[ScanReport, list[dict[int, RegionPoints]]]:
    scans, task = given
    report, parts = look_at(number, scans[number], task)
    if not parts:
        return report, [{} for _ in shares]
    return report, [{region: parts[region] for region in share} for share in shares]


def _part(
    looked: tuple[ScanReport, list[dict[int, RegionPoints]]], place: int
) -> tuple[str, dict[int, RegionPoints]]:
    return looked[0].name, looked[1][place]


def _add(sums: RegionGrids, part: tuple[str, dict[int, RegionPoints]], scans_before: int) -> RegionGrids:
    if sums.scans != scans_before:  # what was lost is computed again from what has been added to meanwhile
        raise LostWorkError(f"{sums.scans} scans are summed, not {scans_before}")
    name, points = part
    sums.add(points, name)
    return sums
