"""Processes in which captures are measured as they arrive.

The service itself stays free to answer meanwhile, and a file that makes a library crash, hang or take all memory
costs one process, not the service.
"""

import logging
import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from calib_core.archive.observation_store import KeptObservations
from calib_core.captures.observation_cache import Keeper, keeping
from calib_core.errors import CalibrationError
from calib_core.records import Capture, Measured, Session, parse_capture, parse_session
from server.jobs.child_processes import WorkerContext
from server.jobs.request_process import AskedProcess, answer_questions, leave_interrupts_to_the_server
from server.measuring import check_poses, measured_with_text, unmeasured, warm_up
from server.store.json_text import JsonText

log = logging.getLogger("scancell")

_ATTEMPTS = 2  # a process may have been ended for what it did not do


class Measuring:
    """Measures captures in processes of its own, which start when they are needed first.

    Parameters
    ----------
    processes : int
        How many captures at once.
    timeout_s : float
        What takes longer is given up; the capture is kept all the same.
    warm : bool
        Whether what solves need is loaded along.
    observations : Path, optional
        The folder that keeps what was seen.
    """

    def __init__(
        self, processes: int, timeout_s: float, warm: bool = False, observations: Path | None = None
    ) -> None:
        self._observations = observations
        self._timeout_s = timeout_s
        self._context = WorkerContext(warm)
        self._turns = threading.BoundedSemaphore(processes)
        self._idle: list[AskedProcess] = []
        self._all: set[AskedProcess] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._threads = ThreadPoolExecutor(processes, "measuring")

    def measure(self, session: Session, capture: Capture, read: Callable[[str], bytes]) -> Measured:
        """Return what was measured; where nothing could be, the verdict `fail` and why: the capture is kept.

        Raises
        ------
        InputError, TooLargeError
            If the record or a file is of no use at all.
        """
        cell = session.model_copy(update={"captures": []}).to_json()
        contents = {name: read(name) for name in capture.files}
        return Measured.model_validate_json(self.measured_text(cell, capture, contents))

    def submit(self, cell: dict[str, Any], capture: Capture, contents: Mapping[str, bytes]) -> Future[JsonText]:
        """Return what `measure` will have returned, as JSON text.

        Parameters
        ----------
        cell : dict
            The session's record without captures.
        capture : Capture
        contents : mapping of str to bytes
            Its files, by name.
        """
        return self._threads.submit(self.measured_text, cell, capture, contents)

    def measured_text(self, cell: dict[str, Any], capture: Capture, contents: Mapping[str, bytes]) -> JsonText:
        """Return what `submit` promises, in this thread."""
        work = (cell, capture.to_json(), contents)
        for _ in range(_ATTEMPTS):
            process = self._take()
            try:
                answer = process.ask(work, self._timeout_s)
            except TimeoutError:
                got = f"measuring it took longer than {self._timeout_s:g} s"
                to_do = "The capture is kept; send less at once: thin or crop it."
                return _text_of(unmeasured(capture, got, to_do))
            except (EOFError, OSError):
                log.warning("the process that measured capture %s ended", capture.id)
                continue
            finally:
                self._give_back(process)
            if isinstance(answer, CalibrationError):
                raise answer
            return JsonText(answer)
        got = "the process that measured it ended (a library failed, or memory ran out)"
        return _text_of(unmeasured(capture, got, "The capture is kept; report this with its file."))

    def warm_up(self) -> None:
        """Have one process ready, unless all is ended meanwhile."""
        try:
            self._give_back(self._take())
        except (EOFError, OSError):
            if not self._closed:
                raise

    def stop(self) -> None:
        """End all processes."""
        with self._lock:
            self._closed = True
            self._threads.shutdown(wait=False, cancel_futures=True)
            processes, self._all = self._all, set()
            self._idle.clear()
        for process in processes:
            process.end()

    def _take(self) -> AskedProcess:
        self._turns.acquire()
        try:
            with self._lock:
                if self._idle:
                    return self._idle.pop()
            process = AskedProcess(self._context, _serve, self._observations)
            with self._lock:
                self._all.add(process)
            if self._closed:
                self._drop(process)
            return process
        except BaseException:
            self._turns.release()
            raise

    def _give_back(self, process: AskedProcess) -> None:
        if process.usable and not self._closed:
            with self._lock:
                self._idle.append(process)
        else:
            self._drop(process)
        self._turns.release()

    def _drop(self, process: AskedProcess) -> None:
        with self._lock:
            self._all.discard(process)
        process.end()


def _text_of(measured: Measured) -> JsonText:
    return JsonText(measured.model_dump_json(exclude_unset=True))


def _serve(connection: "Connection[Any, Any]", observations: Path | None) -> None:
    """Measure what comes until the service hangs up."""
    leave_interrupts_to_the_server()
    try:
        warm_up()
    except Exception:  # the capture itself will meet the fault again and say so
        log.exception("a measuring process could not be warmed up")
    keeper = None if observations is None else KeptObservations(observations)
    answer_questions(connection, partial(_answer, keeper))


def _answer(keeper: Keeper | None, work: tuple[dict[str, Any], dict[str, Any], Mapping[str, bytes]]) -> object:
    cell, record, contents = work
    try:
        session = parse_session(cell, "session")
        capture = parse_capture(record, "record")
        check_poses(session, capture)
        return measured_with_text(session, capture, keeping(contents.__getitem__, keeper))[1]
    except CalibrationError as error:
        return error
