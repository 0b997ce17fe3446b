"""Compiling the kernels: what each part of the work needs, all of them, and whether all of them are there."""

import os
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from typing import Any, Final, Literal

from calib_core.compiled import (
    all_are_compiled,
    compile_for,
    note_that_all_are_compiled,
    on_compiling,
    own_are_compiled,
)
from server.jobs.child_processes import ignoring_interrupts

_OTHERS: Final = "16 bits, E57, depths"
_REGISTRATION: Final = "registration"
PARTS: Final = ("laser-plane", "tcp-mixed", "tcp-centers", "part", "ball", _REGISTRATION, _OTHERS, "frames-tcp")
"""Simulated sessions that run through the kernels of the stages, and what no simulated session needs.

Two processes that take them in this order compile hardly a kernel twice.
"""
OF_SCANS: Final = "part"
"""The part that has what merging scans needs, and little else."""


def begin_compiling(_: object, processor: Literal["own", "baseline"]) -> None:
    """Prepare a fresh process that has loaded none of the kernels."""
    compile_for(processor)


def compiled_for(part: str) -> int:
    """Run one part in this process; return how many kernels were compiled for it."""
    compiled: list[str] = []

    def count() -> None:
        compiled.append(part)

    on_compiling.append(count)
    try:
        if part == _OTHERS:
            _run_others()
        else:
            _solve(part)
    finally:
        on_compiling.remove(count)
    return len(compiled)


def _solve(part: str) -> None:
    from calib_core.simulation import simulate
    from calib_core.stages.pipeline import run

    simulated = simulate("part" if part == _REGISTRATION else part, 1)
    session = simulated.session
    if part == _REGISTRATION:
        merge = session.cell.merge.model_copy(update={"registration": True, "mesh": "none"})
        session = session.model_copy(update={"cell": session.cell.model_copy(update={"merge": merge})})
    run(session, simulated.files.__getitem__, "all", None, lambda _name, pieces: [*pieces])


def _run_others() -> None:
    """Find a stripe in a frame of 16 bits, write an E57, see through a lens by depth, put stored voxels together.

    Frames of 16 bits are as cameras send them, or as is left where a dark frame is taken off.
    """
    import numpy as np

    from calib_core.formats.shared.e57_writing import cloud_pieces
    from calib_core.formats.shared.writing import XYZ
    from calib_core.kernels.project import undistort_over_depth
    from calib_core.optics.camera_model import CameraModel
    from calib_core.optics.stripe import find_stripe

    rows = np.arange(240.0)[:, None] - np.linspace(110.0, 130.0, 320)
    find_stripe((2000 + 40_000 * np.exp(-0.5 * (rows / 2) ** 2)).astype(np.uint16))
    list(cloud_pieces([np.zeros((4, 3))], 4, XYZ))
    camera = CameraModel(np.diag([1000.0, 1000.0, 1.0]))
    undistort_over_depth(np.zeros((1, 2)), camera.rays_from_pixels, *camera.bands, np.zeros((1, 3)))


@contextmanager
def compiling_beside(part: str) -> Generator[None]:
    """Compile what a part needs in another process while something else is done, unless all kernels are there."""
    if all_are_compiled():
        yield
        return
    process = get_context("spawn").Process(target=compiled_for, args=(part,), daemon=True, name="kernels")
    with ignoring_interrupts():
        process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


def _compile_all() -> None:
    """Compile what is missing, after everything else that the machine has to do."""
    from server.jobs.processes import leave_interrupts_to_the_server
    from server.jobs.worker import end_with_the_server

    leave_interrupts_to_the_server()
    threading.Thread(target=end_with_the_server, daemon=True).start()
    if hasattr(os, "nice"):  # not on Windows
        os.nice(19)
    if own_are_compiled():
        return
    compile_for("own")
    for part in PARTS:
        compiled_for(part)
    note_that_all_are_compiled()


class KernelCompiler:
    """Compiles the kernels that are missing in a process of its own, at low priority, while the server serves."""

    def __init__(self) -> None:
        self._process: Any = None
        self._replaces = False

    @property
    def state(self) -> Literal["ready", "compiling"]:
        """Whether kernels are being compiled that are not there at all: what needs one takes seconds longer."""
        process = self._process
        return "compiling" if process is not None and process.is_alive() and not all_are_compiled() else "ready"

    def start(self) -> None:
        """Begin."""
        self._replaces = all_are_compiled() and not own_are_compiled()
        process = get_context("spawn").Process(target=_compile_all, daemon=True, name="kernels")
        with (
            suppress(OSError),
            ignoring_interrupts(),
        ):  # without it each kernel is compiled when it is needed first
            process.start()
            self._process = process

    def wait(self) -> bool:
        """Wait until all are there; return whether they take the place of such as were brought along."""
        if self._process is not None:
            self._process.join()
        return self._replaces and own_are_compiled()

    def stop(self) -> None:
        """End; what was compiled is kept."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
