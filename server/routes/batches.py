"""Many captures in one request."""

from collections.abc import AsyncIterator
from hashlib import sha256
from typing import Any

from fastapi import Request, Response
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError
from server.captures.batch_body import bunches
from server.http.api_router import API, api_router
from server.http.errors import problem
from server.http.openapi import BYTES
from server.http.schemas import BatchAnswer
from server.routes.dependencies import (
    IdempotencyDep,
    IntakeDep,
    MeasuringQueueDep,
    SessionId,
    SettingsDep,
    StoreDep,
)
from server.store.database import Store
from server.store.models import Data
from server.store.sessions import session_row

router = api_router("captures", f"{API}/sessions/{{session_id}}")

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
                "schema": BYTES,
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
    intake: IntakeDep,
    queue: MeasuringQueueDep,
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
        await run_in_threadpool(_require_session, store, session_id)
        with queue.arriving():
            async for bunch in bunches(body, settings.max_upload_bytes):
                outcomes = await intake.take_unmeasured(session_id, bunch)
                items += [_item(one.data.get("id"), outcome) for one, outcome in zip(bunch, outcomes, strict=True)]
    answer: Data = {"items": items, "stored": sum(item["status"] < 300 for item in items)}
    response, _ = await run_in_threadpool(idempotency.run, store, digest.hexdigest(), 200, lambda _: answer)
    return response


def _require_session(store: Store, session_id: str) -> None:
    with store.read() as db:
        session_row(db, session_id)


def _item(capture_id: Any, outcome: bool | CalibrationError) -> Data:
    """Return what became of a capture: stored now, there before, or refused."""
    if not isinstance(outcome, CalibrationError):
        return {"id": capture_id, "status": 201 if outcome else 200}
    name = capture_id if isinstance(capture_id, str) else None
    return {"id": name, "status": outcome.status, "problem": problem(outcome)}
