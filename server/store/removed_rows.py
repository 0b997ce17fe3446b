"""What the signed log knows of results and releases and the tables do not: somebody took it out, or moved it."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from server.store.models import Data, ReleaseRow, ResultRow, SessionRow
from server.store.signed_log import entries, newest


def logged(stage: str, record: Mapping[str, Any]) -> Data:
    """Return what the log keeps of a result: when it was solved, and what it decided."""
    told = {"stage": stage, "solved": record.get("solved"), "decision": record.get("decision")}
    return {name: value for name, value in told.items() if value is not None}


def removed_stages(db: Transaction, session_id: str) -> frozenset[str]:
    """Return the stages whose newest result is not what was stored last, and nobody accepted that.

    It was taken out, an older one was put before it, or its verdict was changed beside the signed record.
    """
    newest_of = {one["stage"]: one["solved"] for one in _logged(db, session_id)}
    solved, verdict = (ResultRow.record[name].as_string() for name in ("solved", "verdict"))
    last = select(func.max(ResultRow.number)).where(ResultRow.session_id == session_id).group_by(ResultRow.stage)
    query = select(ResultRow.stage, solved, ResultRow.verdict == verdict).where(ResultRow.number.in_(last))
    there = {stage: when for stage, when, is_its_verdict in db.execute(query) if is_its_verdict}
    return frozenset(stage for stage, when in newest_of.items() if when and there.get(stage) != when)


def removed_decisions(db: Transaction, session_id: str) -> list[Data]:
    """Return the verifications that decided and were taken out: `decision` and `solved` of each."""
    decided = [one for one in _logged(db, session_id) if one["stage"] == "verify" and "decision" in one]
    of_verify = (ResultRow.session_id == session_id, ResultRow.stage == "verify")
    there = set(db.scalars(select(ResultRow.record["solved"].as_string()).where(*of_verify))) if decided else set()
    return [one for one in decided if one["solved"] not in there]


def is_release_removed(db: Transaction, row: ReleaseRow) -> bool:
    """Return whether a newer release than a cell's newest was taken out, or the session that it is of."""
    known = newest(db, "release", row.cell)
    if known is not None and known.told["created"] > row.created:
        return True
    is_there = db.get(SessionRow, row.session_id) is not None
    return not is_there and newest(db, "removed", row.session_id) is None and bool(_logged(db, row.session_id))


def _logged(db: Transaction, session_id: str) -> list[Data]:
    return [row.told for row in entries(db, "result", session_id) if row.holds and "solved" in row.told]
