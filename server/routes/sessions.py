"""Sessions."""

import asyncio
import json
from collections.abc import AsyncIterator
from dataclasses import asdict
from typing import Annotated, Any

from fastapi import Query, Response
from fastapi.responses import JSONResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent

from calib_core.cell.consistency import require_consistent
from calib_core.errors import InputError
from calib_core.findings import findings_as_read, guide_as_read
from calib_core.records import Guide, parse_session
from calib_core.records.strict_fields import require_known_fields
from server.captures.changes import corrected_session, require_rigid
from server.http.api_router import API, api_router
from server.http.created import created
from server.http.events import follow, to_sse
from server.http.language import spoken
from server.http.schemas import (
    Findings,
    PoseLine,
    PoseLines,
    PoseText,
    SessionChanges,
    SessionPage,
    SessionRequest,
    StoredSession,
)
from server.http.strict_json import plain_json
from server.routes.dependencies import (
    Cursor,
    ExistingSession,
    GuidesDep,
    HubDep,
    IdempotencyDep,
    IfMatch,
    IntakeDep,
    JobsDep,
    LastEventId,
    Limit,
    LoadedSession,
    MeasuringDep,
    MeasuringQueueDep,
    SessionId,
    StoreDep,
)
from server.routes.tokens import IdentityDep
from server.sources.simulated import simulated_session
from server.store.equipment import keep_certificates, with_registered
from server.store.models import Data
from server.store.sessions import (
    STORE_FIELDS,
    create_session,
    delete_session,
    etag,
    list_sessions,
    locked_session,
    require_revision,
    session_data,
    session_row,
)
from server.store.solves import unfinished_jobs
from server.store.standing import require_evidence_kept
from server.store.unreferenced import remove_unreferenced

router = api_router("sessions", f"{API}/sessions")


@router.post("", status_code=201, response_model=StoredSession)
def create(body: SessionRequest, idempotency: IdempotencyDep, store: StoreDep) -> Response:
    """Make a session, of a real cell or of the simulated one."""
    record = {name: value for name, value in body.to_json().items() if name not in STORE_FIELDS}
    simulated = None
    if body.simulated is not None:
        simulated = body.simulated.model_dump(mode="json", exclude_unset=True, exclude_none=True)
        simulated |= {"scenario": body.simulated.scenario, "seed": body.simulated.seed}
        device = simulated_session(simulated).session
        record = {**device.to_json(), **record, "captures": []}
    elif record.get("captures"):
        raise InputError("a session without captures", "some", "Send each capture by itself.", "captures")
    require_known_fields(body, "request", STORE_FIELDS | {"captures"})
    parsed = parse_session({**record, "captures": []}, "request")
    require_rigid(parsed.cell)
    require_consistent(parsed.cell)

    def act(db: Any) -> Data:
        session = with_registered(db, parsed)
        record = {name: value for name, value in session.to_json().items() if name != "captures"}
        row = create_session(db, record, simulated)
        keep_certificates(db, store.blobs, row.id, session.cell.equipment or ())
        return session_data(db, row)

    answer, _ = idempotency.run(store, body.to_json(), 201, act)
    return created(answer, "/api/v1/sessions/{id}")


@router.get("", response_model=SessionPage)
def list_all(
    store: StoreDep,
    limit: Limit = 50,
    cursor: Cursor = None,
    search: Annotated[
        str, Query(max_length=200, description="Part of the name, or the beginning of the SHA-256 on a report.")
    ] = "",
) -> Response:
    """List sessions, the newest first."""
    with store.read() as db:
        return JSONResponse(list_sessions(db, limit, cursor, search))


@router.get("/{session_id}", response_model=StoredSession)
def get(session_id: SessionId, store: StoreDep) -> Response:
    """Return a session with its captures' records."""
    with store.read() as db:
        row = session_row(db, session_id)
        return JSONResponse(session_data(db, row), headers={"ETag": etag(row)})


