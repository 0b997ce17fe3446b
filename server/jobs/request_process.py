"""A process of the server's that answers one question at a time, over a connection of its own.

Nobody else writes to that connection: where the process ends in the middle of an answer, whoever waits is told.
"""

import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any

from calib_core.compiled import on_compiling

_START_TIMEOUT_S = 300.0  # kernels are compiled where no cache of them is left
_COMPILING_TIMEOUT_S = 600.0
_READY, _COMPILING = "ready", "compiling"


class AskedProcess:
    """A process that is started here, and answers.

    Parameters
    ----------
    context : multiprocessing context
    serve : callable
        What runs in the process: takes the connection and `given`, and calls `answer_questions`.
    *given : object

    Attributes
    ----------
    usable : bool
        Whether it may be asked: it is ready, and was in time with all answers.
    """

    def __init__(self, context: Any, serve: Callable[..., None], *given: object) -> None:
        self._connection, other = context.Pipe()
        self._process = context.Process(target=serve, args=(other, *given), daemon=True)
        self._process.start()
        other.close()
        self.usable = self._started()

    @property
    def pid(self) -> int:
        """Its number."""
        return self._process.pid

    def ask(self, work: object, timeout_s: float) -> Any:
        """Return the answer to one piece of work; raises TimeoutError, or EOFError where the process ended.

        Where a kernel must be compiled first, as on a machine that was just set up, the work is given longer.
        """
        usable, self.usable = self.usable, False  # until all went well
        if not usable:
            raise EOFError
        self._connection.send(work)
        answer: Any = _COMPILING
        while isinstance(answer, str) and answer == _COMPILING:
            if not self._connection.poll(timeout_s):
                raise TimeoutError
            answer = self._connection.recv()
            timeout_s = max(timeout_s, _COMPILING_TIMEOUT_S)
        self.usable = True
        return answer

    def _started(self) -> bool:
        try:
            return self._connection.poll(_START_TIMEOUT_S) and self._connection.recv() == _READY
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


def leave_interrupts_to_the_server() -> None:
    """Let Ctrl-C, which a terminal sends to every process, end the server alone: it ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def answer_questions(connection: "Connection[Any, Any]", answer: Callable[[Any], object]) -> None:
    """Answer what comes until the service hangs up, maybe before this process is ready."""
    with suppress(EOFError, OSError):
        connection.send(_READY)
        on_compiling.append(lambda: connection.send(_COMPILING))
        while True:
            connection.send(answer(connection.recv()))
