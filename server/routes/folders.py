"""Folders on the server that sessions watch for captures."""

from typing import Annotated

from fastapi import Depends, Request
from pydantic import ConfigDict

from calib_core.records import Record, StepName
from server.http.api_router import API, api_router
from server.http.dependencies import SessionId, StoreDep
from server.sources.folder_watcher import Watcher
from server.store.sessions import session_row

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


def _watcher(request: Request) -> Watcher:
    return request.app.state.watcher


WatcherDep = Annotated[Watcher, Depends(_watcher)]


@router.get("", response_model=FolderState)
def get_folder(session_id: SessionId, store: StoreDep, watcher: WatcherDep) -> FolderState:
    """Return which folder is watched for the session, what came of it, and which may be watched."""
    return _state(session_id, store, watcher)


@router.put("", response_model=FolderState)
def watch_folder(session_id: SessionId, body: WatchedFolder, store: StoreDep, watcher: WatcherDep) -> FolderState:
    """Watch a folder: each measurement in it becomes a capture once it is whole and has its pose beside it."""
    _state(session_id, store, watcher)  # refuses a session that is not there
    watcher.watch(session_id, body.folder, body.step)
    return _state(session_id, store, watcher)


@router.delete("", status_code=204)
def end_watching(session_id: SessionId, store: StoreDep, watcher: WatcherDep) -> None:
    """Watch no folder for this session any more; what was taken stays."""
    _state(session_id, store, watcher)
    watcher.end(session_id)


def _state(session_id: str, store: StoreDep, watcher: Watcher) -> FolderState:
    with store.read() as db:
        session_row(db, session_id)
    return FolderState.model_validate(watcher.state(session_id))
