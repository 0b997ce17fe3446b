"""`scancell warm`: compiles the kernels, so that the first calibration does not wait for it."""

import argparse
import os
import time

from calib_core.messages import message
from server.console.command import OK, Command
from server.console.output import print_result
from server.console.progress import progress_bar


def _run(options: argparse.Namespace) -> int:
    """Solve simulated sessions; say how many kernels were compiled for it, and how long all took."""
    from concurrent.futures import ThreadPoolExecutor, as_completed

    from calib_core.compiled import BASELINE, note_that_all_are_compiled
    from server.jobs.child_processes import WorkerContext
    from server.jobs.kernels import PARTS, begin_compiling, compiled_for
    from server.jobs.processes import Processes

    started, compiled = time.monotonic(), 0
    processor = "baseline" if options.any_processor else "own"
    count = min(2, os.cpu_count() or 1)
    processes = Processes(count, WorkerContext(None), begin_compiling, processor)
    threads = ThreadPoolExecutor(count)
    try:
        with progress_bar(options, says_why=False) as progress:
            progress(0.0, message("compiling the kernels"))
            parts = as_completed([threads.submit(processes.ask, compiled_for, part) for part in PARTS])
            for done, part in enumerate(parts, 1):
                compiled += part.result()
                progress(done / len(PARTS), message("compiling the kernels, {count} done", count=compiled))
    finally:
        threads.shutdown(wait=False, cancel_futures=True)
        processes.stop()
    note_that_all_are_compiled(BASELINE if options.any_processor else None)
    seconds = time.monotonic() - started
    text = message("all kernels were compiled already")
    if compiled:
        text = message("{count} kernels compiled in {seconds:.0f} s", count=compiled, seconds=seconds)
    print_result(options, text, {"compiled": compiled, "seconds": round(seconds, 1)})
    return OK


def _arguments(parser: argparse.ArgumentParser) -> None:
    why = "for any x86-64 processor since 2015, to bring along with an image, a wheel or a portable folder"
    parser.add_argument("--any-processor", action="store_true", help=why)


COMMAND = Command(
    "warm", "compile the kernels, so that no first run waits for it", "installation", _arguments, run=_run
)
