"""Processes that the server starts, and that leave it to the server when they end.

Where the system can, they are forked from one that has imported and loaded what they need: a worker is ready in a
tenth of a second then, also the one that takes the place of a cancelled job's.
"""

import os
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from typing import Any

if sys.platform == "win32":
    from multiprocessing.context import SpawnContext as _Context
    from multiprocessing.context import SpawnProcess as _Process
else:
    from multiprocessing.context import ForkServerContext as _Context
    from multiprocessing.context import ForkServerProcess as _Process


_starting = threading.Lock()
"""Held while a process is started, or what processes are forked from is left."""
_times_loaded = 0


def times_loaded() -> int:
    """Return how often processes were made to load everything anew: those of an earlier count are outdated."""
    return _times_loaded


def load_anew() -> int | None:
    """Have processes that start from now on load everything anew, as kernels that were compiled meanwhile.

    Return the number of what the earlier ones were forked from, if any: it ends after the last of them.
    """
    global _times_loaded
    with _starting:
        _times_loaded += 1
        if sys.platform == "win32":
            return None
        from multiprocessing import forkserver

        server: Any = forkserver._forkserver  # pyright: ignore[reportAttributeAccessIssue, reportPrivateUsage]
        pid: int | None = server._forkserver_pid
        if pid is not None:  # forgotten, as the library forgets one that has died; killed, it could end no process
            os.close(server._forkserver_alive_fd)
            server._forkserver_address = server._forkserver_alive_fd = server._forkserver_pid = None
        return pid


@contextmanager
def ignoring_interrupts() -> Generator[None]:
    """Let processes that are started meanwhile not hear Ctrl-C, which a terminal sends to every one of them.

    They may ignore it themselves only once they run: by then it may have ended them in the middle of an import.
    """
    if not hasattr(signal, "pthread_sigmask"):
        with _ignored_by_the_console():
            yield
        return
    resource_tracker.ensure_running()  # were it started in between, it would let the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _ignored_by_the_console() -> Generator[None]:
    """Have Windows send no Ctrl-C to this process, nor ever to those that it starts meanwhile."""
    import ctypes

    tell = ctypes.WinDLL("kernel32", use_last_error=True).SetConsoleCtrlHandler  # pyright: ignore
    tell(None, True)
    try:
        yield
    finally:
        tell(None, False)


class WorkerContext(_Context):
    """How processes are started: not hearing Ctrl-C, and `started` knows each of them.

    Parameters
    ----------
    warm : bool or None
        Whether what they are forked from loads all that a solve needs, and not only what measuring needs; None
        where it loads nothing.
    """

    def __init__(self, warm: bool | None) -> None:
        super().__init__()
        self.started: list[_Process] = []
        if sys.platform != "win32":
            self.set_forkserver_preload(_preloaded(warm))

    # The library has a class under this name, and calls it.
    def Process(  # noqa: N802 # pyright: ignore[reportIncompatibleVariableOverride]
        self, *args: Any, **named: Any
    ) -> _Process:
        """Return a process to be started."""
        process = _UninterruptedProcess(*args, **named)
        self.started.append(process)
        return process

    def load(self) -> None:
        """Wait until what processes are forked from has loaded; who starts one before that waits for it."""
        if sys.platform != "win32":
            process = self.Process(target=int)  # does nothing
            process.start()
            process.join()


def _preloaded(warm: bool | None) -> list[str]:
    if warm is None:
        return []
    return ["server.jobs.measuring_processes", *(["server.jobs.preloaded"] if warm else [])]


def begin_loading(warm: bool) -> None:
    """Start what processes are forked from, which loads beside this process; see `WorkerContext` for `warm`."""
    if sys.platform != "win32":
        from multiprocessing import forkserver

        forkserver.set_forkserver_preload(_preloaded(warm))
        with ignoring_interrupts():
            forkserver.ensure_running()


def end_loading() -> None:
    """End at once what processes are forked from, for a program that ends: it may still load."""
    if sys.platform != "win32":
        from multiprocessing import forkserver

        pid: int | None = getattr(forkserver._forkserver, "_forkserver_pid", None)  # pyright: ignore[reportAttributeAccessIssue, reportPrivateUsage]
        if pid is not None:
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)


class _UninterruptedProcess(_Process):
    def start(self) -> None:
        with _starting, ignoring_interrupts():
            super().start()
