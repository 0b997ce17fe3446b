"""A folder that something else writes captures into, as a source; the watcher of this server."""

import asyncio
from collections.abc import Mapping

from pydantic import Field

from calib_core.records import Capture, Session, StepName
from server.captures.intake import Intake
from server.settings import Settings
from server.sources.folder_watcher import Watcher
from server.sources.source import Settings as SourceSettings
from server.sources.source import Source
from server.store.capture_writes import session_record
from server.store.captures import capture_ids
from server.store.database import Store
from server.store.sessions import empty_session


class FolderSettings(SourceSettings):
    """The folder to watch, below the server's watched root, and what its captures are taken for."""

    folder: str = Field(description="Below the folder that SCANCELL_WATCH_ROOT names.")
    step: StepName = "tcp"


SOURCE = Source(
    "folder",
    "Watched folder",
    "Each measurement in it becomes a capture once it is whole and has its pose beside it.",
    FolderSettings,
)


def session_watcher(settings: Settings, store: Store, intake: Intake) -> Watcher:
    """Return the watcher of folders below `settings.watch_root`, not started yet."""

    def load(session_id: str) -> tuple[Session, set[str]]:
        with store.read() as db:
            return empty_session(session_record(db, session_id), session_id), capture_ids(db, session_id)

    def take(session_id: str, capture: Capture, contents: Mapping[str, bytes]) -> None:
        asyncio.run(intake.take(session_id, capture, contents))

    memory, most = settings.data / "watched.json", settings.max_upload_bytes
    return Watcher(settings.watch_root, memory, load, take, most, settings.watch_rest_s)
