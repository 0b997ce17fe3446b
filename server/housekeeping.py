"""What a server tidies up now and then: what nobody asks for any more, and files that nothing refers to."""

import logging
import shutil
import threading
from pathlib import Path
from typing import Final

from sqlalchemy import delete, select
from sqlalchemy.orm import Session as Transaction

from server.background import BackgroundThread
from server.store.answers import forget_old_answers
from server.store.database import Store
from server.store.models import Data, EventRow, FileRow, OutputRow, SessionRow
from server.store.releases import list_cells, released
from server.store.signed_log import verify_anew
from server.store.standing import policy_of, released_faults
from server.store.webhooks import forget_old_deliveries, tell

log = logging.getLogger("scancell")

_EVERY_S: Final = 3600.0
_LEAST_FREE: Final = 0.05
_LEAST_FREE_BYTES: Final = 500_000_000
_EVENTS_KEPT: Final = 1000  # of a session; a page that was away for longer reads everything anew


class Housekeeping(BackgroundThread):
    """A thread that tidies up at the start and then every hour."""

    def __init__(self, store: Store, data: Path) -> None:
        super().__init__("housekeeping")
        self._store = store
        self._alarms = Alarms(store, data)

    def _work(self) -> None:
        while True:
            try:
                with self._store.write() as db:
                    forget_old_answers(db)
                    forget_old_deliveries(db)
                forget_old_events(self._store)
                remove_orphans(self._store, self._stopping)
                verify_anew()
                self._alarms.tell()
            except Exception:  # a full disk, a locked database: next hour is soon enough
                log.exception("tidying up failed")
            if self._stopping.wait(_EVERY_S):
                return


class Alarms:
    """What nobody does, so that a webhook must be told of it by the clock: each once, until it is over."""

    def __init__(self, store: Store, data: Path) -> None:
        self._store, self._data = store, data
        self._told: set[str] = set()

    def tell(self) -> None:
        """Tell of answers in force that are overdue, and of a disk that fills."""
        with self._store.write() as db:
            found = {**_overdue(db), **_full(self._data)}
            for name, (kind, data) in found.items():
                if name not in self._told:
                    tell(db, kind, data.get("session"), data, data.get("cell"))
        self._told = set(found)


def _overdue(db: Transaction) -> dict[str, tuple[str, Data]]:
    found: dict[str, tuple[str, Data]] = {}
    for cell in list_cells(db):
        release = cell["released"]
        if release is not None and policy_of(db, cell["id"]).interval_days is not None:
            row = released(db, cell["id"])
            if "overdue" in released_faults(db, row):
                told = {"cell": cell["id"], "session": row.session_id, "number": row.number}
                found[f"overdue {row.number}"] = ("overdue", told)
    return found


def _full(data: Path) -> dict[str, tuple[str, Data]]:
    disk = shutil.disk_usage(data)
    if disk.free >= max(_LEAST_FREE * disk.total, _LEAST_FREE_BYTES):
        return {}
    return {"disk": ("disk", {"free_bytes": disk.free, "total_bytes": disk.total})}


def forget_old_events(store: Store, kept: int = _EVENTS_KEPT) -> None:
    """Remove the log of what happened but for the newest of each session."""
    with store.read() as db:
        many = select(SessionRow.id, SessionRow.last_event).where(SessionRow.last_event > kept)
        sessions = db.execute(many).all()
    for session_id, last in sessions:  # one by one: nobody waits for long
        old = delete(EventRow).where(EventRow.session_id == session_id, EventRow.id <= last - kept)
        with store.write() as db:
            db.execute(old.execution_options(synchronize_session=False))


def remove_orphans(store: Store, stopping: threading.Event) -> None:
    """Remove files that lost their capture, or never had one because of a kill, once they are an hour old."""
    for first in range(256):
        if stopping.is_set():
            return
        beginning = f"{first:02x}"
        stored = list(store.blobs.digests(beginning))
        if not stored:
            continue
        with store.read() as db:
            known = {
                digest
                for column in (FileRow.sha256, OutputRow.sha256)
                # A range, which an index answers, where LIKE would read the whole table.
                for digest in db.scalars(
                    select(column).distinct().where(column >= beginning, column < beginning + "g")
                )
            }
        store.blobs.remove(digest for digest in stored if digest not in known)
