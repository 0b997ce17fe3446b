"""A job that is with workers."""

import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field

from server.jobs import worker
from server.jobs.pool import Pool
from server.store.models import Data


@dataclass
class Running:
    """A job that is with the executor."""

    pool: Pool
    future: Future[worker.Solved]
    solved_from: Data | None  # what a result is stored with; a replay leaves none
    session: Data
    results: Mapping[str, Data]
    place: worker.Place | None = None  # of its worker, once it has begun
    ended_by_us: bool = False  # the store knows why already
    timer: threading.Timer | None = field(default=None, repr=False)
    since_s: float = field(default_factory=time.monotonic)

    def kill(self) -> None:
        """End the worker that it runs in."""
        if self.place is not None and (self.future.cancelled() or not self.future.done()):
            self.pool.end_worker(self.place)


def apart(work: Callable[[], object]) -> None:
    """Do something in a thread of its own."""
    threading.Thread(target=work, daemon=True).start()
