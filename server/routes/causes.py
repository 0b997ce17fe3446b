"""Root causes of a session: asked for, their remedies applied, and undone."""

from typing import Annotated

from fastapi import Path, Response
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError
from calib_core.messages import message
from calib_core.records import Changes, RootCause
from server.captures.applying import apply_changes
from server.http.api_router import API, api_router
from server.http.schemas import StoredSession
from server.routes.dependencies import IdempotencyDep, LoadedSession, MeasuringQueueDep, SessionId, StoreDep
from server.store.models import Data
from server.store.sessions import StoredSession as Loaded
from server.store.sessions import load_session, locked_session

router = api_router("results", f"{API}/sessions/{{session_id}}")

CauseId = Annotated[
    str, Path(description="A cause's `id`.", max_length=64, examples=["pose-reading-written-as-kuka-or-nachi"])
]


class RootCauses(BaseModel):
    """A session's root causes, the likeliest first, each with all that applying it changes."""

    items: list[RootCause]


class AppliedChanges(BaseModel):
    """A session as it is after changes, the changes, and those that undo them (`POST …/changes`)."""

    session: StoredSession
    changes: Changes
    undo: Changes


class ChangesRequest(Changes):
    """Changes of a session, made together: merge patches (RFC 7396) of its cell and, by id, of its captures."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"captures": {"p01": {"excluded": True}}}]}
    )

    cell: Data = Field(default_factory=dict)


@router.get("/causes", response_model=RootCauses)
def get_causes(stored: LoadedSession) -> RootCauses:
    """Return why the session fails or is doubtful: by its fresh results or, where unsolved, by its captures."""
    return RootCauses(items=_causes(stored))


@router.post("/causes/{cause_id}/apply", response_model=AppliedChanges)
def apply_cause(
    session_id: SessionId,
    cause_id: CauseId,
    idempotency: IdempotencyDep,
    store: StoreDep,
    queue: MeasuringQueueDep,
) -> Response:
    """Apply a root cause's remedy to the session; solve it again afterwards."""
    from calib_core.causes.apply import cause_named

    repeated = idempotency.answered(store, {"apply": cause_id})
    if repeated is not None:
        return repeated
    with store.read() as db:
        before = load_session(db, store.blobs, session_id)
    cause = cause_named(_causes(before), cause_id)
    found = cause.changes
    if found is None:
        need = "a root cause with a remedy"
        raise ConflictError(need, "'{cause}', which has none", cause.sentence, "cause", cause=cause.id)

    def act(db: Transaction) -> Data:
        locked_session(db, session_id)
        stored = load_session(db, store.blobs, session_id)
        if stored.session != before.session:
            to_do = message("Look at the causes again.")
            raise ConflictError("a session that rests", "one that was just changed", to_do, session_id)
        return apply_changes(db, stored, found)

    answer = idempotency.run(store, {"apply": cause_id}, 200, act)[0]
    queue.wake()
    return answer


@router.post("/changes", response_model=AppliedChanges)
def change_together(
    session_id: SessionId,
    body: ChangesRequest,
    idempotency: IdempotencyDep,
    store: StoreDep,
    queue: MeasuringQueueDep,
) -> Response:
    """Change the cell and captures together, all or nothing; what undoes a remedy is sent here."""
    changes = Changes(cell=body.cell, captures=body.captures)

    def act(db: Transaction) -> Data:
        locked_session(db, session_id)
        return apply_changes(db, load_session(db, store.blobs, session_id), changes)

    answer = idempotency.run(store, body.to_json(), 200, act)[0]
    queue.wake()
    return answer


def _causes(stored: Loaded) -> list[RootCause]:
    from calib_core.causes.session import session_causes

    results = stored.results_with_stale()
    stale = [stage for stage, result in results.items() if result.get("stale")]
    return session_causes(stored.session, stored.reader, results, stale)
