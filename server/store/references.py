"""A session's reference mesh: what the scanned object should be, given by the user."""

from sqlalchemy.orm import Session as Transaction

from calib_core.archive.stored_clouds import REFERENCE_FILE
from server.store.database import record_event
from server.store.models import OutputRow, SessionRow
from server.store.process_data import Output

_OF_NO_STAGE = "reference"


def set_reference(db: Transaction, session: SessionRow, reference: Output | None) -> set[str]:
    """Store a session's reference mesh in place of the one before, or none; return digests to be looked after."""
    former = db.get(OutputRow, (session.id, REFERENCE_FILE))
    gone: set[str] = set()
    if former is not None:
        gone.add(former.sha256)
        db.delete(former)
        db.flush()
    if reference is not None:
        db.add(reference.to_row(session.id, REFERENCE_FILE, _OF_NO_STAGE))
    record_event(db, session, "session", {"action": "changed"})
    return gone
