"""A session's past: its time line, each moment of it, every result; two results side by side; recomputing."""

import json
from typing import Annotated, Any

from fastapi import Path, Query, Response
from fastapi.responses import JSONResponse
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import CalibrationError, ConflictError, NotFoundError
from calib_core.messages import message
from calib_core.records import StageName as KnownStage
from calib_core.review.compare import Comparison
from server.auth.roles import Role
from server.http.api_router import api_router
from server.http.created import created
from server.http.schemas import Job
from server.http.schemas_history import MomentOfSession, Recomputed, ResultHistory, Timeline
from server.http.schemas_results import StageResult
from server.page_questions import guide_text
from server.routes.dependencies import (
    IdempotencyDep,
    JobId,
    JobsDep,
    PageProcessDep,
    SessionId,
    StageName,
    StoreDep,
)
from server.routes.tokens import IdentityDep
from server.store.history import PastResult, compared, latest_numbers, moment, past_result, stage_history, timeline
from server.store.models import Data
from server.store.session_texts import texts_of
from server.store.sessions import StoredSession, load_session, locked_session
from server.store.solves import COMPARE, REPLAY, create_job, job_data, job_row

router = api_router("history")

ResultNumber = Annotated[int, Path(ge=1, lt=2**31 - 1, description="A `number` in the history.", examples=[1])]
_SIDE = "SESSION or SESSION:NUMBER, a session's `id` with a result's `number`; without it the latest."
SideName = Annotated[str, Query(max_length=100, description=_SIDE)]


@router.get("/sessions/{session_id}/timeline", response_model=Timeline)
def get_timeline(session_id: SessionId, store: StoreDep) -> Response:
    """Return what happened in order: captures, results, solves that failed; the last item is how it stands now."""
    with store.read() as db:
        return JSONResponse({"items": timeline(db, store.blobs, session_id)})


@router.get("/sessions/{session_id}/timeline/{place}", response_model=MomentOfSession)
def get_moment(
    session_id: SessionId,
    place: Annotated[int, Path(ge=0, lt=2**31 - 1, description="An item's `place`.", examples=[3])],
    store: StoreDep,
    pages: PageProcessDep,
) -> Response:
    """Return the session as it stood at one place of its time line: record, captures, results, steps."""
    with store.read() as db:
        found = moment(db, store.blobs, session_id, place)
    now = json.loads(pages.ask(guide_text, texts_of(found.stored)))
    return JSONResponse({**_moment_data(found.stored, place, found.numbers), "guide": now})


@router.get("/sessions/{session_id}/results/{stage}/history", response_model=ResultHistory)
def get_history(session_id: SessionId, stage: StageName, store: StoreDep) -> Response:
    """List all results that a stage ever had, the newest first."""
    with store.read() as db:
        items = [_summary(result) for result in stage_history(db, session_id, stage)]
    return JSONResponse({"items": items})


@router.get("/sessions/{session_id}/results/{stage}/history/{number}", response_model=StageResult)
def get_past_result(session_id: SessionId, stage: StageName, number: ResultNumber, store: StoreDep) -> Response:
    """Return one result of a stage's history."""
    with store.read() as db:
        return JSONResponse(past_result(db, session_id, stage, number).record)


@router.get("/compare/{stage}", response_model=Comparison)
def compare(
    stage: Annotated[KnownStage, Path(examples=["tcp"])], left: SideName, right: SideName, store: StoreDep
) -> Response:
    """Return two results of a stage side by side, of one session or two: what differs, in units of its sigma."""
    from calib_core.review.compare import compare_results

    with store.read() as db:
        sides = [compared(db, store.blobs, stage, side) for side in (left, right)]
    return JSONResponse(compare_results(*sides).to_json())


@router.post("/sessions/{session_id}/replay", status_code=202, response_model=Job)
def recompute(
    session_id: SessionId, idempotency: IdempotencyDep, store: StoreDep, jobs: JobsDep, identity: IdentityDep
) -> Response:
    """Start solving every stage with a result afresh, to compare; no number of the session is changed.

    Answers at once with the job; its answer has the comparison. Imported results become `replayed` or `differs`
    by it, but for who may only read: then nothing is noted.
    """
    noted = identity.role >= Role.CAPTURE

    def act(db: Transaction) -> Data:
        if not latest_numbers(db, session_id):
            load_session(db, store.blobs, session_id)  # says so where there is no such session
            raise ConflictError("stored results to compare with", "none", "Solve the session first.", session_id)
        return job_data(create_job(db, locked_session(db, session_id), REPLAY if noted else COMPARE))

    answer, first = idempotency.run(store, "replay", 202, act)
    if first:
        jobs.submit(json.loads(bytes(answer.body))["id"])
    return created(answer, "/api/v1/jobs/{id}")


@router.get("/jobs/{job_id}/answer", response_model=Recomputed)
def get_answer(job_id: JobId, store: StoreDep) -> Response:
    """Return what a recomputing job found: stored and new side by side."""
    with store.read() as db:
        answer = job_row(db, job_id).answer
    if answer is None:
        got = message("one that has not ended well, or a solve")
        raise NotFoundError("a recomputing job that is done", got, "Wait for its end; read its `status`.", "job")
    return JSONResponse(answer)


def _summary(result: PastResult) -> Data:
    record = result.record
    rows = record.get("residuals") or []
    figures = {n: v for n, v in record.items() if isinstance(v, int | float) and not isinstance(v, bool)}
    return {
        "number": result.number,
        "created": result.created,
        **{name: record[name] for name in ("stage", "verdict", "method", "software", "inputs_sha256")},
        "captures": len(rows),
        "used": sum(bool(row["used"]) for row in rows),
        "figures": figures,
    }


def _moment_data(stored: StoredSession, place: int, numbers: Any) -> Data:
    results = stored.results_with_stale()
    captures = [{**c.to_json(), "measured": stored.measured[c.id].to_json()} for c in stored.session.captures]
    return {
        "place": place,
        "session": {**stored.session.to_json(), "captures": []},
        "captures": captures,
        "results": results,
        "numbers": dict(numbers),
        "frames": _frames(stored, [stage for stage, result in results.items() if result["stale"]]),
    }


def _frames(stored: StoredSession, stale: list[str]) -> Data | None:
    """Return tool and table as controllers write them, None where nothing is to be exported yet."""
    from calib_core.exports.export import export

    try:
        return json.loads(export(stored.session, stored.results, "json", stale)[0])
    except CalibrationError:
        return None
