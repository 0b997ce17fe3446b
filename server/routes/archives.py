"""Archives and reports: a session out as one file, and an archive in."""

import threading
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import suppress
from typing import IO, TYPE_CHECKING, Annotated, Any, Literal

from fastapi import Depends, Header, HTTPException, Query, Request, Response
from fastapi.responses import HTMLResponse
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import UploadFile

from calib_core.archive.archive import REPORT_FILE, SCENE_FILE, ArchiveFacts, archive_name
from calib_core.archive.dates import ANSWER_FILE
from calib_core.archive.folder import to_json_bytes
from calib_core.archive.release_file import RELEASE_FILE, acknowledged_told, release_bytes, release_told
from calib_core.errors import CalibrationError, InputError
from calib_core.exports.answer import Answer
from calib_core.messages import message
from calib_core.review.answer import answer_record
from calib_core.review.standing import said_acknowledgement, said_signed
from server.http.api_router import api_router
from server.http.created import created
from server.http.downloads import Download
from server.http.language import spoken
from server.http.openapi import BYTES
from server.http.schemas import StoredSession
from server.routes.dependencies import IdempotencyDep, JobsDep, MeasuringDep, SessionId, StoreDep
from server.store.archived_files import archived_files
from server.store.blobs import digest_of
from server.store.models import Data
from server.store.releases import release_of
from server.store.session_answer import answer_headers, session_answer
from server.store.sessions import StoredSession as SessionOfStore
from server.store.sessions import load_session, session_data, session_row
from server.store.solves import REPLAY, create_job
from server.store.standing import acknowledgements_of, with_moment

if TYPE_CHECKING:
    from server.render.report.first_page import Circumstances

router = api_router("archives")

_PDF = "application/pdf"
_PRINTER = threading.BoundedSemaphore(1)
_WAIT_FOR_PRINTER_S, _LONGEST_PRINT_S = 20.0, 60.0
_ZIP: dict[str, Any] = {"schema": BYTES}
_FORM: dict[str, Any] = {"$ref": "#/components/schemas/ArchiveUpload"}
_FORM_EXAMPLES: dict[str, Any] = {
    "form": {
        "summary": "The file that `scancell archive pack` wrote: curl -F file=@cell-4.zip",
        "value": {"file": "PK"},
    }
}
# Generators of clients cannot take a body of two types: the second, the bare file, is told beside the first.
_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "description": "Or the archive itself as the body, of the type application/zip.",
        "content": {"multipart/form-data": {"schema": _FORM, "examples": _FORM_EXAMPLES}},
    },
    "x-raw-body": "application/zip",
}


async def arrived(request: Request, store: StoreDep) -> AsyncGenerator[IO[bytes]]:
    """Give the archive that a request brings, as its body or as the file of a form; raises InputError."""
    if request.headers.get("content-type", "").startswith("multipart/form-data"):
        async with request.form(max_files=1, max_fields=10) as form:
            upload = next((part for part in form.values() if isinstance(part, UploadFile)), None)
            if upload is None:
                to_do = "Send it as the part `file`."
                raise InputError("an archive, a .zip file", "a form without a file", to_do, "request")
            yield upload.file
        return
    with store.blobs.scratch() as file:
        async for chunk in request.stream():
            await run_in_threadpool(file.write, chunk)
        file.seek(0)
        yield file


ArchiveDep = Annotated[IO[bytes], Depends(arrived)]


