"""The watcher of this server: what it reads of sessions, and how it stores captures."""

from collections.abc import Mapping

from calib_core.errors import CalibrationError
from calib_core.records import Capture, Session
from server.jobs.measuring_processes import Measuring
from server.settings import Settings
from server.sources.folder_watcher import Watcher
from server.sources.receiving import receive
from server.store.arrivals import add_captures, session_record
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.sessions import empty_session


def session_watcher(settings: Settings, store: Store, measuring: Measuring) -> Watcher:
    """Return the watcher of folders below `settings.watch_root`, not started yet."""

    def load(session_id: str) -> tuple[Session, set[str]]:
        with store.read() as db:
            return empty_session(session_record(db, session_id), session_id), capture_ids(db, session_id)

    def keep(session_id: str, capture: Capture, contents: Mapping[str, bytes]) -> None:
        arrival, record = receive(store, measuring, session_id, capture, contents)
        with store.write() as db:
            (stored,) = add_captures(db, session_id, [arrival], record)
            if isinstance(stored, CalibrationError):
                raise stored

    memory = settings.data / "watched.json"
    return Watcher(settings.watch_root, memory, load, keep, settings.max_upload_bytes)
