"""Cells and their released answers: which one is in force, who put it there, when and why."""

from collections.abc import Iterator, Sequence

from sqlalchemy import func, or_, select
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.seals import sealed
from calib_core.errors import ConflictError, NotFoundError
from calib_core.messages import message
from calib_core.moment import now
from calib_core.review.answer import SessionAnswer, cell_id_of
from calib_core.review.between_sessions import SolvedSession, solved_session
from server.store.audit import note_change
from server.store.database import record_event
from server.store.models import Data, ReleaseRow, SessionRow
from server.store.sessions import latest_results, locked_session, stored_record
from server.store.signed_log import note
from server.store.staleness import stale_stages
from server.store.webhooks import tell

_LATEST = select(func.max(ReleaseRow.number)).group_by(ReleaseRow.cell)


def list_cells(db: Transaction) -> list[Data]:
    """Return all cells by id: how many sessions each has, the newest of them, and what is released."""
    cells: dict[str, Data] = {}
    for name, session in _sessions(db):
        cell = cells.setdefault(name, {"sessions": 0})
        cell.update(sessions=cell["sessions"] + 1, newest_session=session["id"], newest_created=session["created"])
    for release in db.scalars(select(ReleaseRow).where(ReleaseRow.number.in_(_LATEST))):
        cells.setdefault(release.cell, {"sessions": 0})["released"] = release_data(release)
    empty: Data = {"newest_session": None, "newest_created": None, "released": None}
    return [{"id": name, **empty, **cells[name]} for name in sorted(cells)]


def cell_history(db: Transaction, cell: str) -> Data:
    """Return a cell's sessions and releases, the newest first; raises NotFoundError."""
    sessions = [session for name, session in _sessions(db, cell) if name == cell][::-1]
    releases = [release_data(row) for row in _releases(db, cell)]
    if not sessions and not releases:
        raise NotFoundError("the id of a cell", repr(cell[:80]), "List them first.", "cell")
    return {"id": cell, "sessions": sessions, "releases": releases}


def cell_sessions(db: Transaction, cell: str, most: int = 100, *, as_solved: bool = False) -> list[SolvedSession]:
    """Return a cell's newest sessions with their latest results, the oldest first; raises NotFoundError.

    `as_solved`: none is called stale, whatever was changed since.
    """
    newest = cell_history(db, cell)["sessions"][:most]
    stale = {} if as_solved else stale_stages(db, [session["id"] for session in newest])
    found = [_solved_session(db, session, stale.get(session["id"], frozenset())) for session in newest[::-1]]
    return sorted(found, key=lambda one: one.date)


def _solved_session(db: Transaction, session: Data, stale: frozenset[str]) -> SolvedSession:
    """Return a session as drift takes it; neither an import nor solving it once more makes it new."""
    found, results = stored_record(db, session["id"]), latest_results(db, session["id"])
    solved = (results.get("chain") or results.get("tcp") or {}).get("solved")
    date = min(solved or session["created"], session["created"])
    return solved_session(session["id"], date, found, results, stale)


def sessions_of_cell(db: Transaction, cell: str) -> list[str]:
    """Return the ids of a cell's sessions, the oldest first."""
    return [session["id"] for name, session in _sessions(db, cell) if name == cell]


def sessions_in_force(db: Transaction) -> dict[str, str]:
    """Return the sessions whose answers are in force, each with its cell, whatever it says of itself by now."""
    query = select(ReleaseRow.session_id, ReleaseRow.cell).where(ReleaseRow.number.in_(_LATEST))
    return {row.session_id: row.cell for row in db.execute(query)}


def require_not_in_force(db: Transaction, session: SessionRow) -> None:
    """Refuse to remove what the answer in force was solved from, or to give it to another cell."""
    cell = sessions_in_force(db).get(session.id)
    if cell is not None:
        to_do = message("Set `archived`, or leave captures out with `excluded`; or release another answer first.")
        got = message("evidence of the answer in force for cell {cell_id}", cell_id=cell)
        raise ConflictError("a session whose answer is not in force", got, to_do, session.id)


def released(db: Transaction, cell: str) -> ReleaseRow:
    """Return what is in force for a cell; raises NotFoundError where nothing was released."""
    rows = _releases(db, cell, 1)
    if not rows:
        to_do = message("POST …/sessions/{id}/release one of its answers.")
        raise NotFoundError("a cell with a released answer", repr(cell[:80]), to_do, "cell")
    return rows[0]


