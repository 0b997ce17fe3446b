"""Captures of a session: immutable files, a record that can be corrected, and what was measured."""

from collections.abc import Mapping

from sqlalchemy import delete, insert, select
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError, NotFoundError
from calib_core.records import Capture, Measured
from server.store.database import record_event
from server.store.models import CaptureRow, Data, FileRow, SessionRow, now
from server.store.paging import Page, after_cursor, page_of
from server.store.sessions import touch


def capture_data(row: CaptureRow) -> Data:
    """Return a capture's record with what was measured in it."""
    return {**row.record, "measured": row.measured}


def capture_row(db: Transaction, session_id: str, capture_id: str) -> CaptureRow:
    """Return a capture's row; raises NotFoundError."""
    row = db.get(CaptureRow, (session_id, capture_id))
    if row is None:
        raise NotFoundError(
            "the id of a capture of this session", repr(capture_id), "List the session's captures.", "capture"
        )
    return row


def capture_ids(db: Transaction, session_id: str) -> set[str]:
    """Return the ids of a session's captures."""
    return set(db.scalars(select(CaptureRow.id).where(CaptureRow.session_id == session_id)))


def list_captures(db: Transaction, session_id: str, limit: int, cursor: str | None) -> Page:
    """Return a page of captures in the order of their arrival."""
    (position,) = after_cursor(cursor, int) if cursor is not None else (0,)
    query = select(CaptureRow).where(CaptureRow.session_id == session_id, CaptureRow.position > position)
    rows = list(db.scalars(query.order_by(CaptureRow.position).limit(limit + 1)))
    page = page_of(rows, limit, lambda row: [row.position])
    return {**page, "items": [capture_data(row) for row in page["items"]]}


def require_free(db: Transaction, session_id: str, capture: Capture, digests: Mapping[str, str]) -> None:
    """Refuse a capture whose id is taken, or whose file name stands for other bytes in this session.

    Raises
    ------
    ConflictError
    """
    there = select(CaptureRow.position).where(CaptureRow.session_id == session_id, CaptureRow.id == capture.id)
    if db.scalar(there) is not None:
        raise ConflictError(
            "a capture id that is new in this session",
            f"'{capture.id}', which is there already",
            "Give the capture another id, or remove the stored one first.",
            capture.id,
        )
    taken = db.execute(
        select(FileRow.name, FileRow.sha256, FileRow.capture_id).where(
            FileRow.session_id == session_id, FileRow.name.in_(digests)
        )
    )
    for name, digest, owner in taken:
        if digest != digests[name]:
            raise ConflictError(
                "file names that are new in this session",
                f"{name}, which capture '{owner}' has with other content",
                "Name the file otherwise in the record's `files`.",
                capture.id,
            )


def add_capture(
    db: Transaction,
    session: SessionRow,
    capture: Capture,
    measured: Measured,
    digests: Mapping[str, str],
    sizes: Mapping[str, int],
) -> Data:
    """Store a capture and return it; `digests` and `sizes` belong to the names in its `files`.

    Raises
    ------
    ConflictError
    """
    require_free(db, session.id, capture, digests)
    session.last_position += 1
    record, seen = capture.to_json(), measured.to_json()
    # Plain inserts: they are the busiest ones, and the unit of work would double their cost.
    db.execute(
        insert(CaptureRow),
        {
            "session_id": session.id,
            "id": capture.id,
            "position": session.last_position,
            "created": now(),
            "record": record,
            "measured": seen,
        },
    )
    if digests:
        keys = {"session_id": session.id, "capture_id": capture.id}
        db.execute(
            insert(FileRow),
            [{**keys, "name": name, "sha256": digest, "size": sizes[name]} for name, digest in digests.items()],
        )
    touch(session)
    record_event(db, session, "capture", {"action": "added", "capture": capture.id})
    return {**record, "measured": seen}


def change_capture(
    db: Transaction, session: SessionRow, row: CaptureRow, record: Data, measured: Measured
) -> None:
    """Replace a capture's record and what was measured; its files stay as they came."""
    row.record, row.measured = record, measured.to_json()
    row.revision += 1
    touch(session)
    record_event(db, session, "capture", {"action": "changed", "capture": row.id})


def remove_capture(db: Transaction, session: SessionRow, row: CaptureRow) -> set[str]:
    """Remove a capture; returns the digests of its files (see `sessions.unused`)."""
    digests = set(_digests(db, session.id, row.id).values())
    db.execute(delete(CaptureRow).where(CaptureRow.session_id == session.id, CaptureRow.id == row.id))
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
        raise NotFoundError(
            f"one of this capture's files: {', '.join(sorted(digests)) or 'it has none'}",
            repr(name),
            "Take a name from the capture's `files`.",
            capture_id,
        )
    return digests[matching[0]]


def _digests(db: Transaction, session_id: str, capture_id: str) -> dict[str, str]:
    query = select(FileRow.name, FileRow.sha256)
    rows = db.execute(query.where(FileRow.session_id == session_id, FileRow.capture_id == capture_id))
    return dict(rows.all())
