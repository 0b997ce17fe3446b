"""Solves that go wrong; a module of its own, for a worker process imports it to find the functions."""

import gc
import os
import resource
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from server.jobs import worker


def slow_solve(job_id: str, *_: Any) -> dict[str, Any]:
    progress = worker.started(job_id)
    progress(0.25, f"worker {os.getpid()}")
    time.sleep(60)
    raise AssertionError("nobody ended this")


def long_result(began: Path, size: int) -> bytes:
    """Return much, once a file says so."""
    result = bytes(size)
    began.touch()
    return result


def faulty_solve(job_id: str, *_: Any) -> dict[str, Any]:
    """Meet an error that nobody thought of."""
    worker.started(job_id)
    raise ZeroDivisionError("division by zero")


def ready_once_there(file: Path) -> bool:
    """Be warm once a file is there."""
    while not file.exists():
        time.sleep(0.01)
    return True


def solve_on_a_full_disk(*arguments: Any) -> worker.Solved:
    """Solve where no file may grow beyond a kilobyte, as on a disk that is full."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # else the process would end
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1024, before[1]))
    try:
        return worker.solve(*arguments)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def killed_while_telling(told: bytes) -> None:
    """Be killed as a worker that has sent so much of a message."""
    (connection,) = (one for one in gc.get_objects() if isinstance(one, Connection) and not one.closed)
    os.write(connection.fileno(), told)
    os.kill(os.getpid(), signal.SIGKILL)