def add_release(
    db: Transaction, session_id: str, answer: Data, who: str, why: str, in_spite_of: Sequence[str]
) -> ReleaseRow:
    """Put a session's answer in force for its cell, in spite of these faults."""
    return _add(db, answer["cell"], session_id, "release", answer, who, why, in_spite_of)


def release_of(db: Transaction, session_id: str, answer: SessionAnswer) -> Data | None:
    """Return the newest release of this very answer of a session; None where nobody released it."""
    for row in _releases(db, answer.cell):
        told = release_data(row)
        same = told["solved"] == answer.solved and told["inputs_sha256"] == answer.inputs_sha256
        if row.session_id == session_id and same:
            return told
    return None


def earlier_release(db: Transaction, cell: str, number: int | None = None) -> ReleaseRow:
    """Return a release of a cell by its number, left out the one before the present one's answer.

    Raises
    ------
    NotFoundError
        If nothing was released, or no release has this number.
    ConflictError
        If there is none before.
    """
    present = released(db, cell)
    rows = _releases(db, cell)
    if number is not None:
        found = next((row for row in rows if row.number == number), None)
        if found is None:
            to_do = "Read its history."
            raise NotFoundError("the number of one of the cell's releases", f"{number}", to_do, "number")
    else:
        found = next((row for row in rows if _plain(row) != _plain(present)), None)
        if found is None:
            raise ConflictError("an earlier release", "none but the present one", "Release another answer.", cell)
    return found


def roll_back(db: Transaction, earlier: ReleaseRow, who: str, why: str, in_spite_of: Sequence[str]) -> ReleaseRow:
    """Put an earlier release in force again; one that is not as it was stored here does not become so."""
    row = _add(db, earlier.cell, earlier.session_id, "rollback", earlier.answer, who, why, in_spite_of)
    if not earlier.holds:
        row.answer = earlier.answer
    return row


def release_data(row: ReleaseRow) -> Data:
    """Return a release as JSON data, without its answer."""
    data = row.fields("number", "cell", "action", "who", "why", "created")
    answer = row.answer
    told = {name: answer.get(name) for name in ("verdict", "solved", "inputs_sha256", "workpiece_sigma_mm")}
    in_spite_of = (answer.get("seal") or {}).get("in_spite_of") or []
    return {**data, "session": row.session_id, **told, "in_spite_of": in_spite_of, "signed": row.holds}


def _plain(row: ReleaseRow) -> Data:
    """Return the answer without its seal, which tells when and by whom it was released."""
    return {name: value for name, value in row.answer.items() if name != "seal"}


def _add(
    db: Transaction,
    cell: str,
    session_id: str,
    action: str,
    answer: Data,
    who: str,
    why: str,
    in_spite_of: Sequence[str],
) -> ReleaseRow:
    before = [row.fields("number", "session_id") for row in _releases(db, cell, 1)]
    row = ReleaseRow(
        cell=cell, session_id=session_id, action=action, answer=answer, who=who, why=why, created=now()
    )
    row.answer = sealed(answer, {**row.about(), "in_spite_of": list(in_spite_of)})
    db.add(row)
    db.flush()
    note_change({"before": before[0] if before else None, "after": row.fields("number", "session_id")})
    note(db, "release", cell, {"created": row.created})
    told = release_data(row)
    tell(db, "release", session_id, told, cell)  # by the cell: the answer's session may be gone
    for one in sorted(session["id"] for name, session in _sessions(db, cell) if name == cell):
        record_event(db, locked_session(db, one), "release", told)  # what is in force differs for all of them
    return row


def _releases(db: Transaction, cell: str, limit: int | None = None) -> list[ReleaseRow]:
    query = select(ReleaseRow).where(ReleaseRow.cell == cell).order_by(ReleaseRow.number.desc())
    return list(db.scalars(query.limit(limit)))


def _sessions(db: Transaction, cell: str | None = None) -> Iterator[tuple[str, Data]]:
    """Give each session with its cell's id, the oldest first; of one cell only those that may be of it.

    The database looks into the records: to read all of them takes a tenth of a second for two thousand.
    """
    given, named = (SessionRow.record[path].as_string() for path in (("cell", "id"), "name"))
    query = select(SessionRow.id, SessionRow.name, SessionRow.created, given, named).order_by(SessionRow.created)
    if cell is not None:  # one without an id is of the cell that its name makes
        query = query.where(or_(given == cell, given.is_(None), given == ""))
    for session_id, name, created, own, session_name in db.execute(query):
        yield cell_id_of(own, session_name or ""), {"id": session_id, "name": name, "created": created}
