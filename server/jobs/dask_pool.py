"""Jobs on a Dask cluster: the same work, told about in a topic of its scheduler.

The workers need this version of scancell, and must reach the blobs as this server does: in an S3 store, or in a
folder that all machines have in the same place. One thread a worker, watched by a nanny: ending a job restarts it.
"""

import logging
import math
import pickle
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from queue import SimpleQueue
from secrets import token_hex
from threading import Thread
from time import monotonic
from typing import Any

from distributed import Client, KilledWorker

from calib_core.errors import InputError
from calib_core.messages import message
from server.jobs import worker
from server.jobs.dask_crew import LostWorkError, dask_crew
from server.jobs.pool import Listen, Pool
from server.settings import Settings

log = logging.getLogger("scancell")
_CONNECT_S = 10.0
_RESTART_S = 30.0
_RECONNECTS_S, _ANSWERS_S = 8.0, 4.0
_LEAVING_S = 5.0
"""How long the pool's end waits until nannies have heard which workers to end; it does not wait for new ones."""


class DaskPool(Pool):
    """A cluster that somebody else started, at an address like ``tcp://host:8786``."""

    def __init__(self, settings: Settings, listen: Listen) -> None:
        try:
            self._client = Client(settings.dask, timeout=_CONNECT_S, set_as_default=False, name="scancell")
        except (OSError, TimeoutError, ValueError) as error:
            got, to_do = (
                message("none there ({error})", error=error),
                message("Start it, or correct SCANCELL_DASK; leave it out to solve here."),
            )
            raise InputError("a Dask scheduler", got, to_do, str(settings.dask)) from None
        self._settings = settings
        self._cluster = self._client.scheduler_info()["id"]
        self._topic = f"scancell-{token_hex(8)}"
        self._told: SimpleQueue[worker.Message | None] = SimpleQueue()
        self._restarts: list[Thread] = []
        self._away_since_s = math.inf
        self._known: dict[str, Any] | None = None
        self._client.subscribe_topic(self._topic, self._hear)
        self.executor = self._client.get_executor(pure=False)
        # The client's own thread must not wait for the store.
        Thread(target=self._pass_on, args=(listen,), daemon=True, name="job progress").start()

    def submit(self, work: Callable[[], worker.Solved]) -> "Future[worker.Solved]":
        """Have work done by whichever worker is free."""
        return self.executor.submit(_work, self._settings, self._topic, work)

    def submit_measuring(self, work: Callable[[], str]) -> "Future[str] | None":
        """Have a capture measured by whichever worker is free, None while there is none."""
        return self.executor.submit(_work, self._settings, self._topic, work) if self.trouble() is None else None

    def get_ready(self) -> "Future[bool]":
        """Return what is done once a worker is there."""
        return self.executor.submit(worker.ready)

    def end_worker(self, place: worker.Place) -> None:
        """Have a worker's nanny replace it; other jobs that waited for it go to others."""
        restart = Thread(target=self._restart, args=(str(place),), daemon=True)
        restart.start()
        self._restarts = [thread for thread in self._restarts if thread.is_alive()] + [restart]

    def is_broken_by(self, error: BaseException) -> bool:
        """Return whether a worker ended, or the cluster went away."""
        return isinstance(error, (KilledWorker, CancelledError, LostWorkError))

    def trouble(self) -> str | None:
        """Return in words why no job can be done now, None where they can."""
        known = None if self.is_gone() else self._known
        if known is None:
            return f"the Dask scheduler at {self._settings.dask} does not answer"
        return None if known["workers"] else "the Dask cluster has no worker"

    @property
    def is_elsewhere(self) -> bool:
        """Always: somebody else starts and ends the workers."""
        return True

    def takes_jobs(self) -> bool:
        """Ask the scheduler whether it is there."""
        return not self.is_gone() and self._known is not None

    def is_gone(self) -> bool:
        """Ask whether the client has given up, or found another scheduler, which was told nothing.

        A client that met a scheduler amid its start may try for a minute: a new one is sooner.
        """
        self._known = self._asked() if self._client.status == "running" else None
        if self._known is not None:
            self._away_since_s = math.inf
            return self._known["id"] != self._cluster
        self._away_since_s = min(self._away_since_s, monotonic())
        return self._client.status in ("closing", "closed") or monotonic() - self._away_since_s > _RECONNECTS_S

    def _asked(self) -> dict[str, Any] | None:
        """Return what the scheduler says of itself, None where it does not soon: a client would wait."""
        scheduler: Any = self._client.scheduler
        try:
            told: Any = self._client.sync(scheduler.identity, n_workers=1, callback_timeout=_ANSWERS_S)
        except (TimeoutError, OSError):
            return None
        return told

    def close(self) -> None:
        """Leave the cluster; it goes on without."""
        for restart in self._restarts:
            restart.join(timeout=_LEAVING_S)
        self._told.put(None)
        self._client.close(timeout=5)

    def _hear(self, event: tuple[float, bytes]) -> None:
        self._told.put(pickle.loads(event[1]))

    def _pass_on(self, listen: Listen) -> None:
        while (message := self._told.get()) is not None:
            listen(message)

    def _restart(self, place: str) -> None:
        scheduler: Any = self._client.scheduler
        try:
            # Not the client's own method: it waits until the new worker is there.
            self._client.sync(
                scheduler.restart_workers,
                workers=[place],
                timeout=_RESTART_S,
                wait_for_workers=False,
                on_error="return",
                stimulus_id=f"scancell-{token_hex(4)}",
            )
        except Exception:  # it has gone by itself, or has no nanny
            log.exception("worker %s could not be restarted", place)


def _work(settings: Settings, topic: str, work: Callable[[], Any]) -> Any:
    """Do a job on a worker of the cluster."""
    from distributed import get_worker

    here: Any = get_worker()
    worker.begin(settings, here.address, lambda message: here.log_event(topic, pickle.dumps(message)), dask_crew)
    return work()
