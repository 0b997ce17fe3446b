"""The store: transactions on the database, the blobs, and the events that a transaction leaves behind."""

import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from calib_core.moment import now
from server.settings import Settings
from server.store.audit import acting, note_acts
from server.store.blob_places import open_blobs
from server.store.engine import engine_of, reading
from server.store.models import EventRow, SessionRow
from server.store.schema import upgrade
from server.store.signed_log import end_to_keep, keep_end
from server.store.webhooks import tell_event

Publish = Callable[[EventRow], None]
_EVENTS = "events"


class Store:
    """Where sessions are kept.

    Parameters
    ----------
    settings : Settings
    publish : callable
        Called with every event, in order, once the transaction that recorded it is on the disk.
    require_own : callable, optional
        Called at the beginning of each transaction that writes: raises OSError where another server does now.
    """

    def __init__(
        self, settings: Settings, publish: Publish, require_own: Callable[[Session], None] | None = None
    ) -> None:
        settings.data.mkdir(parents=True, exist_ok=True)
        self.blobs = open_blobs(settings.blob_place)
        self._publish = publish
        self._engine = engine_of(settings.sql_url, wait_s=settings.database_wait_s)
        self._reading = reading(self._engine)
        self._writing = self._engine.execution_options(writing=True)
        self._one_writer = threading.Lock()
        self._require_own = require_own

    def migrate(self) -> None:
        """Bring the tables to this version's form, all or nothing; raises InputError if a later one wrote them."""
        with self._writing.begin() as connection:
            upgrade(connection)

    def trouble(self) -> str | None:
        """Return None where the database answers; raises what it raises."""
        with self.read() as db:
            db.execute(select(1))
        return None

    @contextmanager
    def read(self) -> Generator[Session]:
        """Open a transaction that sees one consistent state."""
        with Session(self._reading) as db:
            yield db

    @contextmanager
    def write(self) -> Generator[Session]:
        """Open a transaction that changes something: it is committed, and its events published, at the end.

        SQLite has one writer at a time; waiting for this lock is fair, polling the file's lock is not.
        """
        with self._one_writer:
            with Session(self._writing, expire_on_commit=False) as db:
                if self._require_own is not None:
                    self._require_own(db)
                yield db
                note_acts(db, [acting.get()])
                end = end_to_keep(db)
                db.commit()
                if end is not None:
                    keep_end(end)
                events: list[EventRow] = db.info.pop(_EVENTS, [])
            for recorded in events:
                self._publish(recorded)

    def close(self) -> None:
        """Give the connections back."""
        self._engine.dispose()


def record_event(db: Session, session: SessionRow, kind: str, data: dict[str, Any]) -> None:
    """Note in the session's log that something happened, in the transaction that makes it happen.

    The session's row must have been read for change (`locked_session`), so that numbers follow the commits.
    """
    session.last_event += 1
    row = EventRow(session_id=session.id, id=session.last_event, kind=kind, data=data, created=now())
    db.add(row)
    publish_later(db, row)


def publish_later(db: Session, event: EventRow) -> None:
    """Have listeners and webhooks told of an event once the transaction that stores it is on the disk."""
    db.info.setdefault(_EVENTS, []).append(event)
    tell_event(db, event)
