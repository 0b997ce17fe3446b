"""Work beside the requests: a thread that goes on until it is told to stop, and keeps no process from ending."""

import threading
from abc import ABC, abstractmethod


class BackgroundThread(ABC):
    """A thread that works until `_stopping` is set, and looks for work where `_woken` is.

    Parameters
    ----------
    name : str
        The thread's.
    longest_s : float, optional
        For how long `stop` waits for what is under way; left out, until it has ended.
    """

    def __init__(self, name: str, longest_s: float | None = None) -> None:
        self._longest_s = longest_s
        self._woken, self._stopping = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def wake(self) -> None:
        """Have it look at once for what it has to do."""
        self._woken.set()

    def stop(self) -> None:
        """End after what is under way."""
        self._stopping.set()
        self.wake()
        if self._thread.is_alive():
            self._thread.join(self._longest_s)

    @abstractmethod
    def _work(self) -> None: ...
