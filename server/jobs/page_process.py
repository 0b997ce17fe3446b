"""Where pages have computed what they ask for: a process of its own, so that the service stays free to answer.

What computes in the service's own process holds Python's lock, for which everything else that the service does
waits at each of its steps: fifty machines that send captures would feel the guide that one open page asks for.
"""

import logging
import os
import threading
import traceback
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, NamedTuple, TypeVar

from starlette.exceptions import HTTPException

from calib_core.errors import CalibrationError
from server.jobs.child_processes import WorkerContext
from server.jobs.request_process import AskedProcess, answer_questions, leave_interrupts_to_the_server

log = logging.getLogger("scancell")

Answer = TypeVar("Answer")

_TIMEOUT_S = 120.0  # the longest, the plan of a cell, takes two or three of a free core
_STOP_S = 2.0
_NICE = 5  # where all cores are taken, captures are answered and measured first
_ATTEMPTS = 2  # the process may have been ended for what it did not do


class PageProcessError(HTTPException):
    """What was asked has no answer now: the process ended, hung, or is being stopped."""

    def __init__(self, said: str) -> None:
        super().__init__(503, said)


class _Fault(NamedTuple):
    """An error of the program, as its trace."""

    trace: str


class PageProcess:
    """Answers one question after the other; the process starts with the first, and again after its end.

    Parameters
    ----------
    warm : bool
        Whether the process is forked from one that has loaded all that is needed.
    timeout_s : float
        What takes longer is given up.
    """

    def __init__(self, warm: bool = False, timeout_s: float = _TIMEOUT_S) -> None:
        self._context = WorkerContext(warm)
        self._timeout_s = timeout_s
        self._turn = threading.Lock()
        self._process: AskedProcess | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        """The number of the process, None before it is needed."""
        process = self._process
        return None if process is None else process.pid

    def ask(self, question: Callable[..., Answer], *given: object) -> Answer:
        """Return what a function returns there; it is sent by its name, what it takes and returns as it is.

        Raises
        ------
        CalibrationError
            What the function says.
        PageProcessError
            If the process ends twice, takes too long, or is stopped.
        """
        with self._turn:
            answer = self._answered((question, given))
        if isinstance(answer, CalibrationError):
            raise answer
        if isinstance(answer, _Fault):
            raise RuntimeError(answer.trace)
        return answer

    def stop(self) -> None:
        """End the process at once; who waits for it is told."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()
        if self._turn.acquire(timeout=_STOP_S):  # one that still starts is ended once it has
            try:
                if self._process is not None:
                    self._process.end()
            finally:
                self._turn.release()

    def _answered(self, work: object) -> Any:
        for _ in range(_ATTEMPTS):
            process = self._running()
            try:
                return process.ask(work, self._timeout_s)
            except TimeoutError:
                raise PageProcessError(f"what was asked took longer than {self._timeout_s:g} s") from None
            except (EOFError, OSError):
                if self._closed:
                    break
                log.warning("the process that answers pages ended")
        raise PageProcessError("the process that works this out ended")

    def _running(self) -> AskedProcess:
        process = self._process
        if process is None or not process.usable:
            if process is not None:
                process.end()
            if self._closed:
                raise PageProcessError("the server stops")
            process = self._process = AskedProcess(self._context, _serve)
            if self._closed:
                process.end()
        return process


def _serve(connection: "Connection[Any, Any]") -> None:
    leave_interrupts_to_the_server()
    if hasattr(os, "nice"):  # not on Windows
        os.nice(_NICE)
    answer_questions(connection, _answer)


def _answer(work: tuple[Callable[..., object], tuple[object, ...]]) -> object:
    question, given = work
    try:
        return question(*given)
    except CalibrationError as error:
        return error
    except Exception:
        return _Fault(traceback.format_exc())
