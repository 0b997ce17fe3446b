"""What happens in a session, told to whoever listens: server-sent events and the 3-D scenes.

Events are rows of the store, numbered in each session; listeners are only woken.  So a connection that broke goes
on where it was, also after a restart.
"""

import asyncio
import logging
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import suppress

from fastapi.sse import ServerSentEvent
from sqlalchemy import select
from starlette.concurrency import run_in_threadpool

from server.store.database import Store
from server.store.models import Data, EventRow, SessionRow
from server.store.solves import ENDED, job_data, job_row

log = logging.getLogger("scancell")
Listener = Callable[[EventRow], None]
_BATCH = 200


class Hub:
    """Passes events on, in the thread that committed them, to listeners of a session."""

    def __init__(self) -> None:
        self._listeners: dict[str, set[Listener]] = {}
        self._at_events: list[Callable[[], None]] = []
        self._at_close: set[Callable[[], None]] = set()
        self._lock = threading.Lock()
        self.closed = False

    def subscribe(self, session_id: str, listener: Listener) -> Callable[[], None]:
        """Call `listener` with each event of a session from now on; returns what ends that.

        The listener is called in whichever thread made the event, must return at once and may not write to the
        store.
        """
        with self._lock:
            self._listeners.setdefault(session_id, set()).add(listener)

        def unsubscribe() -> None:
            with self._lock:
                listeners = self._listeners.get(session_id, set())
                listeners.discard(listener)
                if not listeners:
                    self._listeners.pop(session_id, None)

        return unsubscribe

    def wake_at_events(self, wake: Callable[[], None]) -> None:
        """Call `wake`, which must return at once, after every event of any session."""
        self._at_events.append(wake)

    def publish(self, event: EventRow) -> None:
        """Tell the session's listeners."""
        for wake in self._at_events:
            wake()
        with self._lock:
            listeners = list(self._listeners.get(event.session_id, ()))
        for listener in listeners:
            try:
                listener(event)
            except Exception:  # one listener's fault must not undo what is stored, nor keep it from the others
                log.exception("a listener of session %s failed", event.session_id)

    def on_close(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Call `wake` when the server stops; returns what ends that."""
        self._at_close.add(wake)
        return lambda: self._at_close.discard(wake)

    def close(self) -> None:
        """End all streams: the server stops."""
        self.closed = True
        for wake in list(self._at_close):
            wake()


async def follow(
    store: Store, hub: Hub, session_id: str, after: int | None, alive_s: float | None = None
) -> AsyncIterator[EventRow]:
    """Yield a session's events after a number, or from now on, until the session or the server ends.

    From now on begins with the newest event, whose number a client can come back with.  With `alive_s`, an event
    `alive` comes where nothing else did for so long.
    """
    loop = asyncio.get_running_loop()
    changed = asyncio.Event()

    def wake() -> None:
        loop.call_soon_threadsafe(changed.set)

    endings = [hub.subscribe(session_id, lambda _: wake()), hub.on_close(wake)]
    try:
        while not hub.closed:
            changed.clear()
            rows = await run_in_threadpool(_events_after, store, session_id, after)
            if rows is None:
                yield EventRow(
                    session_id=session_id, id=(after or 0) + 1, kind="session", data={"action": "removed"}
                )
                return
            for row in rows:
                after = row.id
                yield row
            if not rows:
                try:
                    await asyncio.wait_for(changed.wait(), alive_s)
                except TimeoutError:
                    yield EventRow(session_id=session_id, id=after or 0, kind="alive", data={})
    finally:
        for end in endings:
            end()


async def ended_job(store: Store, hub: Hub, job_id: str, seconds: float) -> Data:
    """Return a job once it has ended, or as it is after so many seconds, or when the server stops.

    Raises
    ------
    NotFoundError
        If it has gone with its session.
    """
    job = await run_in_threadpool(_job, store, job_id)
    if job["status"] in ENDED or seconds <= 0:
        return job
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            async for event in follow(store, hub, job["session"], 0):
                if event.kind == "job" and event.data["id"] == job_id and event.data["status"] in ENDED:
                    break
    return await run_in_threadpool(_job, store, job_id)


def _job(store: Store, job_id: str) -> Data:
    with store.read() as db:
        return job_data(job_row(db, job_id))


def _events_after(store: Store, session_id: str, after: int | None) -> list[EventRow] | None:
    with store.read() as db:
        session = db.get(SessionRow, session_id)
        if session is None:
            return None
        if after is None or after > session.last_event:
            after = session.last_event - 1
        query = select(EventRow).where(EventRow.session_id == session_id, EventRow.id > after)
        return list(db.scalars(query.order_by(EventRow.id).limit(_BATCH)))


def to_sse(event: EventRow) -> ServerSentEvent:
    """Return an event as it goes over the wire."""
    return ServerSentEvent(event=event.kind, data=event.data, id=str(event.id))