@router.get(
    "/sessions/{session_id}/archive",
    response_class=Response,
    responses={200: {"description": "The archive, a zip.", "content": {"application/zip": _ZIP}}},
)
def get_archive(
    session_id: SessionId,
    store: StoreDep,
    scene: Annotated[bool, Query(description="With the 3-D scene as a page of its own.")] = True,
) -> Download:
    """Return the session as one zip that still computes years later: record, files, results, past, pages."""
    from server.store.archived_history import HISTORY_FILE, history_bytes
    from server.store.archives import pack_stored

    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
        kept, past = archived_files(db, session_id), history_bytes(db, session_id)
        answer = _answer(db, stored)
        released, acknowledged = _release(db, stored, answer), _acknowledged(db, stored, answer)
    file = store.blobs.scratch()
    try:
        about = _circumstances(stored, answer, release=released, acknowledged=acknowledged)
        signed = _release_file(answer, released, acknowledged)
        pages = {**_pages(stored, about, scene), **_answer_file(answer), **signed}
        pack_stored(stored, kept, file, {**pages, HISTORY_FILE: past})
        size = file.seek(0, 2)
    except BaseException:
        file.close()
        raise
    headers = {
        "Content-Length": str(size),
        "Content-Disposition": f'attachment; filename="{archive_name(stored.session)}.zip"',
        **_marks(answer),
    }
    return Download(file, "application/zip", headers)


@router.post("/archives", status_code=201, response_model=StoredSession, openapi_extra=_BODY)
def import_archive(
    archive: ArchiveDep, idempotency: IdempotencyDep, store: StoreDep, measuring: MeasuringDep, jobs: JobsDep
) -> Response:
    """Make a session from an archive, with its captures and results; what is wrong with it leaves nothing behind.

    Its results are solved anew at once, by a job (`replay`), to see whether they are what its captures give; until
    then those that nobody who is trusted here has signed are `imported`, and no answer to export or release.

    What else it holds (scene, report, truth, notes) is kept as it came: GET …/kept.
    """
    from server.store.archives import add_import, read_import

    content = digest_of(archive)
    answered = idempotency.answered(store, content)
    if answered is not None:
        return answered
    found = read_import(archive, store.blobs, measuring.measure)

    replays: list[str] = []

    def act(db: Any) -> Data:
        row = add_import(db, found)
        if found.results:
            replays.append(create_job(db, row, REPLAY).id)
        return session_data(db, row)

    answer, first = idempotency.run(store, content, 201, act)
    for job in replays if first else ():
        jobs.submit(job)
    return created(answer, "/api/v1/sessions/{id}")


@router.post("/archives/verify", response_model=ArchiveFacts, openapi_extra=_BODY)
def verify_archive(archive: ArchiveDep, _: IdempotencyDep) -> ArchiveFacts:
    """Check that an archive is whole and a session, who signed it, and that its files agree; stores nothing."""
    from calib_core.review.provenance import verify

    return verify(archive, "archive")


@router.get(
    "/sessions/{session_id}/report",
    response_class=HTMLResponse,
    responses={200: {"content": {_PDF: {"schema": BYTES}}}},
)
def get_report(
    session_id: SessionId,
    store: StoreDep,
    accept: Annotated[str, Header()] = "",
    form: Annotated[
        Literal["html", "pdf"] | None, Query(alias="format", description="Left out: as `Accept` asks for it.")
    ] = None,
    paper: Annotated[Literal["A4", "letter"], Query(description="What it is laid out for.")] = "A4",
) -> Response:
    """Return the session's report: one page that needs nothing else and can be printed, or as PDF.

    The server's own Chromium, Chrome or Edge prints the PDF; without one the answer is 422 and says so.
    """
    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
        answer = _answer(db, stored)
        answer = answer and with_moment(db, answer, session_id)
        about = _circumstances(
            stored,
            answer,
            release=_release(db, stored, answer),
            acknowledged=_acknowledged(db, stored, answer),
            language=spoken(),
            paper=paper,
        )
    page = _report(stored, about, with_truth=True)
    headers = {**_marks(answer), "Vary": "Accept"}
    if form == "pdf" or (form is None and _asks_for_pdf(accept)):
        headers["Content-Disposition"] = f'inline; filename="{session_id}-report.pdf"'
        return Response(_printed(page), media_type=_PDF, headers=headers)
    return HTMLResponse(page, headers=headers)


def _asks_for_pdf(accept: str) -> bool:
    """Return whether a client wants PDF and takes no page."""
    wanted = [part.partition(";")[0].strip().lower() for part in accept.split(",")]
    return _PDF in wanted and "text/html" not in wanted


