"""How a cell stands at this moment: its policy, its drift, its equipment, and what somebody acknowledged."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from pydantic import ValidationError
from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError, InputError, NotFoundError
from calib_core.exports.answer import Answer
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records.faults import ACKNOWLEDGED, in_order
from calib_core.records.policy import Policy
from calib_core.review.answer import answer_record
from calib_core.review.between_sessions import SolvedSession
from calib_core.review.standing import Standing, changed_equipment, faults_of_moment, serials_of
from server.store.audit import note_change
from server.store.models import AuditRow, CaptureRow, Data, ReleaseRow, SessionRow
from server.store.releases import (
    cell_history,
    cell_sessions,
    released,
    require_not_in_force,
    sessions_of_cell,
)
from server.store.removed_rows import is_release_removed
from server.store.signed_log import entries, is_whole, newest, note
from server.store.staleness import stale_stages

_CAPTURING = ("captures", "captures/batch", "sources/simulated/capture", "live/capture", "live/sweep")
_NOBODY = "this machine"  # without a login nobody knows who it is
_MOST_KNOWN = 200
_steps_known: dict[tuple[Any, ...], frozenset[str]] = {}


def policy_of(db: Transaction, cell: str) -> Policy:
    """Return a cell's policy; one that asks for nothing where none was set."""
    row = newest(db, "policy", cell)
    try:
        return Policy() if row is None else Policy.model_validate(row.told)
    except ValidationError:  # somebody changed it: see `moment_faults`
        return Policy()


def set_policy(db: Transaction, cell: str, policy: Policy) -> None:
    """Set a cell's policy; the audit log keeps what it was before."""
    row, record = newest(db, "policy", cell), policy.to_json()
    note_change({"before": None if row is None else row.told, "after": record})
    note(db, "policy", cell, record)


def with_moment(db: Transaction, answer: Answer, session_id: str) -> Answer:
    """Return a session's answer with its faults of the moment."""
    record = answer_record(answer)
    return replace(answer, of_moment=moment_faults(db, record.to_json(), record.cell, session_id))


def moment_faults(
    db: Transaction, answer: Mapping[str, Any], cell: str, session_id: str | None
) -> tuple[str, ...]:
    """Return the faults of the moment of a cell's answer: of a session, or (None) of the one in force."""
    asked = [newest(db, "policy", cell), *entries(db, "acknowledged", cell)]
    is_altered = not is_whole(db) or not all(row is None or row.holds for row in asked)
    told = faults_of_moment(answer, _standing(db, cell, new=session_id is not None))
    return in_order((*told, *(["altered"] if is_altered else [])))


def released_faults(db: Transaction, row: ReleaseRow, session_id: str | None = None) -> tuple[str, ...]:
    """Return all faults of a release: its own, and those of the moment as a session's or (None) in force."""
    told = ["altered"] if session_id is None and is_release_removed(db, row) else []
    if not row.holds:
        told.append("not-replayed")
    try:
        told += [*row.answer["faults"], *moment_faults(db, row.answer, row.cell, session_id)]
    except (AttributeError, KeyError, TypeError, ValueError):
        if row.holds:
            raise  # else somebody changed what it says
    return in_order(told)


def acknowledge(db: Transaction, cell: str, fault: str, who: str, why: str) -> Data:
    """Acknowledge a fault of the moment by name, as it stands now.

    Raises
    ------
    InputError
        If it is none that can be acknowledged.
    ConflictError
        If the cell does not have it.
    """
    if fault not in ACKNOWLEDGED:
        raise InputError.unknown(fault, ACKNOWLEDGED, "fault")
    cell_history(db, cell)
    found = open_steps(db, cell) if fault == "drift" else _changes(db, cell) - _changes_acknowledged(db, cell)
    if not found:
        to_do = "Nothing has to be done."
        raise ConflictError("a cell with the fault {fault}", "one without", to_do, cell, fault=fault)
    told = {"fault": fault, "of": sorted(found), "who": who, "why": why, "created": now()}
    note_change({"before": {"fault": fault, "of": sorted(found)}, "after": told})
    return {"number": note(db, "acknowledged", cell, told).number, "cell": cell, **told}


def acknowledgements(db: Transaction, cell: str) -> list[Data]:
    """Return who acknowledged which fault of a cell, when and why, the newest first."""
    rows = entries(db, "acknowledged", cell)[::-1]
    return [{"number": row.number, "cell": cell, **row.told} for row in rows if row.holds]


def acknowledgements_of(db: Transaction, session: SessionRow, brought: Sequence[Data] = ()) -> list[Data]:
    """Return those that a session was the reason of, and those of the time when its answer was in force.

    The reason is the session with which the cell changed, or the newest one then. So are those after which its
    answer was released, as they made way for it, and what the session's archive `brought`.
    """
    if not (told := acknowledgements(db, session.cell_id)):
        return [*brought]
    history = cell_history(db, session.cell_id)
    sessions, releases = history["sessions"], history["releases"]

    def concerned(one: Data) -> list[str]:
        newest = [other["id"] for other in sessions if other["created"] <= one["created"]][:1]
        before = [row["session"] for row in releases if row["created"] <= one["created"]][:1]
        after = [row["session"] for row in releases if row["created"] > one["created"]][-1:]
        return [*(one["of"] if one["fault"] == "drift" else newest), *before, *after]

    own = [one for one in told if session.id in concerned(one)]
    known = {(one["fault"], one["who"], one["created"]) for one in own}
    return [*own, *(one for one in brought if (one["fault"], one["who"], one["created"]) not in known)]


