"""Captures: received, measured, stored; corrected; their files given back."""

from collections.abc import Callable
from pathlib import PurePosixPath
from typing import Annotated
from urllib.parse import quote

from fastapi import File, Form, Path, Query, Response, UploadFile
from fastapi.responses import JSONResponse
from starlette.concurrency import run_in_threadpool

from calib_core.errors import InputError, TooLargeError
from calib_core.findings import measured_as_read
from calib_core.records import StepName, parse_capture
from calib_core.records.policy import Excluded
from calib_core.records.strict_fields import require_known_fields
from server.captures.changes import because_of, corrected_capture
from server.http.api_router import API, api_router
from server.http.created import created
from server.http.downloads import Download
from server.http.language import spoken
from server.http.schemas import CaptureChanges, CapturePage, StoredCapture
from server.http.strict_json import parse_json
from server.http.uploads import named_files
from server.routes.dependencies import (
    Again,
    CaptureId,
    Cursor,
    IdempotencyDep,
    IfMatch,
    IntakeDep,
    Limit,
    MeasuringDep,
    SessionId,
    SettingsDep,
    StoreDep,
    UploadMemoryDep,
)
from server.routes.tokens import IdentityDep
from server.sources.simulated import SOURCE as SIMULATED
from server.sources.simulated import SimulatedSettings
from server.sources.source import Occasion, Settings, Source, Taken
from server.store.captures import (
    capture_data,
    capture_ids,
    capture_row,
    file_digest,
    list_captures,
    remove_capture,
)
from server.store.database import Store
from server.store.models import Data, SessionRow
from server.store.releases import require_not_in_force
from server.store.sessions import empty_session, etag, locked_session, require_revision, session_row
from server.store.unreferenced import remove_unreferenced

router = api_router("captures", f"{API}/sessions/{{session_id}}")

FileName = Annotated[str, Path(examples=["captures/p01.csv"])]

_LONG_RECORD = 20_000  # characters: poses of a sweep; what is shorter is read sooner than another thread begins

_RECORD_EXAMPLE = (
    '{"id": "p01", "step": "tcp", "kind": "profile", "files": ["captures/p01.csv"], '
    '"pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]}'
)


@router.post("/captures", status_code=201, response_model=StoredCapture)
async def add(
    session_id: SessionId,
    record: Annotated[
        str, Form(description="The capture's record, as JSON.", max_length=1_000_000, examples=[_RECORD_EXAMPLE])
    ],
    idempotency: IdempotencyDep,
    memory: UploadMemoryDep,
    settings: SettingsDep,
    intake: IntakeDep,
    files: Annotated[
        list[UploadFile], File(description="The record's `files`, by name or in their order; none for centres.")
    ] = [],  # noqa: B006 — FastAPI copies defaults
) -> Response:
    """Store a capture and answer with what was measured in it.

    A capture in which nothing can be measured is kept, with the verdict `fail` and why; one whose record or files
    cannot be used at all is refused, and nothing of it is stored.
    """
    data = parse_json(record, "record")
    if not isinstance(data, dict):
        raise InputError("a JSON object as the record", type(data).__name__, "Send one at a time.", "record")
    if len(files) > settings.max_files_per_capture:
        need = "at most {most_files} files"
        raise TooLargeError(need, f"{len(files)}", "Split it.", "files", most_files=settings.max_files_per_capture)
    data.pop("measured", None)  # of a record that came from here
    async with memory.taken(sum(file.size or 0 for file in files)):
        contents = named_files(data, [(file.filename or "", await file.read()) for file in files])
        if len(record) > _LONG_RECORD:
            capture = await run_in_threadpool(parse_capture, data, "record")
        else:
            capture = parse_capture(data, "record")
        require_known_fields(capture, "record")
        return _created(session_id, await intake.take(session_id, capture, contents, idempotency), capture.id)


@router.post("/sources/simulated/capture", status_code=201, response_model=StoredCapture)
async def take_simulated(
    session_id: SessionId,
    idempotency: IdempotencyDep,
    store: StoreDep,
    intake: IntakeDep,
    step: StepName | None = None,
    again: Again = None,
    why: Annotated[str, Query(max_length=1000, description="Kept with what comes after a verification.")] = "",
) -> Response:
    """Let the simulated cell take its next capture, one of `step` where that is named; or one of its own `again`.

    What is taken again has a name of its own (`p05-again`); arm and scanner err anew.
    """
    content = f"again {again}" if again else f"next {step}" if step else "next"
    answered = await run_in_threadpool(idempotency.answered, store, content)
    if answered is not None:
        return created(answered, f"/api/v1/sessions/{session_id}/captures/{{id}}")
    chosen = SimulatedSettings(step=step, again=again)
    capture, contents = await run_in_threadpool(_triggered, store, session_id, SIMULATED, chosen)
    if why:
        capture = capture.model_copy(update={"added_because": Excluded(why=why)})
    return _created(session_id, await intake.take(session_id, capture, contents, idempotency, content), capture.id)


