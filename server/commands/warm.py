"""`scancell warm`: compiles the kernels, so that the first calibration does not wait for it."""

import argparse
import time

from server.console.command import OK, Command
from server.console.output import print_result
from server.console.progress import progress_bar

_SCENARIOS = ("tcp-mixed", "tcp-centers", "part", "ball", "frames-tcp")
"""Simulated sessions that run through every kernel of the stages, for frames of 8 bits."""


def _run(options: argparse.Namespace) -> int:
    """Solve simulated sessions; say how many kernels were compiled for it, and how long all took."""
    from calib_core.compiled import on_compiling
    from calib_core.simulation import simulate
    from calib_core.stages.pipeline import run

    started, compiled = time.monotonic(), 0

    def count() -> None:
        nonlocal compiled
        compiled += 1

    on_compiling.append(count)
    try:
        with progress_bar(options, says_why=False) as progress:
            for done, scenario in enumerate(_SCENARIOS):
                progress(done / len(_SCENARIOS), f"compiling the kernels, {compiled} done")
                session = simulate(scenario, 1)
                run(session.session, session.files.__getitem__, "all", None, lambda _name, pieces: [*pieces])
            _see_sixteen_bits()
    finally:
        on_compiling.remove(count)
    seconds = time.monotonic() - started
    text = f"{compiled} kernels compiled in {seconds:.0f} s" if compiled else "all kernels were compiled already"
    print_result(options, text, {"compiled": compiled, "seconds": round(seconds, 1)})
    return OK


def _see_sixteen_bits() -> None:
    """Find a stripe in a frame of 16 bits, as cameras send it or as is left where a dark frame is taken off."""
    import numpy as np

    from calib_core.optics.stripe import find_stripe

    rows = np.arange(240.0)[:, None] - np.linspace(110.0, 130.0, 320)
    find_stripe((2000 + 40_000 * np.exp(-0.5 * (rows / 2) ** 2)).astype(np.uint16))


COMMAND = Command("warm", "compile the kernels, so that no first run waits for it", "installation", run=_run)
