"""Captures: received, measured, stored; corrected; their files given back."""

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, File, Form, Path, Response, UploadFile
from fastapi.responses import JSONResponse
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError, ConflictError, DamagedError, InputError, TooLargeError
from calib_core.records import Capture, Measured, Session, Step, parse_capture
from server.http.dependencies import (
    Again,
    CaptureId,
    Cursor,
    IdempotencyDep,
    IfMatch,
    IntakeDep,
    Limit,
    MeasuringDep,
    RoomDep,
    SessionId,
    SettingsDep,
    StoreDep,
)
from server.http.downloads import Download
from server.http.idempotency import Idempotency
from server.http.json_text import JsonText
from server.http.schemas import CaptureChanges, CapturePage, StoredCapture
from server.http.strict_json import StrictRoute, parse_json
from server.http.uploads import digests_of, named_files
from server.jobs.measuring import check_poses
from server.jobs.measuring_processes import Measuring
from server.sources.intake import MOST_BYTES, is_simple
from server.sources.receiving import receive
from server.sources.simulated import capture_again, next_capture
from server.store.arrivals import add_captures
from server.store.calibrations import Calibrated, calibrated, needs_calibration
from server.store.captures import (
    capture_data,
    capture_ids,
    capture_row,
    change_capture,
    file_digest,
    list_captures,
    remove_capture,
)
from server.store.database import Store
from server.store.models import Data, SessionRow
from server.store.sessions import (
    empty_session,
    etag,
    load_session,
    locked_session,
    merge_patch,
    require_revision,
    session_row,
    unused,
)

router = APIRouter(prefix="/sessions/{session_id}", tags=["captures"], route_class=StrictRoute)

FileName = Annotated[str, Path(examples=["captures/p01.csv"])]

_RECORD_EXAMPLE = (
    '{"id": "p01", "step": "tcp", "kind": "profile", "files": ["captures/p01.csv"], '
    '"pose": [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]}'
)


