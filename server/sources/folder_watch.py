"""The watcher of this server: what it reads of sessions, and how it stores captures."""

import asyncio
from collections.abc import Mapping

from calib_core.records import Capture, Session
from server.captures.intake import Intake
from server.settings import Settings
from server.sources.folder_watcher import Watcher
from server.store.arrivals import session_record
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.sessions import empty_session


def session_watcher(settings: Settings, store: Store, intake: Intake) -> Watcher:
    """Return the watcher of folders below `settings.watch_root`, not started yet."""

    def load(session_id: str) -> tuple[Session, set[str]]:
        with store.read() as db:
            return empty_session(session_record(db, session_id), session_id), capture_ids(db, session_id)

    def take(session_id: str, capture: Capture, contents: Mapping[str, bytes]) -> None:
        asyncio.run(intake.take(session_id, capture, contents))

    return Watcher(settings.watch_root, settings.data / "watched.json", load, take, settings.max_upload_bytes)
