"""What the routes are given: the store, the jobs, paging and Idempotency-Key."""

import json
from collections.abc import Callable
from hashlib import sha256
from typing import Annotated, Any

from fastapi import Depends, Header, Path, Query, Request, Response
from fastapi.responses import JSONResponse
from pydantic_core import to_json
from sqlalchemy.orm import Session as Transaction

from server.backlog import Backlog
from server.events import Hub
from server.jobs import Jobs
from server.measuring_processes import Measuring
from server.metrics import Metrics
from server.settings import Settings
from server.store.answers import remember_answer, stored_answer
from server.store.database import Store
from server.store.models import AnswerRow, Data
from server.uploads import Room

# These are coroutines because FastAPI hands every plain function to another thread first.


async def _settings(request: Request) -> Settings:
    return request.app.state.settings


async def _store(request: Request) -> Store:
    return request.app.state.store


async def _hub(request: Request) -> Hub:
    return request.app.state.hub


async def _jobs(request: Request) -> Jobs:
    return request.app.state.jobs


async def _measuring(request: Request) -> Measuring:
    return request.app.state.measuring


async def _metrics(request: Request) -> Metrics:
    return request.app.state.metrics


async def _room(request: Request) -> Room:
    return request.app.state.upload_room


async def _backlog(request: Request) -> Backlog:
    return request.app.state.backlog


SettingsDep = Annotated[Settings, Depends(_settings)]
StoreDep = Annotated[Store, Depends(_store)]
HubDep = Annotated[Hub, Depends(_hub)]
JobsDep = Annotated[Jobs, Depends(_jobs)]
MeasuringDep = Annotated[Measuring, Depends(_measuring)]
MetricsDep = Annotated[Metrics, Depends(_metrics)]
RoomDep = Annotated[Room, Depends(_room)]
BacklogDep = Annotated[Backlog, Depends(_backlog)]

SessionId = Annotated[str, Path(description="A session's `id`.", max_length=64)]
CaptureId = Annotated[str, Path(description="A capture's `id`.", max_length=64)]
JobId = Annotated[str, Path(description="A job's `id`.", max_length=64)]
StageName = Annotated[str, Path(description="`tcp`, and the other stages as they come.", max_length=64)]
IfMatch = Annotated[
    str | None, Header(max_length=200, description="The ETag that the change was made against; else 412.")
]
LastEventId = Annotated[
    str | None, Header(pattern=r"^\d{1,15}$", description="The last event's id: the stream goes on after it.")
]
Cursor = Annotated[str | None, Query(max_length=500, description="The `next` of the page before.")]
Again = Annotated[str | None, Query(max_length=64, description="The `id` of a capture to be taken again.")]
Limit = Annotated[int, Query(ge=1, le=1000, description="How many at most.")]


class Once:
    """The request's Idempotency-Key: the same key with the same content is answered once and then repeated."""

    def __init__(self, scope: str, key: str | None) -> None:
        self._scope = scope
        self._key = key

    def answered(self, store: Store, content: Any) -> JSONResponse | None:
        """Return the answer that was given to this key and content, if there is one; raises ConflictError."""
        if self._key is None:
            return None
        with store.read() as db:
            return self._answered(db, _fingerprint(content))

    def known(self, store: Store) -> bool:
        """Return whether this key was answered before, whatever the content."""
        if self._key is None:
            return False
        with store.read() as db:
            return db.get(AnswerRow, (self._scope, self._key)) is not None

    def run(
        self, store: Store, content: Any, status: int, act: Callable[[Transaction], Data]
    ) -> tuple[Response, bool]:
        """Act within one transaction and return the answer, and whether this was the first time.

        Raises
        ------
        ConflictError
            If the key came with other content before.
        """
        fingerprint = _fingerprint(content) if self._key is not None else ""
        with store.write() as db:
            stored = self._answered(db, fingerprint)
            if stored is not None:
                return stored, False
            body = act(db)
            if self._key is not None:
                remember_answer(db, self._scope, self._key, fingerprint, status, body)
        return Response(to_json(body), status, media_type="application/json"), True

    def _answered(self, db: Transaction, fingerprint: str) -> JSONResponse | None:
        if self._key is None:
            return None
        row = stored_answer(db, self._scope, self._key, fingerprint)
        return None if row is None else JSONResponse(row.body, row.status, {"Idempotency-Replayed": "true"})


async def _once(
    request: Request,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            description="Any text, fresh for each new request: a repeated request with it does nothing twice.",
        ),
    ] = None,
) -> Once:
    return Once(f"{request.method} {request.url.path}", idempotency_key)


OnceDep = Annotated[Once, Depends(_once)]


def _fingerprint(content: Any) -> str:
    return sha256(json.dumps(content, sort_keys=True, ensure_ascii=False).encode()).hexdigest()
