"""Results and releases of which the log knows and the tables do not: somebody took them out of the database."""

from collections.abc import Iterable, Mapping
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from server.store.models import Data, EventRow, ReleaseRow, ResultRow


def logged(stage: str, record: Mapping[str, Any]) -> Data:
    """Return what the log keeps of a result: when it was solved, and what it decided."""
    told = {"stage": stage, "solved": record.get("solved"), "decision": record.get("decision")}
    return {name: value for name, value in told.items() if value is not None}


def removed_stages(db: Transaction, session_id: str) -> frozenset[str]:
    """Return the stages whose newest result was taken out."""
    newest = {one["stage"]: one["solved"] for one in _logged(db, session_id)}
    there = _there(db, session_id, newest)
    return frozenset(stage for stage, solved in newest.items() if (stage, solved) not in there)


def removed_decisions(db: Transaction, session_id: str) -> list[Data]:
    """Return the verifications that decided and were taken out: `decision` and `solved` of each."""
    decided = [one for one in _logged(db, session_id) if one["stage"] == "verify" and "decision" in one]
    there = _there(db, session_id, ["verify"]) if decided else set()
    return [one for one in decided if ("verify", one["solved"]) not in there]


def is_release_removed(db: Transaction, cell: str, sessions: Iterable[str]) -> bool:
    """Return whether a cell's newest release was taken out, by the logs of its sessions."""
    query = select(EventRow.data).where(EventRow.session_id.in_(list(sessions)), EventRow.kind == "release")
    known = max((told["created"] for told in db.scalars(query) if told["cell"] == cell), default="")
    return known not in {"", *db.scalars(select(ReleaseRow.created).where(ReleaseRow.cell == cell))}


def _logged(db: Transaction, session_id: str) -> list[Data]:
    query = select(EventRow.data).where(EventRow.session_id == session_id, EventRow.kind == "result")
    return [told for told in db.scalars(query.order_by(EventRow.id)) if "solved" in told]


def _there(db: Transaction, session_id: str, stages: Iterable[str]) -> set[tuple[str, str]]:
    solved = ResultRow.record["solved"].as_string()
    query = select(ResultRow.stage, solved).where(ResultRow.session_id == session_id)
    return {(stage, when) for stage, when in db.execute(query.where(ResultRow.stage.in_(list(stages))))}
