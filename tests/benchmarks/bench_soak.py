"""Hours of mixed use of a server at a moderate rate: how its memory grows, and what is left open.

Memory that allocators and bounded caches keep for the next request grows less and less and then stays: by rounds
of use, about fifty, not by minutes.  What leaks grows with each round.  So in the first ten minutes the rounds
follow each other without a rest, which is the warm-up.  From then on the pace is moderate, and the line is fitted
to what is held at the end of each round, where no session is left; the slope of the second half beside it tells
whether it still fills or leaks.
"""

import json
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path

import httpx
import psutil
from harness import Row
from kill_server import ServerProcess
from soak_use import Use
from soak_watch import Sample, Watch, slope_mb_per_h

from calib_core.archive.archive import pack_files
from calib_core.simulation import simulate

_SHARE = 0.2
"""Of one core, that the server and its workers may use after the warm-up: between two things that are done it
rests for as long."""
_SCENES_CLOSE_S = 135.0
_FULL_S, _FIRST_S = 7200.0, 600.0
_SHORT_S, _SHORT_FIRST_S = 150.0, 50.0


def run(full: bool) -> Iterator[Row]:
    """Yield the figures: of two hours with `full`, else of minutes, whose slope means nothing."""
    seconds, first_s = (_FULL_S, _FIRST_S) if full else (_SHORT_S, _SHORT_FIRST_S)
    with tempfile.TemporaryDirectory(prefix="scancell-soak-") as folder:
        served = {"SCANCELL_WARM_UP": "true", "SCANCELL_WEBHOOKS_TO_THIS_MACHINE": "true"}
        server = ServerProcess(Path(folder) / "data", served).wait()
        try:
            watch = Watch(psutil.Process(server.process.pid))
            yield from soaked(server, watch, _small_cell(), seconds, first_s)
        finally:
            server.stop()


def soaked(server: ServerProcess, watch: Watch, archive: bytes, seconds: float, first_s: float) -> Iterator[Row]:
    """Yield the figures of so many seconds of use, of which the first `first_s` do not count."""
    pace = Pace(watch)
    use = Use(server.address, pace.rest, archive)
    _until_ready(server)
    use.many_at_once()
    warm_up = _rounds(use, watch, 0, first_s)
    begun = at_rest(watch)
    pace.begin()
    later = _rounds(use, watch, len(warm_up), seconds)
    share = pace.share()
    ended = at_rest(watch)
    number = len(warm_up) + len(later)
    told = f"{use.done.total()}, {number} in {watch.now_s() / 60:.0f} min, {len(warm_up)} of them to warm up"
    yield Row("mixed use: requests, rounds", "", told)
    yield Row("share of one core after the warm-up", "≤ 25 %", f"{100 * share:.0f} %", share <= 0.25)
    yield Row("not answered as it should be", "0", f"{len(use.wrong)}", not use.wrong)
    yield from memory_rows(later, first_s, seconds >= _FULL_S)
    left = ended - begun
    for what, count in left.items():
        print(f"    left open: {count} × {what}", flush=True)
    more = ended.total() - begun.total()
    what = f"files open at rest, beside those after {first_s / 60:.0f} min"
    yield Row(what, "≤ 0", f"{more:+d} of {ended.total()}", more <= 0)


def _rounds(use: Use, watch: Watch, number: int, until_s: float) -> list[Sample]:
    """Do rounds until then, the first by this number, and return what was held at the end of each."""
    samples: list[Sample] = []
    while watch.now_s() < until_s:
        use.round(number)
        number += 1
        time.sleep(1.0)
        samples.append(watch.take())
        _print(number, samples[-1])
    return samples


def memory_rows(samples: list[Sample], first_s: float, judged: bool) -> Iterator[Row]:
    """Yield how memory grew: of the server, which stays, and with its workers, which are warm by turns."""
    for who, workers in (("the server", False), ("server and workers", True)):
        slope, low, high = slope_mb_per_h(samples, workers)
        told = f"{slope:+.1f} ({low:+.1f} to {high:+.1f}) MB/h"
        what = f"memory of {who} after the first {first_s / 60:.0f} min"
        yield Row(what, "≤ 1 MB/h", told, slope <= 1.0 if judged else None)
    after, _, _ = slope_mb_per_h(samples[len(samples) // 2 :])
    peak_mb = max((sample.server_mb + sample.others_mb for sample in samples), default=float("nan"))
    yield Row("the same, its second half; most", "", f"{after:+.1f} MB/h; {peak_mb:.0f} MB")


def at_rest(watch: Watch) -> Counter[str]:
    """Return what is open once scenes that nobody looks at have been closed, and nothing is under way."""
    time.sleep(_SCENES_CLOSE_S)
    watch.take()
    return watch.open_now()


class Pace:
    """Keeps the server's share of a core moderate, once it has begun: rests between two things that are done."""

    def __init__(self, watch: Watch) -> None:
        self._watch = watch
        self._before_s: float | None = None
        self._begun_s = 0.0

    def begin(self) -> None:
        """Rest from now on."""
        self._before_s = self._watch.processor_s()
        self._begun_s = self._watch.now_s()

    def rest(self) -> None:
        """Wait until the processor time used since the beginning is the share that it may have."""
        if self._before_s is not None:
            wait_s = self._used_s() / _SHARE - (self._watch.now_s() - self._begun_s)
            time.sleep(min(max(0.02, wait_s), 20.0))

    def share(self) -> float:
        """Return the share of one core that was used since the beginning."""
        return self._used_s() / (self._watch.now_s() - self._begun_s)

    def _used_s(self) -> float:
        return self._watch.processor_s() - (self._before_s or 0.0)


def _until_ready(server: ServerProcess) -> None:
    while httpx.get(f"{server.address}/api/v1/health", trust_env=False).json()["status"] != "ready":
        time.sleep(0.2)


def _small_cell() -> bytes:
    """Return the archive of a whole cell of which few scans were taken."""
    cell = simulate("cell", 1)
    scans = [capture for capture in cell.session.captures if capture.step == "scan"]
    left_out = {capture.id for number, capture in enumerate(scans) if number % 4}
    session = cell.session.model_copy(
        update={"captures": [c for c in cell.session.captures if c.id not in left_out]}
    )
    out = BytesIO()
    files = {name: cell.files[name] for capture in session.captures for name in capture.files}
    pack_files(session, {"session.json": json.dumps(session.to_json()).encode(), **files}, out, "the cell")
    return out.getvalue()


def _print(number: int, sample: Sample) -> None:
    print(
        f"    {sample.at_s / 60:6.1f} min, round {number}: {sample.server_mb:.1f} + {sample.others_mb:.1f} MB, "
        f"{sample.files} files, {sample.threads} threads, {sample.processes} processes",
        flush=True,
    )