@router.post("/captures", status_code=201, response_model=StoredCapture)
async def add(
    session_id: SessionId,
    record: Annotated[
        str,
        Form(description="The capture's record, as JSON.", max_length=1_000_000, examples=[_RECORD_EXAMPLE]),
    ],
    idempotency: IdempotencyDep,
    store: StoreDep,
    measuring: MeasuringDep,
    room: RoomDep,
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
        raise InputError("a JSON object as the record", type(data).__name__, "Send one capture.", "record")
    if len(files) > settings.max_files_per_capture:
        raise TooLargeError(
            f"at most {settings.max_files_per_capture} files", f"{len(files)}", "Split the capture.", "files"
        )
    data.pop("measured", None)  # of a record that came from here
    size_bytes = sum(file.size or 0 for file in files)

    def contents_of_upload() -> tuple[Capture, dict[str, bytes]]:
        contents = named_files(data, [(file.filename or "", file.file.read()) for file in files])
        return parse_capture(data, "record"), contents

    def store_large() -> Response:
        with room.taken(size_bytes):
            return _store(store, measuring, idempotency, session_id, *contents_of_upload())

    if size_bytes > MOST_BYTES:
        return await run_in_threadpool(store_large)
    capture, contents = contents_of_upload()
    if is_simple(capture):
        return await intake.take(idempotency, session_id, capture, contents)
    return await run_in_threadpool(_store, store, measuring, idempotency, session_id, capture, contents)


@router.post("/sources/simulated/capture", status_code=201, response_model=StoredCapture)
def take_simulated(
    session_id: SessionId,
    idempotency: IdempotencyDep,
    store: StoreDep,
    measuring: MeasuringDep,
    step: Step | None = None,
    again: Again = None,
) -> Response:
    """Let the simulated cell take its next capture, one of `step` where some are left; or one of its own `again`.

    What is taken again has a name of its own (`p05-again`); arm and scanner err anew.
    """
    content = f"again {again}" if again else f"next {step}" if step else "next"
    answered = idempotency.answered(store, content)
    if answered is not None:
        return answered
    with store.read() as db:
        row = session_row(db, session_id)
        if row.simulated is None:
            raise ConflictError(
                "a session of the simulated cell", "one of a real cell", "Upload captures to it.", session_id
            )
        device, taken = dict(row.simulated), capture_ids(db, session_id)
    scenario, seed = device["scenario"], device["seed"]
    if again:
        capture, contents = capture_again(scenario, seed, taken, again)
    else:
        capture, contents = next_capture(scenario, seed, taken, step)
    return _store(store, measuring, idempotency, session_id, capture, contents, content=content)


def _store(
    store: Store,
    measuring: Measuring,
    idempotency: Idempotency,
    session_id: str,
    capture: Capture,
    contents: Mapping[str, bytes],
    content: Any = None,
) -> Response:
    content = content or [capture.to_json(), digests_of(contents)]
    answered = idempotency.answered(store, content)
    if answered is not None:
        return answered
    arrival, record = receive(store, measuring, session_id, capture, contents)

    def act(db: Transaction) -> JsonText:
        (stored,) = add_captures(db, session_id, [arrival], record)
        if isinstance(stored, CalibrationError):
            raise stored
        return stored

    answer, _ = idempotency.run(store, content, 201, act)
    return answer


@router.get("/captures", response_model=CapturePage)
def list_all(session_id: SessionId, store: StoreDep, limit: Limit = 200, cursor: Cursor = None) -> Response:
    """List captures in the order of their arrival, with what was measured."""
    with store.read() as db:
        session_row(db, session_id)
        return Response(list_captures(db, session_id, limit, cursor), media_type="application/json")


@router.get("/captures/{capture_id}", response_model=StoredCapture)
def get(session_id: SessionId, capture_id: CaptureId, store: StoreDep) -> Response:
    """Return a capture with what was measured in it."""
    with store.read() as db:
        session_row(db, session_id)
        row = capture_row(db, session_id, capture_id)
        return JSONResponse(capture_data(row), headers={"ETag": etag(row)})


@router.patch("/captures/{capture_id}", response_model=StoredCapture)
def change(
    session_id: SessionId,
    capture_id: CaptureId,
    body: CaptureChanges,
    store: StoreDep,
    measuring: MeasuringDep,
    if_match: IfMatch = None,
) -> Response:
    """Correct a capture's record; its files stay as they came."""
    changes = {name: value for name, value in body.model_dump(exclude_unset=True).items() if name != "measured"}
    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
        before = capture_row(db, session_id, capture_id)
        record, revision, measured_before = before.record, before.revision, before.measured
    capture = _changed(record, changes)
    check_poses(stored.session, capture)
    frames = calibrated(stored) if needs_calibration(capture) else Calibrated(stored.session, ())
    try:
        measured = frames.told(measuring.measure(frames.session, capture, stored.read))
    except DamagedError:
        if set(changes) != {"excluded"}:
            raise
        # What the disk has spoiled can still be left out: that is what makes the others count again.
        measured = Measured.model_validate(measured_before)
    with store.write() as db:
        session = locked_session(db, session_id)
        _require_same_cell(session, stored.session)
        row = capture_row(db, session_id, capture_id)
        require_revision(row, if_match)
        if row.revision != revision:
            raise ConflictError("a capture that rests", "one that was just changed", "Send the change again.")
        change_capture(db, session, row, capture.to_json(), measured)
        answer, tag = capture_data(row), etag(row)
    return JSONResponse(answer, headers={"ETag": tag})


def _require_same_cell(row: SessionRow, session: Session) -> None:
    """Refuse what was measured for a cell that was changed meanwhile."""
    if empty_session(row.record, row.id).cell != session.cell:
        raise ConflictError("a cell that rests", "one that was just changed", "Send the request again.", "cell")


def _changed(record: Data, changes: Data) -> Capture:
    for name in ("id", "files", "kind"):
        if name in changes and changes[name] != record.get(name):
            raise InputError(
                f"the '{name}' that the capture came with",
                "another",
                "Remove the capture and upload it again.",
                name,
            )
    return parse_capture(merge_patch(record, changes), "request")


@router.delete("/captures/{capture_id}", status_code=204)
def delete(session_id: SessionId, capture_id: CaptureId, store: StoreDep, if_match: IfMatch = None) -> None:
    """Remove a capture with its files, for good; to leave it out of solves, set `excluded` instead."""
    with store.write() as db:
        session = locked_session(db, session_id)
        row = capture_row(db, session_id, capture_id)
        require_revision(row, if_match)
        digests = remove_capture(db, session, row)
    with store.read() as db:
        digests = unused(db, digests)
    store.blobs.remove(digests)


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
