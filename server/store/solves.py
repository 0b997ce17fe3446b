"""Jobs and the results that they leave."""

from collections.abc import Mapping

from sqlalchemy import bindparam, select, tuple_
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.folder import decisions_of
from calib_core.archive.seals import signed_result
from calib_core.exports.answer import NOT_CONFIRMED
from calib_core.messages import message
from calib_core.moment import now
from calib_core.steps import tool_stages
from server.store.database import record_event
from server.store.models import Data, JobRow, OutputRow, ResultRow, SessionRow, required
from server.store.paging import Page, after_cursor, page_of
from server.store.process_data import Output
from server.store.removed_rows import logged, removed_decisions
from server.store.sessions import locked_session, new_id
from server.store.signed_log import note
from server.store.standing import open_steps
from server.store.webhooks import tell, wanted

_LATEST_VERDICT = (
    select(ResultRow.verdict)
    .where(ResultRow.session_id == bindparam("session_id"), ResultRow.stage == bindparam("stage"))
    .order_by(ResultRow.number.desc())
    .limit(1)
)
ENDED = ("done", "failed", "cancelled")
ALL = "all"
"""In place of a stage: a job that solves the session's stages one after the other, each by a job of its own."""
REPLAY = "replay"
"""In place of a stage: a job that solves all afresh, compares, and notes what imported results are by it."""
COMPARE = "compare"
"""The same for somebody who may only read: it notes nothing."""


def job_data(row: JobRow) -> Data:
    """Return a job as JSON data."""
    names = ("id", "stage", "status", "progress", "message", "error", "created", "finished")
    return row.fields(*names) | {"session": row.session_id}


def job_row(db: Transaction, job_id: str) -> JobRow:
    """Return a job's row; raises NotFoundError."""
    to_do = message("Take it from the answer to the solve; it goes with its session.")
    return required(db.get(JobRow, job_id), message("the id of a job"), repr(job_id), to_do, "job")


def list_jobs(db: Transaction, limit: int, cursor: str | None, session_id: str | None, status: str | None) -> Page:
    """Return a page of jobs, the newest first, of one session or status where these are given."""
    query = select(JobRow)
    if session_id is not None:
        query = query.where(JobRow.session_id == session_id)
    if status is not None:
        query = query.where(JobRow.status == status)
    if cursor is not None:
        query = query.where(tuple_(JobRow.created, JobRow.id) < tuple(after_cursor(cursor, str, str)))
    rows = db.scalars(query.order_by(JobRow.created.desc(), JobRow.id.desc()).limit(limit + 1))
    return page_of([job_data(row) for row in rows], limit, lambda job: [job["created"], job["id"]])


def create_job(db: Transaction, session: SessionRow, stage: str) -> JobRow:
    """Store a job that waits for its turn."""
    row = JobRow(
        id=new_id(),
        session_id=session.id,
        stage=stage,
        status="queued",
        progress=0.0,
        message="waiting for its turn",
        created=now(),
    )
    db.add(row)
    record_event(db, session, "job", job_data(row))
    return row


def update_job(db: Transaction, job_id: str, status: str, message: str, progress: float | None = None) -> bool:
    """Note how far a job is; returns whether it was still on its way (what has ended stays as it ended)."""
    row = db.get(JobRow, job_id)
    if row is None or row.status in ENDED:
        return False
    row.status, row.message = status, message
    if progress is not None:
        row.progress = progress
    if status in ENDED:
        row.finished = now()
    record_event(db, locked_session(db, row.session_id), "job", job_data(row))
    return True


def fail_job(db: Transaction, job_id: str, error: Data) -> None:
    """Note why a job failed (problem details), unless it has ended already."""
    row = db.get(JobRow, job_id)
    if row is not None and row.status not in ENDED:
        row.error = error
        update_job(db, job_id, "failed", error["detail"])


