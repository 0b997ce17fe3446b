"""What a server and its processes hold: memory and open files from time to time, and how memory grows."""

import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

_GONE = (psutil.NoSuchProcess, psutil.AccessDenied, ProcessLookupError, FileNotFoundError)


@dataclass(frozen=True)
class Sample:
    """What is held at a moment, `server` by its first process alone, the others by all of its children.

    Attributes
    ----------
    at_s : float
        Since the watch began.
    server_mb, others_mb : float
        Memory, where the system tells: what they hold for themselves, and the files they have mapped (libraries,
        databases) in whole. What processes forked from one share is divided among them. Mapped files are not: the
        share of a library that the system tells hangs on which other programs on the machine use it, and a server
        at rest was told 30 MB more whenever a test suite beside it ended.
    files, threads, processes : int
        Open descriptors and threads of all of them, and how many they are.
    """

    at_s: float
    server_mb: float
    others_mb: float
    files: int
    threads: int
    processes: int


@dataclass
class Watch:
    """Notes what a process and its children hold."""

    process: psutil.Process
    samples: list[Sample] = field(default_factory=list[Sample])
    _begun_s: float = field(default_factory=time.monotonic)
    _end: threading.Event = field(default_factory=threading.Event)

    def now_s(self) -> float:
        """Return the seconds since the watch began."""
        return time.monotonic() - self._begun_s

    def take(self) -> Sample:
        """Note what is held now."""
        memory, files, threads = [0.0, 0.0], 0, 0
        family = list(self._family())
        for process in family:
            with suppress(*_GONE):
                memory[process.pid != self.process.pid] += _memory_mb(process)
                files += process.num_fds() if psutil.POSIX else len(process.open_files())
                threads += process.num_threads()
        sample = Sample(self.now_s(), *memory, files, threads, len(family))
        self.samples.append(sample)
        return sample

    def open_now(self) -> Counter[str]:
        """Return how many descriptors are open, by process and what they lead to."""
        found = Counter[str]()
        for process in self._family():
            who = "server" if process.pid == self.process.pid else process.name()
            with suppress(*_GONE):
                for link in Path(f"/proc/{process.pid}/fd").glob("*"):
                    with suppress(OSError):
                        found[f"{who}: {_kind(str(link.readlink()))}"] += 1
        return found

    def processor_s(self) -> float:
        """Return what the processes have used, those that have ended too."""
        used_s = 0.0
        for process in self._family():
            with suppress(*_GONE):
                times = process.cpu_times()
                used_s += times.user + times.system + times.children_user + times.children_system
        return used_s

    def _family(self) -> Iterator[psutil.Process]:
        yield self.process
        with suppress(*_GONE):
            yield from self.process.children(recursive=True)


def _memory_mb(process: psutil.Process) -> float:
    with suppress(OSError, KeyError):
        lines = (line.split() for line in Path(f"/proc/{process.pid}/smaps_rollup").read_text().splitlines()[1:])
        held_kb = {line[0]: int(line[1]) for line in lines}
        mapped_kb = held_kb["Rss:"] - held_kb["Anonymous:"]
        return (held_kb["Pss_Anon:"] + mapped_kb) * 1024 / 1e6
    return process.memory_info().rss / 1e6


def _kind(target: str) -> str:
    """Return what a descriptor leads to, without what differs from one to the next."""
    if target.startswith(("socket:", "pipe:", "anon_inode:")):
        return target.partition("[")[0].rstrip(":")
    path = Path(target)
    if path.parent == Path("/dev"):
        return target
    return path.name if path.suffix.startswith((".db", ".sqlite")) else str(path.parent)


def slope_mb_per_h(samples: list[Sample], workers: bool = True) -> tuple[float, float, float]:
    """Return how fast memory grows, and the ends of its 95 % interval: Theil's and Sen's line.

    Of the server and its `workers`, or of the server alone.

    The median of the slopes of all pairs: neither a solve under way nor a worker that was replaced moves it.  The
    interval is Kendall's (Hollander and Wolfe, Nonparametric Statistical Methods, 9.3).
    """
    at_h = np.array([sample.at_s for sample in samples]) / 3600
    held_mb = np.array([sample.server_mb + workers * sample.others_mb for sample in samples])
    if len(at_h) < 3:
        return float("nan"), float("nan"), float("nan")
    first, second = np.triu_indices(len(at_h), 1)
    slopes = np.sort((held_mb[second] - held_mb[first]) / (at_h[second] - at_h[first]))
    count = len(at_h)
    apart = 1.96 * np.sqrt(count * (count - 1) * (2 * count + 5) / 18)
    low, high = (int(np.clip((len(slopes) + sign * apart) / 2, 0, len(slopes) - 1)) for sign in (-1, 1))
    return float(np.median(slopes)), float(slopes[low]), float(slopes[high])
