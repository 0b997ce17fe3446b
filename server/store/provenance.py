"""What a replay makes of stored results: replayed, or differing from what their captures give."""

from collections.abc import Mapping

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.keys import keys
from calib_core.archive.seals import SOLVED, decisions_sealed, seal_state, signed_result
from calib_core.review.provenance import after_replay
from calib_core.review.replay import Replay
from server.store.database import record_event
from server.store.models import Data, JobRow, ResultRow
from server.store.sessions import locked_session
from server.store.solves import ENDED, REPLAY


def note_replay(
    db: Transaction,
    job_id: str,
    session: Data,
    results: Mapping[str, Data],
    answer: Data,
    fresh: Mapping[str, Data],
) -> None:
    """Note what the latest results are by a replay, signed; those that were solved here stay as they are.

    Parameters
    ----------
    session : dict
        The session's record as it was replayed.
    results : mapping
        What was replayed, by stage; what has come since is left alone.
    answer : dict
        The comparison, as the job answers it.
    fresh : mapping
        What came of solving anew, by stage.
    """
    job = db.get(JobRow, job_id)
    if job is None or job.status in ENDED or job.stage != REPLAY:
        return
    row_of_session = locked_session(db, job.session_id)
    for found in Replay.model_validate(answer["replay"]).stages:
        query = select(ResultRow).where(ResultRow.session_id == job.session_id, ResultRow.stage == found.stage)
        row = db.scalars(query.order_by(ResultRow.number.desc()).limit(1)).first()
        if row is None or found.provenance is None or _solved_here(row.record):
            continue
        if row.proved() != results[found.stage]:
            continue
        now = after_replay(row.record, found, fresh.get(found.stage, {}))
        row.record = signed_result(
            now, session, found.provenance, found.finding, before=decisions_sealed(row.record)
        )
        record_event(db, row_of_session, "result", {"stage": found.stage})


def _solved_here(record: Data) -> bool:
    """Return whether the seal proves that this installation itself solved it."""
    seal = record.get("seal") or {}
    return bool(seal_state(record)) and (seal["key"], seal["provenance"]) == (keys().own_key, SOLVED)
