"""Corrections: of a capture's record, and of the cell that captures were measured in."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final, Literal

from calib_core.causes.apply import merge_patch
from calib_core.cell.consistency import require_consistent
from calib_core.cell.found import ON_FLANGE
from calib_core.errors import CalibrationError, ConflictError, DamagedError, InputError
from calib_core.frames import RigidTransform
from calib_core.graph.registry import STAGES
from calib_core.messages import message
from calib_core.moment import now
from calib_core.records import Capture, Cell, Measured, Session, parse_capture, parse_session
from calib_core.records.strict_fields import require_known_fields, unknown_fields
from calib_core.review.answer import cell_id
from calib_core.stages.verify.limits import changes_between
from server.captures.measurer import Measurer
from server.captures.measuring_queue import to_wait
from server.measuring import Measure, check_poses
from server.store.backlog import measure_anew
from server.store.calibrations import calibrated
from server.store.captures import capture_data, capture_row, change_capture
from server.store.database import Store
from server.store.equipment import keep_certificates, with_registered
from server.store.models import Data
from server.store.sessions import (
    change_session,
    empty_session,
    etag,
    load_session,
    locked_session,
    require_revision,
    session_data,
    session_row,
)
from server.store.standing import require_evidence_kept

_FRAMES: Final[dict[str, tuple[Literal["tool0", "base"], Literal["laser", "turntable"]]]] = {
    ON_FLANGE: ("tool0", "laser"),
    "base_from_laser": ("base", "laser"),
    "base_from_turntable": ("base", "turntable"),
}

_MOST_WORDS = 1000
_MEASURED_AT_ONCE = 10  # before the answer; more are measured after it
# What measuring a capture depends on, beside the capture.
_MEASURED_FROM = (
    "sphere_diameter_mm",
    "sphere_diameter_sigma_mm",
    "spheres",
    "scanner",
    "scanners",
    "board",
    "known",
)
FIXED = ("id", "files", "kind")
_BECAUSE = ("included_because", "excluded_because")
_KEPT_HERE = (*_BECAUSE, "added_because", "changed_because")


def corrected_capture(
    store: Store,
    measure: Measure,
    session_id: str,
    capture_id: str,
    changes: Mapping[str, object],
    if_match: str | None,
    who: str = "",
) -> tuple[Data, str]:
    """Change a capture's record, measure it anew, and return it with its new ETag; its files stay as they came.

    Raises
    ------
    CalibrationError
        If the change is of no use, or something else was changed meanwhile.
    """
    with store.read() as db:
        stored = load_session(db, store.blobs, session_id)
        before = capture_row(db, session_id, capture_id)
        record, revision, measured_before = before.record, before.revision, before.measured
    capture = _changed(record, _with_reason(record, changes, who, verified="verify" in stored.results))
    check_poses(stored.session, capture)
    try:
        measured = Measurer(measure, stored.session, lambda: calibrated(stored)).measure(capture, stored.reader)
    except DamagedError:
        if not set(changes) <= {"excluded", *_KEPT_HERE}:
            raise
        # What the disk has spoiled can still be left out: that is what makes the others count again.
        measured = Measured.model_validate(measured_before)
    with store.write() as db:
        session = locked_session(db, session_id)
        if empty_session(session.record, session_id).cell != stored.session.cell:
            raise _changed_meanwhile("cell")
        row = capture_row(db, session_id, capture_id)
        require_revision(row, if_match)
        if row.revision != revision:
            raise _changed_meanwhile("capture")
        change_capture(db, session, row, capture.to_json(), measured)
        return capture_data(row), etag(row)


def corrected_session(
    store: Store, measure: Measure, session_id: str, changes: Mapping[str, object], if_match: str | None, who: str
) -> tuple[Data, str]:
    """Change a session's name or cell, and return it with its new ETag.

    Captures are measured anew where the cell's change bears on them: a few at once, more by the queue.  `why`
    among the changes is the reason for other limits, and is kept with these.

    Raises
    ------
    CalibrationError
        If the change is of no use, or something else was changed meanwhile.
    """
    with store.read() as db:
        before = load_session(db, store.blobs, session_id)
        revision = session_row(db, session_id).revision
    captures = before.session.captures
    why = str(changes.get("why") or "")[:_MOST_WORDS]
    changes = {name: value for name, value in changes.items() if name != "why"}
    record: Data = merge_patch(before.session.model_copy(update={"captures": []}).to_json(), changes)
    session = parse_session({**record, "captures": [capture.to_json() for capture in captures]}, "request")
    if session.removed != before.session.removed:
        to_do = message("Leave `removed` out: it is kept by the server.")
        raise InputError("the captures that were removed, as they were kept", "something else", to_do, "removed")
    with store.read() as db:
        session = with_registered(db, _with_limit_changes(before.session, session, who, why))
    anew = require_usable(before.session, session)
    at_once = anew and len(captures) <= _MEASURED_AT_ONCE
    measurer = Measurer(measure, session, lambda: calibrated(replace(before, session=session)))
    measured = {c.id: measurer.measure(c, before.read).to_json() for c in captures} if at_once else {}
    with store.write() as db:
        row = locked_session(db, session_id)
        require_revision(row, if_match)
        if row.revision != revision:
            raise _changed_meanwhile("session")
        if cell_id(session) != row.cell_id:
            require_evidence_kept(db, row)
        if anew and not at_once:
            measure_anew(db, session_id, {c.id: to_wait(c, "cell") for c in captures})
        change_session(db, row, {n: v for n, v in session.to_json().items() if n != "captures"}, measured)
        if session.cell.equipment != before.session.cell.equipment:
            keep_certificates(db, store.blobs, session_id, session.cell.equipment or ())
        return session_data(db, row), etag(row)


def require_usable(before: Session, after: Session) -> bool:
    """Refuse a changed session that is of no use; return whether its cell's change bears on what was measured."""
    require_known_fields(after, "request", {path for path, _ in unknown_fields(before)})
    if after.cell.known != before.cell.known:
        require_rigid(after.cell)
    if after.cell != before.cell:
        require_consistent(after.cell)
    for capture in after.captures:
        check_poses(after, capture)
    return any(getattr(after.cell, name) != getattr(before.cell, name) for name in _MEASURED_FROM)


