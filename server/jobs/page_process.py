"""Where pages have computed what they ask for: a process of its own, so that the service stays free to answer.

What computes in the service's own process holds Python's lock, for which everything else that the service does
waits at each of its steps: fifty machines that send captures would feel the guide that one open page asks for.
"""

import os
from collections.abc import Callable
from typing import Final, TypeVar

from starlette.exceptions import HTTPException

from server.jobs.child_processes import WorkerContext
from server.jobs.processes import ProcessEndedError, Processes

Answer = TypeVar("Answer")

_TIMEOUT_S: Final = 120.0  # the longest, the plan of a cell, takes two or three of a free core
_NICE: Final = 5  # where all cores are taken, captures are answered and measured first


class PageProcessError(HTTPException):
    """What was asked has no answer now: the process ended, hung, or is being stopped."""

    def __init__(self, said: str) -> None:
        super().__init__(503, said)


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
        self._processes = Processes(1, WorkerContext(warm), _begin)
        self._timeout_s = timeout_s
        self.stop = self._processes.stop

    def ask(self, question: Callable[..., Answer], *given: object) -> Answer:
        """Return what a function returns there (`Processes.ask`).

        Raises
        ------
        PageProcessError
            If the process ends twice, takes too long, or is stopped.
        Exception
            What the function raises.
        """
        try:
            return self._processes.ask(question, *given, timeout_s=self._timeout_s)
        except TimeoutError:
            raise PageProcessError(f"what was asked took longer than {self._timeout_s:g} s") from None
        except ProcessEndedError:
            raise PageProcessError("the process that works this out ended, or the server stops") from None


def _begin(_: object) -> None:
    if hasattr(os, "nice"):  # not on Windows
        os.nice(_NICE)