def require_evidence_kept(db: Transaction, session: SessionRow) -> None:
    """Refuse to remove a session that the answer in force rests on, or to give it to another cell.

    So is one with which the cell changed, as long as nobody has acknowledged that.
    """
    require_not_in_force(db, session)
    if session.id in open_steps(db, session.cell_id):
        to_do = message("Look at the cell's drift, and acknowledge it.")
        got = message("one with which cell {cell_id} changed, unacknowledged", cell_id=session.cell_id)
        raise ConflictError("a session that shows no change of its cell", got, to_do, session.id)


def open_steps(db: Transaction, cell: str) -> frozenset[str]:
    """Return the sessions with which the cell changed, and that nobody has acknowledged."""
    return _steps(db, cell) - _acknowledged(db, cell, "drift")


def require_four_eyes(db: Transaction, cell: str, session_id: str, who: str) -> None:
    """Refuse, where the cell asks for four eyes, who captured the session; and where that is not known."""
    if not policy_of(db, cell).four_eyes:
        return
    captured = _who_captured(db, session_id)
    if not captured or not {None, _NOBODY}.isdisjoint((*captured, who)):
        to_do = message("Capture with a login of one's own, or ask the administrator for the cell's policy.")
        need = "a session of which it is known who captured it"
        raise ConflictError(need, "one of which it is not", to_do, cell)
    if who in captured:
        to_do = message("Ask somebody else: the cell's policy asks for four eyes.")
        raise ConflictError("somebody who did not capture the session", "'{who}', who did", to_do, cell, who=who)


def _who_captured(db: Transaction, session_id: str) -> set[str | None]:
    """Return who took the session's captures; None for what came otherwise, as from a folder or an archive."""
    here = f"/api/v1/sessions/{session_id}/"
    query = select(AuditRow.who, AuditRow.path, AuditRow.change).where(AuditRow.path.startswith(here))
    took: dict[str, str] = {}
    before: set[str | None] = set()
    for who, path, change in db.execute(query.where(AuditRow.outcome == "done").order_by(AuditRow.number)):
        if change is None and path.removeprefix(here) in _CAPTURING:  # as earlier versions noted it
            before.add(who)
        for one in ((change or {}).get("after") or {}).get("added") or ():
            took[one] = who
    ids = db.scalars(select(CaptureRow.id).where(CaptureRow.session_id == session_id))
    found: set[str | None] = {took.get(one) for one in ids}
    return (found - {None}) | before if before else found


def _standing(db: Transaction, cell: str, *, new: bool) -> Standing:
    return Standing(
        policy=policy_of(db, cell),
        steps=open_steps(db, cell),
        serials=_serials_in_force(db, cell) if new else _serials_now(db, cell),
        acknowledged=_changes_acknowledged(db, cell),
    )


def _acknowledged(db: Transaction, cell: str, fault: str, since: str = "") -> frozenset[str]:
    told = [row.told for row in entries(db, "acknowledged", cell) if row.holds]
    return frozenset(one for t in told if t["fault"] == fault and t["created"] >= since for one in t["of"])


def _changes_acknowledged(db: Transaction, cell: str) -> frozenset[str]:
    """Return what was acknowledged since the answer in force: what came back since was not looked at."""
    try:
        since = released(db, cell).created
    except NotFoundError:
        since = ""
    return _acknowledged(db, cell, "equipment-changed", since)


def _changes(db: Transaction, cell: str) -> frozenset[str]:
    return changed_equipment(_serials_in_force(db, cell), _serials_now(db, cell))


def _serials_in_force(db: Transaction, cell: str) -> dict[str, str]:
    try:
        row = released(db, cell)
    except NotFoundError:
        return {}
    return serials_of(row.answer.get("equipment") or []) if row.holds else {}


def _serials_now(db: Transaction, cell: str) -> dict[str, str]:
    """Return the serial numbers of the newest session that tells its equipment."""
    for session_id in reversed(sessions_of_cell(db, cell)):
        told = db.get_one(SessionRow, session_id).record["cell"].get("equipment")
        if told:
            return serials_of(told)
    return {}


def _steps(db: Transaction, cell: str) -> frozenset[str]:
    """Return the sessions with which the cell's figures changed; kept until something happens in one of them."""
    ids = sessions_of_cell(db, cell)
    if len(ids) < 2:
        return frozenset()
    query = select(SessionRow.id, SessionRow.last_event, SessionRow.revision).where(SessionRow.id.in_(ids))
    state = (cell, *sorted(map(tuple, db.execute(query))))
    if state not in _steps_known:
        if len(_steps_known) >= _MOST_KNOWN:
            _steps_known.clear()
        _steps_known[state] = _flagged(cell_sessions(db, cell))
        # A flag does not end with a capture left out: one whose inputs changed has it until it is solved again.
        if stale := {one for one, stages in stale_stages(db, ids).items() if stages}:
            _steps_known[state] |= _flagged(cell_sessions(db, cell, as_solved=True)) & stale
    return _steps_known[state]


def _flagged(sessions: Sequence[SolvedSession]) -> frozenset[str]:
    from calib_core.review.drift import cell_drift

    return frozenset(p.session for one in cell_drift(sessions).series for p in one.points if p.flagged)
