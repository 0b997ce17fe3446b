"""Plays a session's captures one after the other, as an animation of the cell."""

import threading
from collections.abc import Callable

STEP_S = 0.9


class Player:
    """Calls `step` at even times while it plays.

    Parameters
    ----------
    step : callable
        Goes on to the next capture.
    step_s : float
    """

    def __init__(self, step: Callable[[], None], step_s: float = STEP_S) -> None:
        self._step = step
        self._step_s = step_s
        self._lock = threading.Lock()
        self._end: threading.Event | None = None
        self._thread: threading.Thread | None = None

    @property
    def playing(self) -> bool:
        """Whether it plays now."""
        return self._end is not None

    def play(self, on: bool) -> None:
        """Start or end playing; what it is already stays."""
        with self._lock:
            if on == self.playing:
                return
            if self._end is not None:
                self._end.set()
                self._end = None
                return
            self._end = threading.Event()
            self._thread = threading.Thread(target=self._run, args=(self._end,), name="scene-player", daemon=True)
            self._thread.start()

    def stop(self) -> None:
        """End playing, and wait for the step that is on its way."""
        self.play(False)
        if self._thread is not None:
            self._thread.join(10)

    def _run(self, end: threading.Event) -> None:
        while not end.wait(self._step_s):
            self._step()
