"""`scancell warm`: compiles the kernels, so that the first calibration does not wait for it."""

import argparse
import os
import time

from server.console.command import OK, Command
from server.console.output import print_result
from server.console.progress import progress_bar

_SIXTEEN_BITS = "16 bits"
_PARTS = ("laser-plane", "tcp-mixed", "tcp-centers", "part", "ball", _SIXTEEN_BITS, "frames-tcp")
"""Simulated sessions that run through every kernel of the stages, for frames of 8 bits, and a frame of 16 bits.

Two processes that take them in this order compile hardly a kernel twice.
"""


def _run(options: argparse.Namespace) -> int:
    """Solve simulated sessions; say how many kernels were compiled for it, and how long all took."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed

    started, compiled = time.monotonic(), 0
    processes = ProcessPoolExecutor(min(2, os.cpu_count() or 1), multiprocessing.get_context("spawn"))
    with progress_bar(options, says_why=False) as progress, processes:
        progress(0.0, "compiling the kernels")
        parts = as_completed([processes.submit(_compiled_for, part) for part in _PARTS])
        for done, part in enumerate(parts, 1):
            compiled += part.result()
            progress(done / len(_PARTS), f"compiling the kernels, {compiled} done")
    seconds = time.monotonic() - started
    text = f"{compiled} kernels compiled in {seconds:.0f} s" if compiled else "all kernels were compiled already"
    print_result(options, text, {"compiled": compiled, "seconds": round(seconds, 1)})
    return OK


def _compiled_for(part: str) -> int:
    """Run one part in this process; return how many kernels were compiled for it."""
    from calib_core.compiled import on_compiling
    from calib_core.simulation import simulate
    from calib_core.stages.pipeline import run

    compiled: list[str] = []

    def count() -> None:
        compiled.append(part)

    on_compiling.append(count)
    try:
        if part == _SIXTEEN_BITS:
            _see_sixteen_bits()
        else:
            session = simulate(part, 1)
            run(session.session, session.files.__getitem__, "all", None, lambda _name, pieces: [*pieces])
    finally:
        on_compiling.remove(count)
    return len(compiled)


def _see_sixteen_bits() -> None:
    """Find a stripe in a frame of 16 bits, as cameras send it or as is left where a dark frame is taken off."""
    import numpy as np

    from calib_core.optics.stripe import find_stripe

    rows = np.arange(240.0)[:, None] - np.linspace(110.0, 130.0, 320)
    find_stripe((2000 + 40_000 * np.exp(-0.5 * (rows / 2) ** 2)).astype(np.uint16))


COMMAND = Command("warm", "compile the kernels, so that no first run waits for it", "installation", run=_run)
