"""Jobs that wait for what is away: files, database, or workers of a cluster."""

import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar

from server.store.unavailable import OUTAGES

log = logging.getLogger("scancell")
_LOOK_S: Final = 0.5
T = TypeVar("T")


class WaitingJobs:
    """A thread that hands jobs on once what they need is back.

    Parameters
    ----------
    hand_on : callable
        Takes a job and for how many seconds it has waited; returns whether it waits no longer.
    look_after : callable
        Called each time besides.
    """

    def __init__(self, hand_on: Callable[[str, float], bool], look_after: Callable[[], None]) -> None:
        self._hand_on, self._look_after = hand_on, look_after
        self._since_s: dict[str, float] = {}
        self._first_s: dict[str, float] = {}
        self._not_before_s: dict[str, float] = {}
        self._lost: dict[str, int] = {}
        self._lock = threading.Lock()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="waiting jobs", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> None:
        """Forget what waits."""
        self._stopping.set()

    def add(self, job_id: str, pause_s: float = 0.0) -> None:
        """Have a job wait, from now on unless it did before; it is not handed on before a pause is over."""
        with self._lock:
            self._not_before_s[job_id] = time.monotonic() + pause_s
            self._since_s.setdefault(job_id, time.monotonic())
            self._first_s.setdefault(job_id, time.monotonic())

    def waited_s(self, job_id: str) -> float:
        """Return how long ago a job had to wait for the first time, 0 where it never had."""
        now_s = time.monotonic()
        return now_s - self._first_s.get(job_id, now_s)

    def lost(self, job_id: str) -> int:
        """Count that a job's worker was killed, and return how often one was."""
        with self._lock:
            self._lost[job_id] = self._lost.get(job_id, 0) + 1
            return self._lost[job_id]

    def forget(self, job_id: str) -> None:
        """Forget a job that has ended."""
        with self._lock:
            for told in (self._since_s, self._first_s, self._not_before_s, self._lost):
                told.pop(job_id, None)

    def through_outages(self, act: Callable[[], T]) -> T:
        """Do what reads or writes the store, again while that is away; raises what it raises when all ends."""
        while True:
            try:
                return act()
            except OUTAGES:
                if self._stopping.wait(_LOOK_S):
                    raise

    def noting(self, note: Callable[[], None]) -> None:
        """Write something into the store; while that is away, again and again in a thread of its own."""
        try:
            note()
        except OUTAGES:
            again = threading.Thread(target=self._note, args=(note,), name="job's end", daemon=True)
            again.start()

    def _note(self, note: Callable[[], None]) -> None:
        with suppress(*OUTAGES):  # the server stops: the next start says what became of the job
            self.through_outages(note)

    def _work(self) -> None:
        while not self._stopping.wait(_LOOK_S):
            try:
                self._look_after()
                for job_id in list(self._since_s):
                    self._look_at(job_id)
            except OUTAGES:
                log.info("jobs wait for what is away")
            except Exception:
                log.exception("jobs that wait could not be handed on")

    def _look_at(self, job_id: str) -> None:
        with self._lock:
            if time.monotonic() < self._not_before_s.get(job_id, 0.0):
                return
            since_s = self._since_s.pop(job_id, None)
        if since_s is None:  # it was cancelled, and has ended
            return
        waits = True
        try:
            waits = not self._hand_on(job_id, time.monotonic() - since_s)
        finally:
            if waits:
                with self._lock:
                    self._since_s[job_id] = since_s
