"""A session's answer: as its latest results have it, with when they were solved, and whether it is stale."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Final

from sqlalchemy import Text, cast, select
from sqlalchemy.orm import Session as Transaction
from sqlalchemy.orm import undefer

from calib_core.exports.answer import Answer, answer_of
from calib_core.records import parse_session
from calib_core.records.decided_before import DecidedBefore
from calib_core.records.faults import in_order
from calib_core.review.decided_before import decided_before
from calib_core.steps import table_stages, tool_stages
from server.store.models import CaptureRow, ResultRow, SessionRow
from server.store.removed_rows import removed_stages
from server.store.row_seals import text_holds
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
    session = stored.session
    if answer.stale and (origin := row.origin()) is not None:
        then = parse_session(origin["session"], stored.id)
        session = session.model_copy(update={"cell": then.cell, "captures": then.captures})
    is_other = answer.stale and row.has_other_origin
    answer = answer_of(session, stored.results, stale, row.record.get("solved") or row.created)
    before = decisions_before(db, stored)
    return replace(answer, decided_before=before, altered=is_other or _is_altered(db, stored.id))


def _newest(db: Transaction, session_id: str, stage: str, most: int | None = 1) -> list[ResultRow]:
    query = select(ResultRow).where(ResultRow.session_id == session_id, ResultRow.stage == stage)
    query = query.order_by(ResultRow.number.desc()).limit(most)
    return list(db.scalars(query.options(undefer(ResultRow.solved_from))))


def _is_altered(db: Transaction, session_id: str) -> bool:
    """Return whether somebody changed the session's rows in the database, or took out what its answer rests on."""
    read = [cast(column, Text) for column in (CaptureRow.record, CaptureRow.measured, CaptureRow.seal)]
    query = select(CaptureRow.session_id, CaptureRow.id, *read).where(CaptureRow.session_id == session_id)
    captures = [(dict(zip(CaptureRow.signed, row, strict=False)), row[-1]) for row in db.execute(query)]
    of_answer = (*tool_stages(), *table_stages(), "verify")
    return (
        not db.get_one(SessionRow, session_id).holds
        or not all(text_holds(CaptureRow.__tablename__, told, seal or "") for told, seal in captures)
        or not removed_stages(db, session_id).isdisjoint(of_answer)
    )


def decisions_before(db: Transaction, stored: StoredSession) -> tuple[DecidedBefore, ...]:
    """Return the decisions after which the verification's evidence was changed."""
    verified = _newest(db, stored.id, "verify", most=None)[::-1]
    origins = [(row.record, row.origin()) for row in verified]
    solved = [(record, parse_session(of["session"], stored.id) if of else None) for record, of in origins]
    return tuple(decided_before(solved, stored.session))


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
