"""A solve that takes a minute; a module of its own, for a worker process imports it to find the function."""

import os
import time
from typing import Any

from server import worker


def slow_solve(job_id: str, *_: Any) -> dict[str, Any]:
    assert worker._queue is not None
    worker._queue.put((job_id, "started", os.getpid()))
    worker._queue.put((job_id, "progress", (0.25, f"worker {os.getpid()}")))
    time.sleep(60)
    raise AssertionError("nobody ended this")
