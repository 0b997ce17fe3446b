"""Folders on the server that sessions watch for captures."""

from typing import Annotated

from pydantic import ConfigDict

from calib_core.records import Record, StepName
from server.http.api_router import API, api_router, of_app
from server.routes.dependencies import ExistingSession
from server.sources.folder_watcher import Watcher

router = api_router("captures", f"{API}/sessions/{{session_id}}/sources/folder")


class WatchedFolder(Record):
    """The folder to watch, below the server's watched root, and what its captures are taken for."""

    model_config = ConfigDict(json_schema_extra={"examples": [{"folder": "cell 4/today", "step": "tcp"}]})

    folder: str
    step: StepName = "tcp"


class RefusedFile(Record):
    """A file that makes no capture, and why; it is tried again once it or its pose changes."""

    file: str
    reason: str


class Watch(Record):
    """What a watched folder gave: how many captures, which files are still being written, which are refused."""

    folder: str
    step: StepName
    taken: int
    waiting: list[str]
    refused: list[RefusedFile]
    problem: str


class FolderState(Record):
    """Whether this server watches folders, those that may be chosen, and the one that is watched."""

    available: bool
    folders: list[str]
    watch: Watch | None


WatcherDep = Annotated[Watcher, of_app("watcher")]


@router.get("", response_model=FolderState)
def get_folder(session_id: ExistingSession, watcher: WatcherDep) -> FolderState:
    """Return which folder is watched for the session, what came of it, and which may be watched."""
    return _state(session_id, watcher)


@router.put("", response_model=FolderState)
def watch_folder(session_id: ExistingSession, body: WatchedFolder, watcher: WatcherDep) -> FolderState:
    """Watch a folder: each measurement in it becomes a capture once it is whole and has its pose beside it."""
    watcher.watch(session_id, body.folder, body.step)
    return _state(session_id, watcher)


@router.delete("", status_code=204)
def end_watching(session_id: ExistingSession, watcher: WatcherDep) -> None:
    """Watch no folder for this session any more; what was taken stays."""
    watcher.end(session_id)


def _state(session_id: str, watcher: Watcher) -> FolderState:
    return FolderState.model_validate(watcher.state(session_id))
