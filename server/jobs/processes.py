"""Processes of this server that answer questions: solves, measurements, and what pages ask for.

Each has a connection of its own, to which nobody else writes: where a process ends in the middle of an answer,
whoever waits is told, and no other process is concerned.  One that ended or was too late is replaced.
"""

import logging
import os
import pickle
import signal
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Final, TypeVar
from weakref import WeakSet

from calib_core.compiled import on_compiling
from server.jobs.child_processes import WorkerContext, load_anew, times_loaded

log = logging.getLogger("scancell")
Answer = TypeVar("Answer")

_START_TIMEOUT_S: Final = 300.0  # kernels are compiled where no cache of them is left
_COMPILING_TIMEOUT_S: Final = 600.0
_READY, _COMPILING, _TOLD, _ANSWER, _RAISED = range(5)
"""What a process sends, each with a value."""


_known: "WeakSet[Processes]" = WeakSet()


class ProcessEndedError(Exception):
    """The process that was asked has ended, or all are being stopped."""


class Processes:
    """Processes that answer one question each at a time; they start when they are needed first.

    Parameters
    ----------
    count : int
        How many at once; who asks meanwhile waits.
    context : WorkerContext
    begin : callable
        Prepares a process: takes what tells the server something, which `ask` hands to `hear`, and `given`.
    *given : object
    """

    def __init__(self, count: int, context: WorkerContext, begin: Callable[..., None], *given: object) -> None:
        self._context, self._begin, self._given = context, begin, given
        self._turns = threading.BoundedSemaphore(count)
        self._lock = threading.Lock()
        self._idle: list[_Process] = []
        self._all: set[_Process] = set()
        self._closed = False
        _known.add(self)

    @property
    def pids(self) -> list[int]:
        """The numbers of those that were started and have not been replaced."""
        with self._lock:
            return [process.pid for process in self._all]

    def ask(
        self,
        question: Callable[..., Answer],
        *given: object,
        timeout_s: float | None = None,
        hear: Callable[[Any], None] | None = None,
        attempts: int = 2,
    ) -> Answer:
        """Return what a function returns there; it is sent by its name, what it takes and returns as it is.

        Where a kernel must be compiled first, as on a machine that was just set up, it is given longer.

        Parameters
        ----------
        question : callable
        *given : object
            What it takes.
        timeout_s : float, optional
            What takes longer is given up.
        hear : callable, optional
            Hears what the process tells meanwhile.
        attempts : int
            How often it is asked: a process may have been ended for what it did not do.

        Raises
        ------
        TimeoutError
        ProcessEndedError
            If the process ends at the last attempt, or all are being stopped.
        Exception
            What the function raises.
        """
        for left in reversed(range(attempts)):
            process = self._take()
            try:
                return process.ask((question, given), timeout_s, hear)
            except ProcessEndedError:
                if self._closed:
                    raise
                log.warning("the process %d ended", process.pid)
                if not left:
                    raise
            finally:
                self._give_back(process)
        raise ProcessEndedError

    def warm_up(self) -> None:
        """Have one process ready, unless all are being stopped."""
        with suppress(ProcessEndedError):
            self._give_back(self._take())

    def end(self, pid: int) -> None:
        """End a process at once; who waits for its answer is told."""
        with self._lock:
            for process in self._all:
                if process.pid == pid:
                    process.kill()

    def renew(self) -> None:
        """End those that wait for questions; the others end after their answers if they are outdated."""
        with self._lock:
            idle, self._idle = self._idle, []
            self._all.difference_update(idle)
        for process in idle:
            process.end()

    def stop(self) -> None:
        """End all at once; one that still starts is ended by whoever waits for it."""
        with self._lock:
            self._closed = True
            processes, self._all = self._all, set()
            self._idle.clear()
        for process in processes:
            process.end()

    def _take(self) -> "_Process":
        self._turns.acquire()
        try:
            with self._lock:
                while self._idle:
                    process = self._idle.pop()
                    if process.is_alive:
                        return process
                    self._all.discard(process)
            process = _Process(self._context, self._begin, *self._given)
            with self._lock:
                if not self._closed:
                    self._all.add(process)
                    return process
            process.end()
            raise ProcessEndedError
        except BaseException:
            self._turns.release()
            raise

    def _give_back(self, process: "_Process") -> None:
        with self._lock:
            known = process in self._all  # else `stop` ends it
            usable = known and process.usable and process.loaded == times_loaded()
            if usable:
                self._idle.append(process)
            else:
                self._all.discard(process)
        if known and not usable:
            process.end()
        self._turns.release()


