"""Changes of the cell and of captures made together, and how to undo them: what a root cause's remedy needs."""

from sqlalchemy.orm import Session as Transaction

from calib_core.causes.apply import applied
from calib_core.errors import InputError
from calib_core.records import Capture, Changes
from server.captures.changes import FIXED, require_usable
from server.captures.measuring_queue import to_wait
from server.store.backlog import measure_anew
from server.store.captures import capture_row, change_capture
from server.store.models import Data
from server.store.sessions import StoredSession, change_session, locked_session, session_data

_NOT_MEASURED = frozenset(
    {"pose", "joints_deg", "joints_mm", "active_tool", "active_frame", "moving", "excluded", "table_deg", "mount"}
)
"""Fields of a capture that measuring it does not depend on."""


def apply_changes(db: Transaction, stored: StoredSession, changes: Changes) -> Data:
    """Make changes of a session that was loaded in this transaction; captures they bear on are measured anew.

    Returns
    -------
    dict
        `session`, the `changes`, and those that `undo` them.

    Raises
    ------
    InputError
        If a change is of no use.
    """
    for name, patch in changes.captures.items():
        fixed = [field for field in FIXED if field in patch]
        if fixed:
            need = "the '{name}' that the capture came with"
            raise InputError(need, "something else", "Upload it again.", name, name=fixed[0])
    session, undo = applied(stored.session, changes)
    of_cell = require_usable(stored.session, session)
    row = locked_session(db, stored.id)
    waiting: list[Capture] = []
    for capture in session.captures:
        patch = changes.captures.get(capture.id, {})
        anew = of_cell or not _NOT_MEASURED.issuperset(patch) or (capture.kind == "sweep" and patch)
        waiting += [capture] if anew else []
        if patch:
            measured = stored.measured[capture.id]
            change_capture(db, row, capture_row(db, stored.id, capture.id), capture.to_json(), measured)
    if changes.cell:
        change_session(db, row, {n: v for n, v in session.to_json().items() if n != "captures"}, {})
    db.flush()
    measure_anew(db, stored.id, {capture.id: to_wait(capture, "record") for capture in waiting})
    return {"session": session_data(db, row), "changes": changes.to_json(), "undo": undo.to_json()}
