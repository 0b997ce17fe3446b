"""Where jobs are done: in processes of this server, or on a Dask cluster."""

import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor

from calib_core.errors import InputError
from calib_core.messages import message
from server.jobs import worker
from server.jobs.child_processes import WorkerContext
from server.jobs.pool import Listen, Pool
from server.jobs.processes import ProcessEndedError, Processes
from server.settings import Settings

_ATTEMPTS = 2  # of a job whose process ended before the job began


class ProcessPool(Pool):
    """Worker processes of this server."""

    def __init__(self, settings: Settings, listen: Listen) -> None:
        self._listen = listen
        self._context = WorkerContext(settings.warm_up)
        self._processes = Processes(settings.workers, self._context, worker.initialize, settings)
        self._threads = ThreadPoolExecutor(settings.workers, "job")

    def submit(self, work: Callable[[], worker.Solved]) -> "Future[worker.Solved]":
        """Have work done by whichever process is free."""
        return self._threads.submit(self._do, work)

    def get_ready(self) -> "Future[bool]":
        """Return what is done once a worker is warm; nobody waits for what the first ones are forked from."""
        ready: Future[bool] = Future()

        def start() -> None:
            try:
                self._context.load()
                ready.set_result(self._processes.ask(worker.ready))
            except Exception as error:  # the pool was closed meanwhile
                ready.set_exception(error)

        threading.Thread(target=start, daemon=True, name="first worker").start()
        return ready

    def end_worker(self, place: worker.Place) -> None:
        """End a worker, and what it does."""
        assert isinstance(place, int)
        self._processes.end(place)

    def is_broken_by(self, error: BaseException) -> bool:
        """Return whether a worker process ended."""
        return isinstance(error, ProcessEndedError)

    def close(self) -> None:
        """End all workers; what waits is called off."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._processes.stop()

    def _do(self, work: Callable[[], worker.Solved]) -> worker.Solved:
        begun = threading.Event()

        def hear(message: worker.Message) -> None:
            begun.set()
            self._listen(message)

        for _ in range(_ATTEMPTS):
            try:
                return self._processes.ask(work, hear=hear, attempts=1)
            except ProcessEndedError:
                if begun.is_set():
                    raise
        raise ProcessEndedError


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
        to_do = message(
            "Install it: pip install 'scancell[{extra}]'; or leave {setting} out.",
            extra="dask",
            setting="SCANCELL_DASK",
        )
        raise InputError("the extra '{extra}'", "none", to_do, "dask", extra="dask") from None
    return DaskPool(settings, listen)