def _printed(page: str) -> bytes:
    """Return a page as PDF; one is printed at a time, as each takes a browser."""
    from server.render.pdf import pdf_of

    if not _PRINTER.acquire(timeout=_WAIT_FOR_PRINTER_S):
        raise HTTPException(503, "other reports are being printed")
    try:
        return pdf_of(
            page, "report", _LONGEST_PRINT_S, message("Get the report as HTML, and print that from a browser.")
        )
    finally:
        _PRINTER.release()


def _answer(db: Transaction, stored: SessionOfStore) -> Answer | None:
    """Return a session's answer, None where it has none yet or its numbers cannot be used."""
    try:
        return session_answer(db, stored)
    except CalibrationError:
        return None


def _answer_file(answer: Answer | None) -> dict[str, bytes]:
    return {} if answer is None else {ANSWER_FILE: to_json_bytes(answer_record(answer).to_json())}


def _marks(answer: Answer | None) -> Mapping[str, str]:
    return {} if answer is None else answer_headers(answer)


def _release(db: Transaction, stored: SessionOfStore, answer: Answer | None) -> Data | None:
    """Return the release of an answer: that of this server, else what the archive that it came with tells."""
    if answer is None:
        return None
    released = release_of(db, stored.id, answer_record(answer))
    if released is None and RELEASE_FILE in stored.kept:
        return release_told(stored.blobs.read(stored.kept[RELEASE_FILE]), stored.results, answer.date)
    return released


def _acknowledged(db: Transaction, stored: SessionOfStore, answer: Answer | None) -> list[Data]:
    """Return who acknowledged what, on this server and as the archive tells that the session came with."""
    file = stored.kept.get(RELEASE_FILE) if answer else None
    content = stored.blobs.read(file) if file else b""
    brought = acknowledged_told(content, stored.results, answer.date if answer else "")
    return acknowledgements_of(db, session_row(db, stored.id), brought)


def _release_file(answer: Answer | None, release: Data | None, acknowledged: Sequence[Data]) -> dict[str, bytes]:
    """Return what is signed here: the answer's release, what was acknowledged; an archive's own goes on."""
    own = [one for one in acknowledged if "cell" in one]
    if answer is None or not (own or release):
        return {}
    if release is None:
        told = answer_record(answer).to_json()
        release = {name: told[name] for name in ("cell", "solved", "inputs_sha256")} | {"signed": True}
    is_ours = "cell" in release and release["signed"]  # no archive's, and as it was stored
    return {RELEASE_FILE: release_bytes(release, own)} if is_ours else {}


def _circumstances(stored: SessionOfStore, answer: Answer | None, **more: Any) -> "Circumstances":
    from server.render.report.first_page import Circumstances

    said = [said_signed(said_acknowledgement(one), one) for one in more.pop("acknowledged")]
    known: Any = {"digests": stored.kept, "read": stored.read, "acknowledged": said, **more}
    if answer is None:
        return Circumstances(**known)
    before, moment = answer.decided_before, answer.all_faults  # its results know nothing of what was taken out
    return Circumstances(solved=answer.date, decided_before=before, of_moment=moment, **known)


def _report(stored: SessionOfStore, about: "Circumstances", *, with_truth: bool) -> str:
    from server.render.report.report import report_html

    truth = None
    if with_truth and stored.simulated is not None and stored.results:
        from server.sources.simulated import truth_of

        truth = truth_of(stored.simulated)
    return report_html(stored.session, stored.results, stored.stale, truth, about)


def _pages(stored: SessionOfStore, about: "Circumstances", with_scene: bool) -> dict[str, bytes]:
    # Measurements and results go out even where they cannot be shown.
    pages: dict[str, bytes] = {}
    with suppress(CalibrationError):
        pages[REPORT_FILE] = _report(stored, about, with_truth=False).encode()  # as whoever imports it makes it
    if with_scene:
        from server.scenes.offline import scene_html
        from server.scenes.stored import scene_of

        with suppress(CalibrationError):
            scene = scene_of(stored)
            pages[SCENE_FILE] = scene_html(scene).encode()
    return pages