def unfinished_jobs(db: Transaction, session_id: str | None = None) -> list[str]:
    """Return the ids of jobs that wait or run, of one session or of all."""
    query = select(JobRow.id).where(JobRow.status.not_in(ENDED))
    return list(db.scalars(query if session_id is None else query.where(JobRow.session_id == session_id)))


def add_result(
    db: Transaction, job_id: str, record: Data, solved_from: Data, outputs: Mapping[str, Output]
) -> set[str]:
    """Store a job's result and note the job as done, unless it was cancelled or removed meanwhile.

    Returns the digests of files that may be of no use now (see `remove_unreferenced`).
    """
    job = db.get(JobRow, job_id)
    if job is None or not update_job(db, job_id, "done", "done", 1.0):
        return {output.sha256 for output in outputs.values()}
    record = signed_result(
        {**record, "solved": record.get("solved") or now()},
        solved_from["session"],
        before=_decisions(db, job.session_id) if job.stage == "verify" else (),
        files=solved_from["files"],
    )
    return store_result(db, locked_session(db, job.session_id), job.stage, record, solved_from, outputs)


def _decisions(db: Transaction, session_id: str) -> list[Data]:
    """Return when a session's verifications decided, and what."""
    query = select(ResultRow.record, ResultRow.created).where(ResultRow.session_id == session_id)
    rows = db.execute(query.where(ResultRow.stage == "verify").order_by(ResultRow.number))
    past = [{"stage": "verify", "record": record, "created": created} for record, created in rows]
    past += [{"stage": "verify", "record": one} for one in removed_decisions(db, session_id)]
    return decisions_of({"results": past})


def add_answer(db: Transaction, job_id: str, answer: Data) -> None:
    """Store what a job answers that makes no result, and note it as done."""
    job = db.get(JobRow, job_id)
    if job is not None and update_job(db, job_id, "done", "done", 1.0):
        job.answer = answer


def store_result(
    db: Transaction,
    session: SessionRow,
    stage: str,
    record: Data,
    solved_from: Data | None = None,
    outputs: Mapping[str, Output] | None = None,
    created: str | None = None,
) -> set[str]:
    """Store a stage's result as the latest one, with what it was solved from where that is known.

    `created` is when it came, left out for now.

    The files that the stage made before give way to `outputs`; returns their digests.
    """
    before = db.scalars(_LATEST_VERDICT, {"session_id": session.id, "stage": stage}).first()
    db.add(
        ResultRow(
            session_id=session.id,
            stage=stage,
            created=created or now(),
            verdict=record["verdict"],
            record=record,
            solved_from=solved_from,
        )
    )
    former = _remove_outputs(db, session.id, stage)
    for name, made in (outputs or {}).items():
        db.add(made.to_row(session.id, name, stage))
    record_event(db, session, "result", logged(stage, record))
    note(db, "result", session.id, logged(stage, record))
    if record["verdict"] != before:
        data = {
            "stage": stage,
            "verdict": record["verdict"],
            "before": before,
            "warnings": record.get("warnings", []),
            "findings": record.get("findings", []),
        }
        tell(db, "verdict", session.id, data)
    if record.get("decision") in NOT_CONFIRMED:
        told = {"stage": stage, "decision": record["decision"], "findings": record.get("findings", [])}
        tell(db, "verify-fail", session.id, told)
    if stage in tool_stages() and wanted(db, "drift"):
        db.flush()
        steps = open_steps(db, session.cell_id)
        if session.id in steps:
            tell(db, "drift", session.id, {"cell": session.cell_id, "sessions": sorted(steps)})
    return former


def _remove_outputs(db: Transaction, session_id: str, stage: str) -> set[str]:
    rows = db.scalars(select(OutputRow).where(OutputRow.session_id == session_id, OutputRow.stage == stage)).all()
    for row in rows:
        db.delete(row)
    db.flush()  # the new ones may have the same names
    return {row.sha256 for row in rows}
