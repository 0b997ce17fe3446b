"""What lies beside session and results as it came: scene, report, truth, notes of an archive, and certificates."""

from collections.abc import Mapping

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from server.store.models import OutputRow
from server.store.process_data import Output
from server.store.sessions import ARCHIVED, OF_ARCHIVE


def add_archived_files(db: Transaction, session_id: str, files: Mapping[str, Output]) -> None:
    """Store files of an archive by their names in it."""
    for name, file in files.items():
        db.merge(file.to_row(session_id, ARCHIVED + name, OF_ARCHIVE))


def archived_files(db: Transaction, session_id: str) -> dict[str, Output]:
    """Return what was archived, by the names in the archive."""
    query = select(OutputRow).where(OutputRow.session_id == session_id, OutputRow.stage == OF_ARCHIVE)
    rows = db.scalars(query.order_by(OutputRow.name))
    return {row.name.removeprefix(ARCHIVED): Output(row.sha256, row.size) for row in rows}
