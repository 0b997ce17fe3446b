"""Solves: started, followed, cancelled; their results."""

import json
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Depends, Query, Response
from fastapi.responses import JSONResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool

from calib_core.errors import NotFoundError
from calib_core.findings.reading import as_read
from server.http.api_router import api_router
from server.http.events import ended_job, follow, to_sse
from server.http.idempotency import Idempotency
from server.http.schemas import Job, JobPage, JobStatus
from server.http.schemas_results import StoredResult
from server.jobs.jobs import Jobs
from server.routes.dependencies import (
    Cursor,
    HubDep,
    IdempotencyDep,
    JobId,
    JobsDep,
    LastEventId,
    Limit,
    SessionId,
    StageName,
    StoreDep,
)
from server.store.database import Store
from server.store.history import latest_numbers
from server.store.models import Data
from server.store.session_answer import decisions_before
from server.store.sessions import StoredSession, load_session, locked_session, session_row
from server.store.solves import ALL, ENDED, create_job, job_data, job_row, list_jobs

Wait = Annotated[float, Query(ge=0, le=120, description="Answer when it has ended, or after so many s.")]

router = api_router("solves")


@router.post(
    "/sessions/{session_id}/solve/{stage}",
    status_code=202,
    response_model=Job,
    responses={200: {"model": Job, "description": "It has ended within `wait` seconds."}},
)
async def solve(
    session_id: SessionId,
    stage: StageName,
    idempotency: IdempotencyDep,
    store: StoreDep,
    jobs: JobsDep,
    hub: HubDep,
    wait: Wait = 0,
) -> Response:
    """Start solving a stage, or `all` that there are captures for; the job's end brings the results."""
    answer = await run_in_threadpool(_start, session_id, stage, idempotency, store, jobs)
    job_id = json.loads(bytes(answer.body))["id"]
    headers = {"Location": f"/api/v1/jobs/{job_id}"}
    if not wait:
        answer.headers.update(headers)
        return answer
    job = await ended_job(store, hub, job_id, wait)
    return JSONResponse(job, 200 if job["status"] in ENDED else 202, headers)


def _start(session_id: str, stage: str, idempotency: Idempotency, store: Store, jobs: Jobs) -> Response:
    from calib_core.graph.keys import stage_captures
    from calib_core.stages.pipeline import stages_to_solve

    stages: list[str] = []

    def act(db: Transaction) -> Data:
        session = load_session(db, store.blobs, session_id).session
        if stage == ALL:
            stages.extend(stages_to_solve(session))
        else:
            stage_captures(session, stage)  # refuses an unknown stage
        return job_data(create_job(db, locked_session(db, session_id), stage))

    answer, first = idempotency.run(store, "solve", 202, act)
    if first:
        job_id = json.loads(bytes(answer.body))["id"]
        if stage == ALL:
            jobs.submit_all(job_id, stages)
        else:
            jobs.submit(job_id)
    return answer


@router.get("/jobs", response_model=JobPage)
def list_all(
    store: StoreDep,
    limit: Limit = 50,
    cursor: Cursor = None,
    session: Annotated[str | None, Query(max_length=64, description="Of this session alone.")] = None,
    status: Annotated[JobStatus | None, Query(description="Of this status alone.")] = None,
) -> Response:
    """List jobs, the newest first."""
    with store.read() as db:
        return JSONResponse(list_jobs(db, limit, cursor, session, status))


@router.get("/jobs/{job_id}", response_model=Job)
async def get_job(job_id: JobId, store: StoreDep, hub: HubDep, wait: Wait = 0) -> Response:
    """Return how far a job is; with `wait` once it has ended, or after so many seconds."""
    return JSONResponse(await ended_job(store, hub, job_id, wait))


@router.post("/jobs/{job_id}/cancel", response_model=Job)
def cancel(job_id: JobId, _: IdempotencyDep, jobs: JobsDep) -> Response:
    """End a job that waits or runs; cancelling it again changes nothing."""
    return JSONResponse(jobs.cancel(job_id))


def existing_job(job_id: JobId, store: StoreDep) -> Data:
    """Return a job that is there, before a stream about it begins; raises NotFoundError."""
    with store.read() as db:
        return job_data(job_row(db, job_id))


@router.get("/jobs/{job_id}/events", response_class=EventSourceResponse)
async def job_events(
    job: Annotated[Data, Depends(existing_job)], store: StoreDep, hub: HubDep, last_event_id: LastEventId = None
) -> AsyncIterator[ServerSentEvent]:
    """Stream a job's progress as `job` events, from how it is now until it has ended."""
    after = int(last_event_id) if last_event_id is not None else 0
    async for event in follow(store, hub, job["session"], after):
        if event.kind == "job" and event.data["id"] == job["id"]:
            yield to_sse(event)
            if event.data["status"] in ENDED:
                return


@router.get("/sessions/{session_id}/results", response_model=dict[str, StoredResult])
def list_results(session_id: SessionId, store: StoreDep) -> Response:
    """Return each stage's latest result; `stale` where captures or cell changed since."""
    with store.read() as db:
        session_row(db, session_id)
        if not latest_numbers(db, session_id):  # pages ask with every capture, mostly before there are any
            return JSONResponse({})
        stored = load_session(db, store.blobs, session_id)
        read = _as_read(db, stored)
    return JSONResponse(read)


@router.get("/sessions/{session_id}/results/{stage}", response_model=StoredResult)
def get_result(session_id: SessionId, stage: StageName, store: StoreDep) -> Response:
    """Return a stage's latest result; `stale` where captures or cell changed since."""
    with store.read() as db:
        read = _as_read(db, load_session(db, store.blobs, session_id))
    if stage not in read:
        to_do = "POST …/solve/{stage} first."
        raise NotFoundError(
            "a stage that was solved", "'{stage}', which was not solved", to_do, "stage", stage=stage
        )
    return JSONResponse(read[stage])


def _as_read(db: Transaction, stored: StoredSession) -> dict[str, Data]:
    """Return results with the cell's own severities, a verification with what was decided before."""
    severities = stored.session.cell.findings
    read = {stage: as_read(one, severities=severities) for stage, one in stored.results_with_stale().items()}
    if "verify" in read:
        read["verify"]["decided_before"] = [one.to_json() for one in decisions_before(db, stored)]
    return read