def _with_limit_changes(before: Session, after: Session, who: str, why: str) -> Session:
    """Return the changed session with what was changed of the verification's limits after its first capture.

    Raises
    ------
    InputError
        If the change is of what was kept of earlier ones.
    """
    old, new = before.cell.verification, after.cell.verification
    if (new.changes or []) != (old.changes or []) and "verification" in after.cell.model_fields_set:
        to_do = message("Leave `changes` out: they are kept by the server.")
        raise InputError("the limits' changes as they were kept", "something else", to_do, "verification.changes")
    steps = STAGES.get("verify", "stage").steps
    taken = sum(capture.step in steps for capture in before.captures)
    made = changes_between(old, new, taken, now(), who, why)
    kept = [*(old.changes or []), *made]
    if not kept:
        return after
    limits = new.model_copy(update={"changes": kept})
    return after.model_copy(update={"cell": after.cell.model_copy(update={"verification": limits})})


def _with_reason(record: Data, changes: Mapping[str, object], who: str, *, verified: bool) -> Mapping[str, object]:
    """Return the changes with who leaves the capture out or takes it in again, when, and why.

    So is who corrects it, once the session was verified; what is kept of all these nobody else writes.
    """
    given = next((told for name in _KEPT_HERE if isinstance(told := changes.get(name), Mapping)), {})
    others = {name: value for name, value in changes.items() if name not in _KEPT_HERE}
    because = because_of(who, given.get("why"))
    if verified and any(record.get(name) != value for name, value in others.items() if name != "excluded"):
        others["changed_because"] = because
    excluded = bool(changes.get("excluded"))
    if "excluded" not in changes or excluded == bool(record.get("excluded")):
        return others
    return {**others, _BECAUSE[excluded]: because, _BECAUSE[not excluded]: None}


def because_of(who: str, why: object) -> Data:
    """Return who does something to a capture now, and why where that is told."""
    return {"who": who, "when": now(), **({"why": str(why)[:_MOST_WORDS]} if why else {})}


def _changed(record: Data, changes: Mapping[str, object]) -> Capture:
    for name in FIXED:
        if name in changes and changes[name] != record.get(name):
            to_do = message("Remove the capture and upload it again.")
            raise InputError("the '{name}' that the capture came with", "something else", to_do, name, name=name)
    before = {path for path, _ in unknown_fields(parse_capture(record, "record"))}
    changed = parse_capture(merge_patch(record, changes), "request")
    require_known_fields(changed, "request", before)
    return changed


def _changed_meanwhile(what: str) -> ConflictError:
    to_do = "Send the request again."
    return ConflictError("a {what} that rests", "one that was just changed", to_do, what, what=what)


def require_rigid(cell: Cell) -> None:
    """Refuse a cell whose known frames are no rigid transforms; raises InputError."""
    for name, (into, outof) in _FRAMES.items():
        matrix = getattr(cell.known, name)
        if matrix is None:
            continue
        try:
            RigidTransform.from_rounded(matrix, into, outof)
        except CalibrationError as error:
            raise InputError(error.need, error.got, error.to_do, f"cell.known.{name}") from None
