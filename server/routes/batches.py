"""Many captures in one request."""

from collections.abc import AsyncIterator, Mapping, Sequence
from hashlib import sha256
from typing import Any

from fastapi import APIRouter, Request, Response
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError
from calib_core.records import Capture, Session
from server.http.dependencies import BacklogDep, IdempotencyDep, SessionId, SettingsDep, StoreDep
from server.http.errors import problem
from server.http.json_text import JsonText
from server.http.schemas import BatchAnswer
from server.http.strict_json import StrictRoute
from server.jobs.backlog import to_wait
from server.jobs.batches import Raw, bunches, parsed
from server.store.arrivals import Arrival, add_captures, is_stored, session_record
from server.store.database import Store
from server.store.models import Data
from server.store.sessions import empty_session

router = APIRouter(prefix="/sessions/{session_id}", tags=["captures"], route_class=StrictRoute)

MEDIA_TYPE = "application/octet-stream"
_EXAMPLE = (
    '{"id": "p01", "step": "tcp", "kind": "profile", "files": ["captures/p01.csv"], "sizes": [30], '
    '"pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]}\n'
    "x_mm,z_mm\n0.0,100\n0.1,100.1\n"
)
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            MEDIA_TYPE: {
                "schema": {"type": "string", "format": "binary"},
                "examples": {
                    "one": {
                        "summary": "A line with the record and the sizes of its files, then the files; and so on",
                        "value": _EXAMPLE,
                    }
                },
            }
        },
    }
}


@router.post("/captures/batch", response_model=BatchAnswer, openapi_extra=_BODY)
async def add_batch(
    session_id: SessionId,
    request: Request,
    idempotency: IdempotencyDep,
    store: StoreDep,
    backlog: BacklogDep,
    settings: SettingsDep,
) -> Response:
    """Store many captures, each a line of JSON with its record and `sizes`, followed by the bytes of its files.

    What is answered with 201 is on the disk, and 200 says that it was there already; both are measured soon after
    and told of as `capture` events.  A capture that cannot be stored does not keep the others from it.
    """
    digest = sha256()

    async def pieces() -> AsyncIterator[bytes]:
        async for piece in request.stream():
            digest.update(piece)
            yield piece

    body = pieces()
    items: list[Data] = []
    if await run_in_threadpool(idempotency.known, store):
        async for _ in body:
            pass
    else:
        record = await run_in_threadpool(_record, store, session_id)
        session = empty_session(record, session_id)
        with backlog.arriving():
            async for bunch in bunches(body, settings.max_upload_bytes):
                items += await run_in_threadpool(_store_bunch, store, session, session_id, record, bunch)
    answer: Data = {"items": items, "stored": sum(item["status"] < 300 for item in items)}
    response, _ = await run_in_threadpool(idempotency.run, store, digest.hexdigest(), 200, lambda _: answer)
    return response


def _record(store: Store, session_id: str) -> Data:
    with store.read() as db:
        return session_record(db, session_id)


def _store_bunch(
    store: Store, session: Session, session_id: str, record: Data, bunch: Sequence[Raw]
) -> list[Data]:
    """Store what is of use, files first; return the answer to each."""
    items: list[Data | None] = []
    came: list[tuple[Capture, Mapping[str, bytes]]] = []
    for raw in bunch:
        try:
            came.append(parsed(raw, session))
            items.append(None)
        except CalibrationError as error:
            items.append(_refused(raw.data.get("id"), error))
    digests = iter(store.blobs.put_all([content for _, files in came for content in files.values()]))
    arrivals = [
        Arrival(
            capture,
            to_wait(capture),
            {name: next(digests) for name in files},
            {name: len(content) for name, content in files.items()},
            waits=True,
        )
        for capture, files in came
    ]
    with store.write() as db:
        answers = add_captures(db, session_id, arrivals, record)
        stored = iter([_stored(db, session_id, *pair) for pair in zip(arrivals, answers, strict=True)])
    return [next(stored) if item is None else item for item in items]


def _stored(
    db: Transaction, session_id: str, arrival: Arrival, answer: Data | JsonText | CalibrationError
) -> Data:
    if not isinstance(answer, CalibrationError):
        return {"id": arrival.capture.id, "status": 201}
    if is_stored(db, session_id, arrival):
        return {"id": arrival.capture.id, "status": 200}
    return _refused(arrival.capture.id, answer)


def _refused(capture_id: Any, error: CalibrationError) -> Data:
    return {
        "id": capture_id if isinstance(capture_id, str) else None,
        "status": error.status,
        "problem": problem(error),
    }
