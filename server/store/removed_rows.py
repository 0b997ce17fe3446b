"""Results and releases of which the signed log knows and the tables do not: somebody took them out."""

from collections.abc import Iterable, Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from server.store.models import Data, ReleaseRow, ResultRow, SessionRow
from server.store.signed_log import entries, newest


def logged(stage: str, record: Mapping[str, Any]) -> Data:
    """Return what the log keeps of a result: when it was solved, and what it decided."""
    told = {"stage": stage, "solved": record.get("solved"), "decision": record.get("decision")}
    return {name: value for name, value in told.items() if value is not None}


def removed_stages(db: Transaction, session_id: str) -> frozenset[str]:
    """Return the stages whose newest result was taken out, and nobody accepted that."""
    newest_of = {one["stage"]: one["solved"] for one in _logged(db, session_id)}
    there = _there(db, session_id, newest_of)
    return frozenset(stage for stage, solved in newest_of.items() if solved and (stage, solved) not in there)


def removed_decisions(db: Transaction, session_id: str) -> list[Data]:
    """Return the verifications that decided and were taken out: `decision` and `solved` of each."""
    decided = [one for one in _logged(db, session_id) if one["stage"] == "verify" and "decision" in one]
    there = _there(db, session_id, ["verify"]) if decided else set()
    return [one for one in decided if ("verify", one["solved"]) not in there]


def is_release_removed(db: Transaction, row: ReleaseRow) -> bool:
    """Return whether a newer release than a cell's newest was taken out, or the session that it is of."""
    known = newest(db, "release", row.cell)
    if known is not None and known.told["created"] > row.created:
        return True
    is_there = db.get(SessionRow, row.session_id) is not None
    return not is_there and newest(db, "removed", row.session_id) is None and bool(_logged(db, row.session_id))


def _logged(db: Transaction, session_id: str) -> list[Data]:
    return [row.told for row in entries(db, "result", session_id) if row.holds and "solved" in row.told]


def _there(db: Transaction, session_id: str, stages: Iterable[str]) -> set[tuple[str, str]]:
    solved = ResultRow.record["solved"].as_string()
    query = select(ResultRow.stage, solved).where(ResultRow.session_id == session_id)
    return {(stage, when) for stage, when in db.execute(query.where(ResultRow.stage.in_(list(stages))))}
