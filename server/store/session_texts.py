"""A session as the texts that the store keeps of it: for another process, which reads them there."""

import json

from sqlalchemy import Text, cast, func, select
from sqlalchemy.orm import Session as Transaction

from server.store.models import CaptureRow, ResultRow, SessionRow
from server.store.process_data import SessionTexts
from server.store.session_files import files_read
from server.store.sessions import StoredSession, no_such_session


def load_texts(db: Transaction, session_id: str) -> SessionTexts:
    """Return all that a session's guide is made of; raises NotFoundError."""
    record = db.scalar(select(cast(SessionRow.record, Text)).where(SessionRow.id == session_id))
    if record is None:
        raise no_such_session(session_id)
    captures = db.execute(
        select(cast(CaptureRow.record, Text), cast(CaptureRow.measured, Text))
        .where(CaptureRow.session_id == session_id)
        .order_by(CaptureRow.position)
    ).all()
    files = db.execute(files_read([session_id]))
    latest = select(func.max(ResultRow.number)).where(ResultRow.session_id == session_id).group_by(ResultRow.stage)
    results = db.execute(
        select(ResultRow.stage, cast(ResultRow.record, Text))
        .where(ResultRow.number.in_(latest))
        .order_by(ResultRow.number)
    )
    return SessionTexts(
        id=session_id,
        record=record,
        captures=tuple(row[0] for row in captures),
        measured=tuple(row[1] for row in captures),
        results=dict(results.all()),
        digests={name: sha256 for _, name, sha256 in files},
    )


def texts_of(stored: StoredSession) -> SessionTexts:
    """Return the texts of a session that was loaded, or of one as it stood in the past."""
    captures = stored.session.captures
    return SessionTexts(
        id=stored.id,
        record=stored.session.model_copy(update={"captures": []}).model_dump_json(exclude_unset=True),
        captures=tuple(capture.model_dump_json(exclude_unset=True) for capture in captures),
        measured=tuple(seen.model_dump_json(exclude_unset=True) for seen in stored.measured.values()),
        results={stage: json.dumps(result) for stage, result in stored.results.items()},
        digests=dict(stored.digests),
    )
