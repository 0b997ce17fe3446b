"""Processes that the server starts, and that leave it to the server when they end."""

import signal
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any


@contextmanager
def ignoring_interrupts() -> Generator[None]:
    """Let processes that are started meanwhile not hear Ctrl-C, which a terminal sends to every one of them.

    They may ignore it themselves only once they run: by then it may have ended them in the middle of an import.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    resource_tracker.ensure_running()  # were it started in between, it would let the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class WorkerContext(SpawnContext):
    """How an executor starts its processes: not hearing Ctrl-C, and `started` knows each of them."""

    def __init__(self) -> None:
        super().__init__()
        self.started: list[SpawnProcess] = []

    # The library has a class under this name, and calls it.
    def Process(  # noqa: N802 # pyright: ignore[reportIncompatibleVariableOverride]
        self, *args: Any, **named: Any
    ) -> SpawnProcess:
        """Return a process to be started."""
        process = _UninterruptedProcess(*args, **named)
        self.started.append(process)
        return process


class _UninterruptedProcess(SpawnProcess):
    def start(self) -> None:
        with ignoring_interrupts():
            super().start()
