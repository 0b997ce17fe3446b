"""What an imported archive held beside session and results: scene, report, truth, notes, archived as they came."""

from collections.abc import Mapping
from typing import Final

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from server.store.models import OutputRow
from server.store.process_data import Output
from server.store.sessions import OF_ARCHIVE

_PREFIX: Final = "archive:"  # so that no stage's output ever has the same name


def add_archived_files(db: Transaction, session_id: str, files: Mapping[str, Output]) -> None:
    """Store files of an archive by their names in it."""
    db.add_all(file.to_row(session_id, _PREFIX + name, OF_ARCHIVE) for name, file in files.items())


def archived_files(db: Transaction, session_id: str) -> dict[str, Output]:
    """Return what was archived, by the names in the archive."""
    query = select(OutputRow).where(OutputRow.session_id == session_id, OutputRow.stage == OF_ARCHIVE)
    rows = db.scalars(query.order_by(OutputRow.name))
    return {row.name.removeprefix(_PREFIX): Output(row.sha256, row.size) for row in rows}
