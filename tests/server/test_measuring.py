"""Measuring in processes: whatever becomes of one, the capture is kept and the next one is measured."""

from collections.abc import Iterator

import pytest

from calib_core.errors import InputError
from calib_core.simulation import simulate
from server.jobs.measuring_processes import Measuring

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
    (process,) = measuring._all
    process._process.kill()
    process._process.join()
    assert measuring.measure(CELL.session, CAPTURE, CELL.files.__getitem__) == first
    (replaced,) = measuring._all
    assert replaced is not process


def test_what_takes_too_long_is_given_up_and_said(measuring: Measuring) -> None:
    measuring.warm_up()
    (process,) = measuring._all
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
    (process,) = measuring._all
    measuring.stop()
    assert not process._process.is_alive()
