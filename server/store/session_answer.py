"""A session's answer: as its latest results have it, with when they were solved, and whether it is stale."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction
from sqlalchemy.orm import undefer

from calib_core.exports.answer import Answer, answer_of
from calib_core.records import parse_session
from calib_core.records.decided_before import DecidedBefore
from calib_core.records.faults import in_order
from calib_core.review.decided_before import decided_before
from calib_core.steps import table_stages, tool_stages
from server.store.models import CaptureRow, Data, ResultRow
from server.store.removed_rows import removed_stages
from server.store.sessions import StoredSession

STALE_HEADER: Final = "Scancell-Stale"
VERDICT_HEADER: Final = "Scancell-Verdict"
FAULTS_HEADER: Final = "Scancell-Faults"


def session_answer(db: Transaction, stored: StoredSession) -> Answer:
    """Return tool and table of a session, fresh or not, in the convention that they were solved with.

    Raises
    ------
    ConflictError
        If neither chain nor tcp is solved.
    """
    stale = stored.stale
    answer = answer_of(stored.session, stored.results, stale)
    row = _newest(db, stored.id, answer.stage)[0]
    verified = _newest(db, stored.id, "verify", most=None)[::-1]
    if _is_past_changed(db, stored, [row, *verified[-1:]]):
        stale = [*stale, answer.stage]
        answer = answer_of(stored.session, stored.results, stale)
    session = stored.session
    if answer.stale and row.solved_from is not None:
        then = parse_session(row.solved_from["session"], stored.id)
        session = session.model_copy(update={"cell": then.cell, "captures": then.captures})
    answer = answer_of(session, stored.results, stale, row.record.get("solved") or row.created)
    removed = removed_stages(db, stored.id).intersection((*tool_stages(), *table_stages(), "verify"))
    provenance = (*answer.provenance, *(["imported"] if removed else []))
    return replace(answer, decided_before=tuple(_decided_before(verified, stored)), provenance=provenance)


def _newest(db: Transaction, session_id: str, stage: str, most: int | None = 1) -> list[ResultRow]:
    query = select(ResultRow).where(ResultRow.session_id == session_id, ResultRow.stage == stage)
    query = query.order_by(ResultRow.number.desc()).limit(most)
    return list(db.scalars(query.options(undefer(ResultRow.solved_from))))


def _is_past_changed(db: Transaction, stored: StoredSession, rows: Sequence[ResultRow]) -> bool:
    """Return whether dates of captures, or the log of changed limits, are not what was signed with a result.

    No key knows them.  A capture that came anew since, under its old name, has dates of its own.
    """
    changes = [one.to_json() for one in stored.session.cell.verification.changes or ()]
    for row in rows:
        origin = row.origin()
        if origin is None:
            continue
        signed: Data = origin["session"]
        log = (signed["cell"].get("verification") or {}).get("changes") or []
        if changes[: len(log)] != log:
            return True
        query = select(CaptureRow.id, CaptureRow.record).where(CaptureRow.session_id == stored.id)
        taken = {
            name: record.get("taken")
            for name, record in db.execute(query.where(CaptureRow.created <= row.created))
        }
        if any(taken.get(one["id"], one.get("taken")) != one.get("taken") for one in signed["captures"]):
            return True
    return False


def _decided_before(verified: Sequence[ResultRow], stored: StoredSession) -> list[DecidedBefore]:
    """Return the decisions after which the verification's evidence was changed."""
    origins = [(row.record, row.origin()) for row in verified]
    solved = [(record, parse_session(of["session"], stored.id) if of else None) for record, of in origins]
    return decided_before(solved, stored.session)


def answer_headers(answer: Answer) -> Mapping[str, str]:
    """Return what a download says about the answer in it, beside its body."""
    return headers_of(answer.verdict, answer.stale, answer.all_faults)


def headers_of(verdict: str, stale: bool, faults: Collection[str]) -> Mapping[str, str]:
    """Return the same of an answer that is stored."""
    return {STALE_HEADER: str(stale).lower(), VERDICT_HEADER: verdict, FAULTS_HEADER: ",".join(faults)}


def stage_headers(stored: StoredSession, stage: str) -> Mapping[str, str]:
    """Return the same of a file that one stage made; nothing where it has no result."""
    result = stored.results_with_stale().get(stage)
    if result is None:
        return {}
    holds = {
        "stale": result["stale"],
        "fail": result["verdict"] == "fail",
        "not-replayed": result["provenance"] == "imported",
        "differs": result["provenance"] == "differs",
    }
    return headers_of(result["verdict"], result["stale"], in_order(name for name, held in holds.items() if held))
