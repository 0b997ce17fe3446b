"""A session's reference mesh: what the scanned object should be, given by the user."""

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.stored_clouds import REFERENCE_FILE
from server.store.models import OutputRow, SessionRow
from server.store.process_data import Output
from server.store.session_files import OF_REFERENCE
from server.store.sessions import change_session


def set_reference(db: Transaction, session: SessionRow, reference: Output | None) -> set[str]:
    """Store a session's nominal part in place of the one before, or none; return digests to be looked after.

    The cell names it, so that a merge that was not compared with it is stale.
    """
    query = select(OutputRow).where(OutputRow.session_id == session.id, OutputRow.stage == OF_REFERENCE)
    former = list(db.scalars(query))
    for row in former:
        db.delete(row)
    db.flush()
    if reference is not None:
        add_reference(db, session.id, REFERENCE_FILE, reference)
    cell = dict(session.record["cell"])
    merge = {**cell.get("merge", {}), "reference": None if reference is None else REFERENCE_FILE}
    cell["merge"] = {name: value for name, value in merge.items() if value is not None}
    change_session(db, session, {**session.record, "cell": cell}, {})
    return {row.sha256 for row in former}


def add_reference(db: Transaction, session_id: str, name: str, reference: Output) -> None:
    """Store a nominal part under the name that the cell has for it."""
    db.add(reference.to_row(session_id, name, OF_REFERENCE))
