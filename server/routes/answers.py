"""The answer of a session: for programs that act on it, and in other programs' syntax."""

from typing import Annotated

from fastapi import Path, Query, Response
from fastapi.responses import JSONResponse

from calib_core.archive.seals import digest_of
from calib_core.errors import InputError
from calib_core.records.faults import MOST_TEXT, allowed_faults
from calib_core.review.answer import SessionAnswer
from calib_core.review.cell_frames import SessionFrames
from server.http.api_router import API, api_router
from server.http.language import spoken
from server.http.openapi import BYTES
from server.http.strict_json import parse_object, plain_json
from server.routes.dependencies import LoadedSession, SessionId, StoreDep
from server.store.session_answer import answer_headers, session_answer
from server.store.sessions import load_session
from server.store.standing import with_moment

router = api_router("answers", f"{API}/sessions/{{session_id}}")

_HEADERS = {
    "Scancell-Faults": {
        "description": "Names of faults with commas between, or empty.",
        "schema": {"type": "string"},
    },
    "Scancell-Stale": {"description": "`true` where inputs have changed since.", "schema": {"type": "string"}},
    "Scancell-Verdict": {"description": "`pass`, `warn` or `fail`.", "schema": {"type": "string"}},
}
_PROOF = {
    "Scancell-Proof": {
        "description": "What proved that the other program takes it, as `GET /exports` says; none: own forms.",
        "schema": {"type": "string"},
    }
}
_BINARY = {"*/*": {"schema": BYTES}}

Allow = Annotated[
    str,
    Query(
        max_length=MOST_TEXT,
        description="Names of faults, such as `stale,verify-fail`, in spite of which it is given, marked.",
    ),
]


Settings = Annotated[
    str,
    Query(
        max_length=5000,
        description="The export's settings as JSON, by the schema in `GET /exports`.",
        examples=['{"part": "tool"}'],
    ),
]


@router.get("/answer", response_model=SessionAnswer)
def get_answer(session_id: SessionId, store: StoreDep) -> Response:
    """Return the session's answer, of `chain` or else `tcp`: frames, covariance, verdict, hashes, and `stale`.

    It is given as it is; `faults` says what speaks against acting on it.
    """
    from calib_core.review.answer import answer_as_read, answer_record

    with store.read() as db:
        answer = session_answer(db, load_session(db, store.blobs, session_id))
        answer = with_moment(db, answer, session_id)
    headers = answer_headers(answer)
    read = answer_as_read(answer_record(answer), spoken().language, answer.session.cell.findings)
    body = plain_json(read.to_json())
    tag = f'"{digest_of(body)[:32]}"'
    return JSONResponse(body, headers={**headers, "ETag": tag})


FrameName = Annotated[str | None, Query(max_length=20, examples=["base"])]


@router.get("/frames", response_model=SessionFrames)
def get_frames(
    stored: LoadedSession,
    into: FrameName = None,
    outof: FrameName = None,
    capture: Annotated[str | None, Query(max_length=64, description="Whose robot pose counts.")] = None,
) -> SessionFrames:
    """Return the cell's transforms: measured, known, solved or sought; and `into_from_outof`, where asked for."""
    from calib_core.review.cell_frames import session_frames

    if (into is None) != (outof is None):
        raise InputError("into and outof together, or none", "one of them", "Name both frames.", "into")
    asked = None if into is None or outof is None else (into, outof)
    return session_frames(stored.session, stored.results, stored.stale, asked, capture)


@router.get(
    "/exports/{name}",
    response_class=Response,
    responses={
        200: {
            "description": "The file, in the format's own media type.",
            "content": _BINARY,
            "headers": {**_HEADERS, **_PROOF},
        }
    },
)
def export_results(
    session_id: SessionId,
    name: Annotated[str, Path(max_length=64, description="As `GET /exports` lists them.", examples=["json"])],
    store: StoreDep,
    allow: Allow = "",
    settings: Settings = "{}",
) -> Response:
    """Return the calibrated tool and table in a format's syntax; with faults of its own it is refused."""
    from calib_core.archive.stored_clouds import media_types
    from calib_core.exports.export import write_export
    from calib_core.exports.registry import export_named

    allowed = allowed_faults(allow)
    export_named(name, tuple(media_types()))  # that there is no such format comes first
    chosen = parse_object(settings, "settings")
    with store.read() as db:
        answer = session_answer(db, load_session(db, store.blobs, session_id))
        answer = with_moment(db, answer, session_id)
    content, entry = write_export(answer, name, allowed, chosen)
    headers = {**answer_headers(answer), **({} if entry.proof is None else {"Scancell-Proof": entry.proof})}
    return Response(content, media_type=entry.media_type, headers=headers)
