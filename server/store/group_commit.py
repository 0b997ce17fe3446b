"""Writes that come at once share one transaction: the disk is forced once for all of them."""

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, field
from itertools import islice
from queue import SimpleQueue
from typing import Any

from sqlalchemy.orm import Session as Transaction

from calib_core.errors import CalibrationError
from server.store import audit
from server.store.database import Store
from server.store.unavailable import OUTAGES

Act = Callable[[Transaction, Sequence[str]], Any]
_MOST = 64


@dataclass
class _Write:
    """One write on its way, by whom, and the files that must be there before."""

    act: Act
    contents: Sequence[bytes]
    by: audit.Act | None
    done: Future[Any] = field(default_factory=Future[Any])


class GroupCommit:
    """A thread that takes all writes that wait and makes one transaction of them.

    Each succeeds or fails as if it were alone.  What one does before it refuses would stay, so each looks first
    and writes then.
    """

    def __init__(self, store: Store) -> None:
        self._store = store
        self._waiting: SimpleQueue[_Write | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="writes", daemon=True)

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def submit(self, act: Act, contents: Sequence[bytes]) -> Future[Any]:
        """Return what `act` will have returned once it, and its files before it, are on the disk.

        Parameters
        ----------
        act : callable
            Reads and writes in a transaction, given the files' SHA-256; another try may call it again.
        contents : sequence of bytes
            Files that it refers to.
        """
        write = _Write(act, contents, audit.acting.get())
        write.done.set_running_or_notify_cancel()  # whoever asked may leave; it is written all the same
        self._waiting.put(write)
        return write.done

    def stop(self) -> None:
        """End after what waits has been written."""
        self._waiting.put(None)
        if self._thread.is_alive():
            self._thread.join()

    def _work(self) -> None:
        while (first := self._waiting.get()) is not None:
            writes = [first]
            while len(writes) < _MOST and not self._waiting.empty():
                following = self._waiting.get()
                if following is None:
                    self._waiting.put(None)
                    break
                writes.append(following)
            self._write(writes)

    def _write(self, writes: Sequence[_Write]) -> None:
        try:
            digests = self._store.blobs.put_all([content for write in writes for content in write.contents])
            outcomes = self._written(writes, iter(digests))
        except (OSError, *OUTAGES) as error:
            # No disk, no database: it is so for each of them.
            for write in writes:
                write.done.set_exception(error)
        except Exception as error:
            if len(writes) == 1:
                writes[0].done.set_exception(error)
                return
            for write in writes:  # one of them is at fault
                if write.by is not None:
                    write.by.noted = False
                self._write([write])
        else:
            for write, outcome in zip(writes, outcomes, strict=True):
                if isinstance(outcome, CalibrationError):
                    write.done.set_exception(outcome)
                else:
                    write.done.set_result(outcome)

    def _written(self, writes: Sequence[_Write], digests: Iterator[str]) -> list[Any]:
        """Write all in one transaction; return for each what it returned, or why it was refused."""
        outcomes: list[Any] = []
        done: list[audit.Act | None] = []
        with self._store.write() as db:
            for write in writes:
                audit.acting.set(write.by)
                try:
                    outcomes.append(write.act(db, list(islice(digests, len(write.contents)))))
                except CalibrationError as error:
                    outcomes.append(error)
                else:
                    done.append(write.by)
            audit.note_acts(db, done)
        return outcomes