def _created(session_id: str, answer: Response, capture_id: str) -> Response:
    return created(answer, f"/api/v1/sessions/{session_id}/captures/{capture_id}", '"1"')


def _triggered(store: Store, session_id: str, source: Source, settings: Settings) -> Taken:
    """Return what a source takes for a session; raises CalibrationError."""
    assert source.trigger is not None
    with store.read() as db:
        row = session_row(db, session_id)
        session, taken = empty_session(row.record, session_id), capture_ids(db, session_id)
        device = dict(row.simulated or {})
    return source.trigger(Occasion(session, taken, device, settings))


@router.get("/captures", response_model=CapturePage)
def list_all(session_id: SessionId, store: StoreDep, limit: Limit = 200, cursor: Cursor = None) -> Response:
    """List captures in the order of their arrival, with what was measured."""
    with store.read() as db:
        read = _reader(session_row(db, session_id))
        return Response(list_captures(db, session_id, limit, cursor, read), media_type="application/json")


@router.get("/captures/{capture_id}", response_model=StoredCapture)
def get(session_id: SessionId, capture_id: CaptureId, store: StoreDep) -> Response:
    """Return a capture with what was measured in it."""
    with store.read() as db:
        read = _reader(session_row(db, session_id))
        row = capture_row(db, session_id, capture_id)
        return JSONResponse(capture_data(row, read or measured_as_read), headers={"ETag": etag(row)})


def _reader(session: SessionRow) -> Callable[[Data], Data] | None:
    """Return what reads a measurement in the language that is asked for, with the cell's own severities."""
    language, severities = spoken().language, session.record["cell"].get("findings")
    if language == "en" and not severities:
        return None
    return lambda measured: measured_as_read(measured, language, severities)


@router.patch("/captures/{capture_id}", response_model=StoredCapture)
def change(
    session_id: SessionId,
    capture_id: CaptureId,
    body: CaptureChanges,
    identity: IdentityDep,
    store: StoreDep,
    measuring: MeasuringDep,
    if_match: IfMatch = None,
) -> Response:
    """Correct a capture's record; its files stay as they came."""
    changes = {name: value for name, value in body.model_dump(exclude_unset=True).items() if name != "measured"}
    answer, tag = corrected_capture(
        store, measuring.measure, session_id, capture_id, changes, if_match, identity.name
    )
    return JSONResponse(answer, headers={"ETag": tag})


@router.delete("/captures/{capture_id}", status_code=204)
def delete(
    session_id: SessionId,
    capture_id: CaptureId,
    identity: IdentityDep,
    store: StoreDep,
    why: Annotated[str, Query(max_length=1000, description="Kept in the session once something is solved.")] = "",
    if_match: IfMatch = None,
) -> None:
    """Remove a capture with its files, for good; to leave it out of solves, set `excluded` instead."""
    with store.write() as db:
        session = locked_session(db, session_id)
        row = capture_row(db, session_id, capture_id)
        require_revision(row, if_match)
        require_not_in_force(db, session)
        digests = remove_capture(db, session, row, because_of(identity.name, why.strip()))
    remove_unreferenced(store, digests)


@router.get(
    "/captures/{capture_id}/files/{name:path}",
    response_class=Response,
    responses={200: {"description": "The file.", "content": {"application/octet-stream": {}}}},
)
def get_file(session_id: SessionId, capture_id: CaptureId, name: FileName, store: StoreDep) -> Download:
    """Return a file as it came, byte for byte; `name` as in the record's `files`, or its last part."""
    with store.read() as db:
        session_row(db, session_id)
        digest = file_digest(db, session_id, capture_id, name)
    file = store.blobs.open(digest)
    size = file.seek(0, 2)
    last = quote(PurePosixPath(name).name)
    return Download(
        file,
        "application/octet-stream",
        {
            "Content-Length": str(size),
            "ETag": f'"{digest}"',
            "Cache-Control": "private, max-age=31536000, immutable",
            "Content-Disposition": f"attachment; filename*=UTF-8''{last}",
        },
    )