class _Process:
    """One process that was started here; `usable` while it was ready, and in time with all answers."""

    def __init__(self, context: WorkerContext, begin: Callable[..., None], *given: object) -> None:
        self.loaded = times_loaded()
        self._connection, other = context.Pipe()
        self._process: Any = context.Process(target=_serve, args=(other, begin, given), daemon=True)
        self._process.start()
        other.close()
        self.pid: int = self._process.pid
        self.usable = self._started()

    @property
    def is_alive(self) -> bool:
        return self._process.is_alive()

    def ask(self, work: object, timeout_s: float | None, hear: Callable[[Any], None] | None) -> Any:
        usable, self.usable = self.usable, False  # until all went well
        if not usable:
            raise ProcessEndedError
        try:
            self._connection.send(work)
            kind, value = self._answer(timeout_s, hear)
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            if isinstance(error, TimeoutError):
                raise
            raise ProcessEndedError(f"the process {self.pid} ended") from None
        self.usable = True
        if kind == _RAISED:
            raise value
        return value

    def _answer(self, timeout_s: float | None, hear: Callable[[Any], None] | None) -> tuple[int, Any]:
        while True:
            if not self._connection.poll(timeout_s):
                raise TimeoutError
            kind, value = self._connection.recv()
            if kind == _COMPILING and timeout_s is not None:
                timeout_s = max(timeout_s, _COMPILING_TIMEOUT_S)
            elif kind == _TOLD and hear is not None:
                hear(value)
            elif kind in (_ANSWER, _RAISED):
                return kind, value

    def _started(self) -> bool:
        try:
            return self._connection.poll(_START_TIMEOUT_S) and self._connection.recv()[0] == _READY
        except (EOFError, OSError):
            return False

    def kill(self) -> None:
        """Have the process end; who waits for its answer is told."""
        self.usable = False
        self._process.kill()

    def end(self) -> None:
        """End the process at once."""
        self.kill()
        self._process.join()
        self._connection.close()


def replace_all() -> None:
    """Replace all processes of this server, each after its answer, by such as load everything anew."""
    before = load_anew()
    for processes in tuple(_known):
        processes.renew()
    if before is not None:
        threading.Thread(target=os.waitpid, args=(before, 0), daemon=True, name="outdated processes").start()


def leave_interrupts_to_the_server() -> None:
    """Let Ctrl-C, which a terminal sends to every process, end the server alone: it ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _serve(connection: "Connection[Any, Any]", begin: Callable[..., None], given: tuple[object, ...]) -> None:
    """Answer what comes until the server hangs up, maybe before this process is ready."""
    leave_interrupts_to_the_server()
    one_at_a_time = threading.Lock()  # a solve tells of itself from several threads

    def send(kind: int, value: object = None) -> None:
        with one_at_a_time:
            connection.send((kind, value))

    def tell(value: object) -> None:
        send(_TOLD, value)

    begin(tell, *given)
    with suppress(EOFError, OSError):
        send(_READY)
        on_compiling.append(lambda: send(_COMPILING))
        while True:
            question, given = connection.recv()
            send(*_outcome(question, given))


def _outcome(question: Callable[..., object], given: tuple[object, ...]) -> tuple[int, object]:
    try:
        return _ANSWER, question(*given)
    except Exception as error:
        trace = traceback.format_exc()
        error.add_note(trace)
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # one of a library's, which cannot be sent
            return _RAISED, RuntimeError(trace)
        return _RAISED, error
