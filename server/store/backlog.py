"""Captures that wait to be measured."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sqlalchemy import delete, select
from sqlalchemy.orm import Session as Transaction

from calib_core.records import Measured
from server.store.database import record_event
from server.store.models import CaptureRow, Data, FileRow, SessionRow, WaitingRow


@dataclass(frozen=True)
class Waiting:
    """A capture that waits, with all that measuring it takes; `digests` by file name."""

    number: int
    session_id: str
    session_record: Data
    capture_id: str
    revision: int
    record: Data
    digests: Mapping[str, str]


def first_waiting(db: Transaction, limit: int) -> list[Waiting]:
    """Return those that have waited longest, captures of one session together."""
    query = (
        select(WaitingRow.number, SessionRow, CaptureRow)
        .join(SessionRow, SessionRow.id == WaitingRow.session_id)
        .join(
            CaptureRow, (CaptureRow.session_id == WaitingRow.session_id) & (CaptureRow.id == WaitingRow.capture_id)
        )
        .order_by(WaitingRow.number)
        .limit(limit)
    )
    rows = db.execute(query).all()
    digests: dict[tuple[str, str], dict[str, str]] = {}
    files = select(FileRow).where(
        FileRow.session_id.in_({row[1].id for row in rows}), FileRow.capture_id.in_({row[2].id for row in rows})
    )
    for file in db.scalars(files):
        digests.setdefault((file.session_id, file.capture_id), {})[file.name] = file.sha256
    waiting = [
        Waiting(
            number, session.id, session.record, c.id, c.revision, c.record, digests.get((session.id, c.id), {})
        )
        for number, session, c in rows
    ]
    return sorted(waiting, key=lambda w: w.session_id)


def measure_anew(db: Transaction, session_id: str, until_then: Mapping[str, Measured]) -> None:
    """Let captures wait to be measured anew, with what is noted of each until then.

    One that waits already begins to wait again: it may be in the midst of being measured as things were before.
    """
    for capture_id, measured in until_then.items():
        db.get_one(CaptureRow, (session_id, capture_id)).measured = measured.to_json()
    db.execute(
        delete(WaitingRow).where(WaitingRow.session_id == session_id, WaitingRow.capture_id.in_(until_then))
    )
    db.add_all(WaitingRow(session_id=session_id, capture_id=capture_id) for capture_id in until_then)


def note_measured(
    db: Transaction, session_id: str, waiting: Sequence[Waiting], measured: Sequence[Measured]
) -> None:
    """Store what was measured, except where the cell or the capture was changed meanwhile.

    What was measured for another cell goes on waiting; a capture that was changed was measured with its change.
    """
    session = db.get(SessionRow, session_id, with_for_update=True, populate_existing=True)
    if session is None or not waiting or session.record["cell"] != waiting[0].session_record["cell"]:
        return
    for one, seen in zip(waiting, measured, strict=True):
        row = db.get(CaptureRow, (session_id, one.capture_id), populate_existing=True)
        if row is not None and row.revision == one.revision:
            row.measured = seen.to_json()
    db.execute(delete(WaitingRow).where(WaitingRow.number.in_([w.number for w in waiting])))
    data: Data = {"action": "changed", "capture": waiting[-1].capture_id}
    record_event(db, session, "capture", data if len(waiting) == 1 else {**data, "count": len(waiting)})
