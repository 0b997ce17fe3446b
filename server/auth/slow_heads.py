"""Connections that are opened and then do not say what they want are closed after a while."""

import time
from collections.abc import Callable, Iterable
from typing import Any
from weakref import WeakKeyDictionary

_NO_HTTP = object()


class SlowHeads:
    """Watches a server's connections.

    uvicorn itself closes a connection that rests between two requests for longer than clients keep it, but not one
    whose first request, or whose next one's head, never becomes whole.

    Parameters
    ----------
    timeout_s : float
    clock : callable
        Seconds that only grow.
    """

    def __init__(self, timeout_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._timeout_s = timeout_s
        self._clock = clock
        self._waiting: WeakKeyDictionary[Any, tuple[object, float]] = WeakKeyDictionary()

    def close_old(self, connections: Iterable[Any]) -> None:
        """Close those that have waited for the head of a request for too long.

        Parameters
        ----------
        connections : iterable of uvicorn's protocols
            Those of WebSockets have no `cycle` (the request that is being answered) and are let be; `head_begun`
            says of the others whether anything of the next request is there.
        """
        now_s = self._clock()
        for connection in connections:
            cycle: Any = getattr(connection, "cycle", _NO_HTTP)
            if cycle is _NO_HTTP or (
                cycle is not None and not (cycle.response_complete and connection.head_begun)
            ):
                self._waiting.pop(connection, None)
                continue
            before, since_s = self._waiting.get(connection, (None, now_s))
            if before is not cycle:
                since_s = now_s
            self._waiting[connection] = (cycle, since_s)
            if now_s - since_s > self._timeout_s:
                connection.transport.close()
