"""What runs in a worker process: one solve at a time, told about in a queue."""

import logging
import os
import signal
import threading
import time
from collections.abc import Mapping
from multiprocessing import parent_process
from multiprocessing.queues import Queue
from pathlib import Path
from typing import Any

# (job, "started", process id) and (job, "progress", (fraction, message))
Message = tuple[str, str, Any]

log = logging.getLogger("scancell")

_REPORT_EVERY_S = 0.2
_queue: "Queue[Message | None] | None" = None


def initialize(queue: "Queue[Message | None]", warm: bool) -> None:
    """Prepare a fresh worker process."""
    global _queue
    _queue = queue
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server decides when its workers end
    threading.Thread(target=_end_with_the_server, daemon=True).start()
    if warm:
        try:
            warm_up()
        except Exception:  # the solve itself will meet the fault again and say so
            log.exception("a worker could not be warmed up")


def _end_with_the_server() -> None:
    server = parent_process()
    if server is not None:
        server.join()
        os._exit(1)


def warm_up() -> None:
    """Import and compile what a solve needs, by solving a small simulated session."""
    from calib_core.session.pipeline import solve_stage
    from calib_core.simulation import simulate

    simulated = simulate("tcp", 1)
    solve_stage(simulated.session, "tcp", simulated.files.__getitem__)


def ready() -> bool:
    """Return that this process has been initialized."""
    return True


def solve(job_id: str, session: Mapping[str, Any], stage: str, paths: Mapping[str, str]) -> dict[str, Any]:
    """Solve a stage of a session, files given by their paths; returns the result as JSON data.

    Raises
    ------
    CalibrationError
        What the stage's solver says.
    """
    assert _queue is not None
    queue = _queue
    queue.put((job_id, "started", os.getpid()))
    from calib_core.records import parse_session
    from calib_core.session.pipeline import solve_stage
    from server.strict_json import plain_json

    told_s = 0.0

    def progress(fraction: float, message: str) -> None:
        nonlocal told_s
        if time.monotonic() - told_s > _REPORT_EVERY_S:
            told_s = time.monotonic()
            queue.put((job_id, "progress", (float(fraction), message)))

    def read(name: str) -> bytes:
        return Path(paths[name]).read_bytes()

    result = solve_stage(parse_session(session), stage, read, progress)
    return plain_json(result)
