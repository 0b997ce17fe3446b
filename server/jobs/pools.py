"""Where jobs are done: an executor of the standard library's kind, what its workers tell, and how one is ended."""

import logging
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from functools import partial
from pickle import UnpicklingError
from tempfile import TemporaryDirectory
from typing import Any

from calib_core.errors import InputError
from server.jobs import worker
from server.jobs.child_processes import WorkerContext
from server.jobs.pool import Listen, Pool
from server.jobs.results_by_file import result_from_file, result_to_file
from server.jobs.telling import telling
from server.settings import Settings

log = logging.getLogger("scancell")


class _Job(Future[worker.Solved]):
    """Takes its result from the worker's file.

    It stays cancelled when its pool breaks: the executor of Python 3.11 would trip over it, and not end.
    """

    def set_result(self, result: Any) -> None:
        try:
            solved = result_from_file(result)
        except (OSError, EOFError, UnpicklingError) as error:  # the pool was closed meanwhile
            self.set_exception(error)
        else:
            super().set_result(solved)

    def result(self, timeout: float | None = None) -> worker.Solved:
        found: Any = super().result(timeout)
        # Of work that ended before the executor's future was given this class, the file is still to be read.
        return result_from_file(found) if isinstance(found, str) else found

    def set_exception(self, exception: BaseException | None) -> None:
        with suppress(InvalidStateError):
            super().set_exception(exception)


class ProcessPool(Pool):
    """Worker processes of this server; one that ends takes the pool along."""

    ends_with_its_worker = True

    def __init__(self, settings: Settings, listen: Listen) -> None:
        self._context = WorkerContext(settings.warm_up)
        self._initialized: set[worker.Place] = set()
        self._closing = False
        self._results = TemporaryDirectory(prefix="scancell-results-", ignore_cleanup_errors=True)
        self._heard, self._teller = telling(self._context)
        self.executor = ProcessPoolExecutor(
            settings.workers,
            mp_context=self._context,
            initializer=worker.initialize,
            initargs=(self._teller, settings),
        )
        self._listener = threading.Thread(target=self._pass_on, args=(listen,), daemon=True, name="job progress")
        self._listener.start()

    def submit(self, work: Callable[[], worker.Solved]) -> "Future[worker.Solved]":
        """Have work done; raises BrokenProcessPool if a worker has ended."""
        future: Future[Any] = self.executor.submit(partial(result_to_file, self._results.name, work))
        future.__class__ = _Job
        return future

    def get_ready(self) -> "Future[bool]":
        """Return what is done once a worker is warm; nobody waits for what the first ones are forked from."""
        ready: Future[bool] = Future()

        def start() -> None:
            try:
                self._context.load()  # the executor would hold its lock for as long, and could not be closed
                ready.set_result(self.executor.submit(worker.ready).result())
            except Exception as error:  # the pool was closed meanwhile, or is broken
                ready.set_exception(error)

        threading.Thread(target=start, daemon=True, name="first worker").start()
        return ready

    def end_worker(self, place: worker.Place) -> None:
        """End a worker, and the pool with it."""
        assert isinstance(place, int)
        self.broken_on_purpose = True
        try:
            os.kill(place, signal.SIGTERM)
        except OSError:  # Windows tells it by another number than others
            log.info("worker %d has ended already", place)

    def is_broken_by(self, error: BaseException) -> bool:
        """Return whether a worker process ended."""
        return isinstance(error, BrokenProcessPool)

    def close(self) -> None:
        """Let go of the workers; those at work must be ended by `end_worker`.

        Those that still get ready have nothing to let go of, and would look for what is not there any more.
        """
        self._closing = True
        self.executor.shutdown(wait=False, cancel_futures=True)
        for process in self._context.started:
            if process.pid is not None and process.pid not in self._initialized:
                process.kill()
        self._teller.writer.close()  # what listens has heard all when no worker is left
        self._results.cleanup()

    def _next(self) -> worker.Message | None:
        """Return the next message, None at the end: also where a process that was killed then left half of one."""
        try:
            return self._heard.recv()
        except (EOFError, OSError, UnpicklingError):
            if not self._closing:
                raise
            return None

    def _pass_on(self, listen: Listen) -> None:
        while (message := self._next()) is not None:
            if message.kind == "initialized":
                self._initialized.add(message.value)
            else:
                listen(message)
        self._heard.close()


def open_pool(settings: Settings, listen: Listen) -> Pool:
    """Return the workers that the settings name: a Dask cluster's, or processes of this server.

    Raises
    ------
    InputError
        If there is no such cluster.
    """
    if settings.dask is None:
        return ProcessPool(settings, listen)
    try:
        from server.jobs.dask_pool import DaskPool
    except ModuleNotFoundError:
        to_do = "Install it: pip install 'scancell[dask]'; or leave SCANCELL_DASK out."
        raise InputError("the extra 'dask'", "an installation without it", to_do, "dask") from None
    return DaskPool(settings, listen)
