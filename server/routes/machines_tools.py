"""The tool of an answer and a controller's own files: put into a backup, and compared with what stands there."""

from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Form, Path, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.concurrency import run_in_threadpool

from calib_core.errors import InputError
from calib_core.records.faults import MOST_TEXT, allowed_faults
from server.http.api_router import api_router
from server.http.openapi import BYTES
from server.http.strict_json import parse_object, plain_json
from server.routes.dependencies import IdempotencyDep, SessionId, StoreDep, UploadMemoryDep
from server.routes.machine_files import Files, Word, contents_of, size_of
from server.store.session_answer import answer_headers, session_answer
from server.store.sessions import load_session
from server.store.standing import with_moment

router = api_router("machines")

_BINARY = {"*/*": {"schema": BYTES}}


class ToolComparison(BaseModel):
    """The tool as it stands in the controller beside the answer."""

    equal: bool
    words: str
    position_mm: float | None
    rotation_deg: float | None
    faults: list[str] = Field(description="What speaks against using the answer: `stale`, `fail`, or both.")


@router.post(
    "/sessions/{session_id}/exports/{name}",
    response_class=Response,
    responses={200: {"description": "The file that was changed.", "content": _BINARY}},
)
async def export_into_backup(
    session_id: SessionId,
    name: Annotated[str, Path(max_length=64, description="As `GET /exports` lists them.", examples=["kuka"])],
    backup: Files,
    _: IdempotencyDep,
    store: StoreDep,
    memory: UploadMemoryDep,
    settings: Annotated[
        str, Form(max_length=5000, description="The export's settings, as JSON.", examples=['{"tool": 3}'])
    ] = "{}",
    allow: Annotated[str, Form(max_length=MOST_TEXT, description="Names of faults, with commas between.")] = "",
) -> Response:
    """Return the file of a backup that defines the tool, with that one entry changed and every other byte kept.

    Of several files it is the one that holds the entry; a zip comes back with that one file in it changed.
    """
    from calib_core.exports.backups import write_into

    async with memory.taken(size_of(backup)):
        contents = await contents_of(backup)

        def written() -> tuple[str, bytes, dict[str, str]]:
            with store.read() as db:
                answer = session_answer(db, load_session(db, store.blobs, session_id))
                answer = with_moment(db, answer, session_id)
            chosen = parse_object(settings, "settings")
            file, content = write_into(contents, answer, name, allowed_faults(allow), chosen)
            return file, content, dict(answer_headers(answer))

        file, content, headers = await run_in_threadpool(written)
    plain = quote(file.replace("\\", "/").rsplit("/", 1)[-1])
    headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{plain}"
    return Response(content, media_type="application/octet-stream", headers=headers)


@router.post("/sessions/{session_id}/read-back", response_model=ToolComparison)
async def read_back_tool(
    session_id: SessionId,
    _: IdempotencyDep,
    store: StoreDep,
    memory: UploadMemoryDep,
    files: Files = [],  # noqa: B006 — FastAPI copies defaults
    tool: Word = "",
    brand: Word = "",
    numbers: Annotated[
        str, Form(max_length=1000, description="As the pendant shows them.", examples=["0 0 184 0 45 0"])
    ] = "",
    convention: Word = "",
) -> Response:
    """Compare the tool in the controller, of its files or as numbers, with the answer: equal, or what differs."""
    async with memory.taken(size_of(files)):
        contents = await contents_of(files) if files else {}

        def compared() -> tuple[dict[str, Any], dict[str, str]]:
            from calib_core.review.in_controller import compared_with

            with store.read() as db:
                answer = session_answer(db, load_session(db, store.blobs, session_id))
            if bool(numbers.strip()) == bool(contents):
                to_do = "Name one of these."
                raise InputError("the controller's files or numbers", "both or neither", to_do, "read-back")
            found = compared_with(
                answer,
                numbers=numbers,
                convention=convention or None,
                files=contents,
                brand=brand or None,
                named=tool or None,
            )
            return found.to_json(), dict(answer_headers(answer))

        found, headers = await run_in_threadpool(compared)
    return JSONResponse(plain_json(found), headers=headers)
