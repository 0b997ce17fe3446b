"""The files that a session's stages read, by name: those of its captures, and the nominal part."""

from collections.abc import Collection

from sqlalchemy import Select, select, union_all

from server.store.models import FileRow, OutputRow

OF_REFERENCE = "reference"
"""What stands in place of a stage with the nominal part, which the user gave."""


def files_read(session_ids: Collection[str]) -> Select[str, str, str]:
    """Return the query of session, name and SHA-256 of each file that stages of these sessions read."""
    files = select(FileRow.session_id, FileRow.name, FileRow.sha256).where(FileRow.session_id.in_(session_ids))
    given = select(OutputRow.session_id, OutputRow.name, OutputRow.sha256).where(
        OutputRow.session_id.in_(session_ids), OutputRow.stage == OF_REFERENCE
    )
    both = union_all(files, given).subquery()
    return select(both.c.session_id, both.c.name, both.c.sha256)
