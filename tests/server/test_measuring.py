"""Measuring in processes: whatever becomes of one, the capture is kept and the next one is measured."""

import time
from collections.abc import Iterator

import pytest

from calib_core.compiled import on_compiling
from calib_core.errors import InputError
from calib_core.simulation import simulate
from server.jobs.child_processes import WorkerContext
from server.jobs.measuring_processes import Measuring
from server.jobs.processes import Processes

CELL = simulate("tcp", 7)
CAPTURE = CELL.session.captures[0]


@pytest.fixture
def measuring() -> Iterator[Measuring]:
    processes = Measuring(1, timeout_s=60)
    yield processes
    processes.stop()


def test_a_process_that_was_killed_is_replaced(measuring: Measuring) -> None:
    first = measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__)
    assert first.verdict == "pass", first
    (process,) = measuring._processes._all
    process._process.kill()
    process._process.join()
    assert measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__) == first
    (replaced,) = measuring._processes._all
    assert replaced is not process


def test_what_takes_too_long_is_given_up_and_said(measuring: Measuring) -> None:
    measuring.warm_up()
    (process,) = measuring._processes._all
    measuring._timeout_s = 1e-4  # no profile is measured in that time
    late = measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__)
    assert late.verdict == "fail"
    assert "0.0001 s" in (late.reason or "")
    assert not process._process.is_alive()
    measuring._timeout_s = 60
    assert measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__).verdict == "pass"


def test_files_of_no_use_are_refused_as_ever(measuring: Measuring) -> None:
    with pytest.raises(InputError, match=r"p01\.csv"):
        measuring.measure(CELL.session, CAPTURE, lambda _: b"\0\0\0")
    assert measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__).verdict == "pass"


def test_stopped_processes_are_gone(measuring: Measuring) -> None:
    measuring.warm_up()
    (process,) = measuring._processes._all
    measuring.stop()
    assert not process._process.is_alive()


def nothing(_: object) -> None:
    pass


def compiles_first(silent: bool) -> str:
    if not silent:
        for told in on_compiling:
            told()
    time.sleep(1.0)
    return "done"


@pytest.mark.thorough
@pytest.mark.parametrize("silent", [False, True])
def test_the_time_to_compile_does_not_count(silent: bool) -> None:
    """A first frame on a new machine was kept unmeasured: its kernels took longer than a capture may."""
    processes = Processes(1, WorkerContext(False), nothing)
    try:
        if silent:
            with pytest.raises(TimeoutError):
                processes.ask(compiles_first, silent, timeout_s=0.2)
        else:
            assert processes.ask(compiles_first, silent, timeout_s=0.2) == "done"
    finally:
        processes.stop()