@router.patch("/{session_id}", response_model=StoredSession)
def change(
    session_id: SessionId,
    body: SessionChanges,
    identity: IdentityDep,
    store: StoreDep,
    queue: MeasuringQueueDep,
    measuring: MeasuringDep,
    if_match: IfMatch = None,
) -> Response:
    """Change a session's name or cell; captures are measured anew where the cell's change bears on them.

    Where there are more than a few, that happens after the answer; a `capture` event tells of each that is done.
    """
    changes = {n: v for n, v in body.model_dump(exclude_unset=True).items() if n not in STORE_FIELDS}
    if "captures" in changes:
        raise InputError("changes of the session", "captures", "Send each capture by itself.", "captures")
    answer, tag = corrected_session(store, measuring.measure, session_id, changes, if_match, identity.name)
    queue.wake()
    return JSONResponse(answer, headers={"ETag": tag})


@router.delete("/{session_id}", status_code=204)
def delete(
    session_id: SessionId, store: StoreDep, jobs: JobsDep, intake: IntakeDep, if_match: IfMatch = None
) -> None:
    """Remove a session with its captures and results, for good; one whose answer is in force is kept."""
    with store.write() as db:
        row = locked_session(db, session_id)
        require_revision(row, if_match)
        require_evidence_kept(db, row)
        unfinished = unfinished_jobs(db, session_id)
        digests = delete_session(db, session_id)
    for job_id in unfinished:
        jobs.end(job_id)
    intake.forget(session_id)
    remove_unreferenced(store, digests)


@router.get("/{session_id}/guide", response_model=Guide)
async def guidance(session_id: SessionId, guides: GuidesDep) -> Response:
    """Return what to do now and why, how many captures are still needed, and each step's status."""
    text = await asyncio.shield(asyncio.wrap_future(guides.ask(session_id)))
    if spoken().language != "en":
        return JSONResponse(guide_as_read(json.loads(text), spoken().language))
    return Response(text, media_type="application/json")


@router.get("/{session_id}/check", response_model=Findings)
def check(stored: LoadedSession) -> Findings:
    """Return what is wrong with the session and what is missing, worst first; an `error` blocks solving."""
    from calib_core.review.check import check_lines, check_session

    found = check_session(stored.session, stored.reader, stored.measured)
    read = findings_as_read(found, spoken().language, stored.session.cell.findings)
    blocks = any(finding.severity == "error" for finding in found)
    return Findings(findings=read, items=check_lines(read, spoken()), blocks_solving=blocks)


@router.post("/{session_id}/pose-lines", response_model=PoseLines)
def pose_lines(session_id: SessionId, body: PoseText, _: IdempotencyDep, store: StoreDep) -> Response:
    """Return what pasted pose lines say, to be looked at before they are used; stores nothing."""
    from calib_core.causes.likely import likely_columns, likely_convention
    from calib_core.records import Cell
    from calib_core.robots import parse_pose_lines

    with store.read() as db:
        cell = session_row(db, session_id).record["cell"]
    convention = body.convention or cell["pose_convention"]
    rows = parse_pose_lines(convention, body.text)
    items = [
        PoseLine(
            line=row.line,
            text=row.text,
            numbers=None if row.numbers is None else list(row.numbers),
            matrix=row.pose.to_rows() if row.pose else None,
            problem=row.problem,
        ).model_dump(exclude_none=True)
        for row in rows
    ]
    numbers = [row.numbers for row in rows if row.numbers is not None]
    read = Cell.model_validate({**cell, "pose_convention": convention})
    swapped = likely_columns(read, numbers)
    likely = None if swapped else likely_convention(read, numbers)
    told = {"likely_convention": likely and asdict(likely), "likely_columns": swapped and asdict(swapped)}
    return JSONResponse(plain_json({"items": items, **told}))


@router.get("/{session_id}/events", response_class=EventSourceResponse)
async def events(
    session_id: ExistingSession,
    store: StoreDep,
    hub: HubDep,
    last_event_id: LastEventId = None,
    alive_s: Annotated[
        float | None, Query(ge=0.2, le=60, description="Where nothing happens, `alive` so often.")
    ] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Stream what happens: `capture`, `result`, `job` and `session` events; begins with the newest one."""
    after = None if last_event_id is None else int(last_event_id)
    async for event in follow(store, hub, session_id, after, alive_s):
        yield to_sse(event)
