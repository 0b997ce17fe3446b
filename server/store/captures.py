"""Captures of a session: immutable files, a record that can be corrected, and what was measured."""

import json
from collections.abc import Callable

from sqlalchemy import Text, cast, delete, select
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import NotFoundError
from calib_core.findings import measured_as_read
from calib_core.messages import message
from calib_core.records import Measured
from server.store.audit import note_change, note_difference
from server.store.database import record_event
from server.store.models import CaptureRow, Data, FileRow, ResultRow, SessionRow, required
from server.store.paging import after_cursor, page_of
from server.store.sessions import touch

Read = Callable[[Data], Data]


def capture_data(row: CaptureRow, read: Read = measured_as_read) -> Data:
    """Return a capture's record with what was measured in it, as `read` gives it."""
    return {**row.record, "measured": read(row.measured)}


def capture_row(db: Transaction, session_id: str, capture_id: str) -> CaptureRow:
    """Return a capture's row; raises NotFoundError."""
    row, to_do = db.get(CaptureRow, (session_id, capture_id)), message("List them first.")
    return required(row, message("the id of a capture of this session"), repr(capture_id), to_do, "capture")


def capture_ids(db: Transaction, session_id: str) -> set[str]:
    """Return the ids of a session's captures."""
    return set(db.scalars(select(CaptureRow.id).where(CaptureRow.session_id == session_id)))


def list_captures(
    db: Transaction, session_id: str, limit: int, cursor: str | None, read: Read | None = None
) -> str:
    """Return a page of captures in the order of their arrival, as JSON text; what was measured as `read` gives it.

    Without `read` it is put together from the texts that are stored: reading and writing them again would take
    most of the time.
    """
    (position,) = after_cursor(cursor, int) if cursor is not None else (0,)
    query = select(CaptureRow.position, cast(CaptureRow.record, Text), cast(CaptureRow.measured, Text)).where(
        CaptureRow.session_id == session_id, CaptureRow.position > position
    )
    rows = list(db.execute(query.order_by(CaptureRow.position).limit(limit + 1)))
    page = page_of(rows, limit, lambda row: [row[0]])
    rows = [(record.rstrip()[:-1], measured) for _, record, measured in page["items"]]
    items = ", ".join(f'{record}, "measured": {_as_text(measured, read)}}}' for record, measured in rows)
    return f'{{"items": [{items}], "next": {json.dumps(page["next"])}}}'


def _as_text(measured: str, read: Read | None) -> str:
    if read is None and '"findings"' in measured:
        return measured
    return json.dumps((read or measured_as_read)(json.loads(measured)), allow_nan=False)


def change_capture(
    db: Transaction, session: SessionRow, row: CaptureRow, record: Data, measured: Measured
) -> None:
    """Replace a capture's record and what was measured; its files stay as they came."""
    note_difference(row.record, record)
    row.record, row.measured = record, measured.to_json()
    row.revision += 1
    touch(session)
    record_event(db, session, "capture", {"action": "changed", "capture": row.id})


def remove_capture(db: Transaction, session: SessionRow, row: CaptureRow, because: Data) -> set[str]:
    """Remove a capture; returns the digests of its files (see `remove_unreferenced`).

    Once something was solved the session keeps which it was, and who removed it, when and why.
    """
    digests = set(_digests(db, session.id, row.id).values())
    note_change({"before": row.record, "after": None})
    db.execute(delete(CaptureRow).where(CaptureRow.session_id == session.id, CaptureRow.id == row.id))
    if db.scalars(select(ResultRow.number).where(ResultRow.session_id == session.id).limit(1)).first():
        told = {"capture": row.id, "step": row.record["step"], **because}
        session.record = {**session.record, "removed": [*session.record.get("removed", ()), told]}
    touch(session)
    record_event(db, session, "capture", {"action": "removed", "capture": row.id})
    return digests


def file_digest(db: Transaction, session_id: str, capture_id: str, name: str) -> str:
    """Return the digest of one of a capture's files, by its name in the record or the last part of it.

    Raises
    ------
    NotFoundError
    """
    capture_row(db, session_id, capture_id)
    digests = _digests(db, session_id, capture_id)
    matching = [n for n in digests if n == name] or [n for n in digests if n.rsplit("/", 1)[-1] == name]
    if len(matching) != 1:
        need = "one of this capture's files: {digests}"
        to_do = "Take a name from the capture's `files`."
        raise NotFoundError(need, repr(name), to_do, capture_id, digests=", ".join(sorted(digests)) or "none")
    return digests[matching[0]]


def _digests(db: Transaction, session_id: str, capture_id: str) -> dict[str, str]:
    query = select(FileRow.name, FileRow.sha256)
    rows = db.execute(query.where(FileRow.session_id == session_id, FileRow.capture_id == capture_id))
    return dict(rows.all())
