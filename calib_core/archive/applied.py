"""Remedies applied to a session folder, and the way back: what each one changed is kept in `applied.json`."""

from pathlib import Path
from typing import Any, Final

from calib_core.archive.folder import SESSION_FILE, parse_json, read_bytes, to_json_bytes, write_atomically
from calib_core.causes.apply import applied
from calib_core.errors import ConflictError
from calib_core.messages import message
from calib_core.records import Changes, RootCause, Session

APPLIED_FILE: Final = "applied.json"


def note_applied(folder: Path, session: Session, cause: RootCause, undo: Changes) -> None:
    """Store a session that a cause's remedy has changed, and first how to undo it.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    entry = {"cause": cause.to_json(), "undo": undo.to_json()}
    write_atomically(folder / APPLIED_FILE, to_json_bytes({"applied": [*_entries(folder), entry]}))
    write_atomically(folder / SESSION_FILE, to_json_bytes(session.to_json()))


def undone(folder: Path, session: Session) -> Session:
    """Return a session folder's session without what was applied to it last, and store it so.

    Raises
    ------
    ConflictError
        If nothing was applied.
    InputError
        If a capture is gone, or it cannot be written.
    """
    entries = _entries(folder)
    if not entries:
        to_do = message("Nothing is to be undone.")
        raise ConflictError("a remedy that was applied to this session", "none", to_do, str(folder))
    before, _ = applied(session, Changes.model_validate(entries[-1]["undo"]))
    write_atomically(folder / SESSION_FILE, to_json_bytes(before.to_json()))
    write_atomically(folder / APPLIED_FILE, to_json_bytes({"applied": entries[:-1]}))
    return before


def _entries(folder: Path) -> list[dict[str, Any]]:
    path = folder / APPLIED_FILE
    if not path.is_file():
        return []
    return parse_json(read_bytes(path, message("Remove it to forget what was applied.")), str(path))["applied"]
