"""How workers tell the server what they do: one pipe, shared by a lock.

A queue of multiprocessing has a thread on the server's side that waits for the lock, too.  A worker that is killed
while it tells keeps that lock: the thread, and with it the server's end, would wait for ever.  Here the server
never writes; it lets go of its copy of the writing end, and has read all when no worker is left.
"""

from multiprocessing.connection import Connection
from multiprocessing.context import BaseContext
from multiprocessing.synchronize import Lock
from typing import Any


class Teller:
    """The workers' end; it is handed over to them while they start."""

    def __init__(self, writer: "Connection[Any, Any]", lock: Lock) -> None:
        self.writer, self.lock = writer, lock

    def __call__(self, message: Any) -> None:
        """Tell the server; other workers wait meanwhile."""
        with self.lock:
            self.writer.send(message)


def telling(context: BaseContext) -> "tuple[Connection[Any, Any], Teller]":
    """Return the server's end and the workers'."""
    reader, writer = context.Pipe(duplex=False)
    return reader, Teller(writer, context.Lock())
