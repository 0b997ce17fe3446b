"""What becomes of processes when faster kernels are there; takes a new folder for kernels, prints what was found.

A program of its own: it leaves what its processes are forked from.
"""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from calib_core.compiled import BASELINE, note_that_all_are_compiled
from server.jobs.child_processes import WorkerContext
from server.jobs.processes import Processes, replace_all

_tell: Callable[[object], None]


def begin(tell: Callable[[object], None]) -> None:
    global _tell
    _tell = tell


def compiled_for_whom() -> str | None:
    import_module("calib_core.kernels")  # sets numba up
    from numba.core import config

    return config.CPU_NAME  # pyright: ignore[reportAttributeAccessIssue]


def slowly(seconds: float) -> str:
    _tell("begun")
    time.sleep(seconds)
    return "done"


def main() -> None:
    """Ask one process for long; meanwhile replace all, and ask again."""
    from tests.server import replaced_processes as named  # as processes know it

    os.environ["NUMBA_CACHE_DIR"] = sys.argv[1]
    note_that_all_are_compiled(BASELINE)
    processes = Processes(2, WorkerContext(False), named.begin)
    begun, answers = threading.Event(), list[str]()

    def ask(seconds: float) -> None:
        begun.clear()
        try:
            answers.append(processes.ask(named.slowly, seconds, hear=lambda _: begun.set(), attempts=1))
        except Exception as error:
            answers.append(type(error).__name__)

    def ask_beside(seconds: float) -> tuple[threading.Thread, set[int]]:
        before = set(processes.pids)
        thread = threading.Thread(target=ask, args=(seconds,))
        thread.start()
        assert begun.wait(60)
        return thread, set(processes.pids) - before

    taken = [processes.ask(named.compiled_for_whom)]
    (waiting,) = processes.pids
    first, _ = ask_beside(4.0)
    second, (held,) = ask_beside(600.0)
    note_that_all_are_compiled()
    replace_all()
    first.join()
    taken.append(processes.ask(named.compiled_for_whom))
    kept = waiting in processes.pids
    processes.end(held)
    second.join()
    left = Path(f"/proc/{held}/cmdline")
    ended = not left.exists() or not left.read_bytes()
    processes.stop()
    print(json.dumps({"taken": taken, "answers": answers, "kept": kept, "ended": ended}))


if __name__ == "__main__":
    main()
