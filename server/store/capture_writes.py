"""Captures on their way into a session, one or many at once.

The busiest path of all: its statements are made once and run as they are, without the unit of work, which would
cost several times as much.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Executable, bindparam, insert, select, update
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import CalibrationError, ConflictError
from calib_core.moment import now
from calib_core.records import Capture, Measured
from calib_core.records.policy import Excluded
from server.store.audit import who_acts
from server.store.calibrations import board_results
from server.store.database import publish_later
from server.store.json_text import JsonText
from server.store.models import CaptureRow, Data, EventRow, FileRow, ResultRow, SessionRow, WaitingRow
from server.store.row_seals import row_seal
from server.store.sessions import no_such_session

_SESSION = select(SessionRow.record, SessionRow.last_event, SessionRow.last_position).where(
    SessionRow.id == bindparam("session_id")
)
_LOCKED_SESSION = _SESSION.with_for_update()
_TAKEN_IDS = select(CaptureRow.id).where(
    CaptureRow.session_id == bindparam("session_id"), CaptureRow.id.in_(bindparam("ids", expanding=True))
)
_TAKEN_NAMES = select(FileRow.name, FileRow.sha256, FileRow.capture_id).where(
    FileRow.session_id == bindparam("session_id"), FileRow.name.in_(bindparam("names", expanding=True))
)
# Of one capture with one file, as most come: lists of ids are put into a statement anew each time.
_TAKEN_ID = select(CaptureRow.id).where(
    CaptureRow.session_id == bindparam("session_id"), CaptureRow.id == bindparam("ids")
)
_TAKEN_NAME = select(FileRow.name, FileRow.sha256, FileRow.capture_id).where(
    FileRow.session_id == bindparam("session_id"), FileRow.name == bindparam("names")
)
_TOUCH = (
    update(SessionRow)
    .where(SessionRow.id == bindparam("session"))
    .values(
        revision=SessionRow.revision + bindparam("count"),
        last_event=bindparam("event"),
        last_position=bindparam("place"),
        updated=bindparam("moment"),
    )
)
_VERIFIED = (
    select(ResultRow.number)
    .where(ResultRow.session_id == bindparam("session_id"), ResultRow.stage == "verify")
    .limit(1)
)
_ADD_CAPTURES, _ADD_FILES, _ADD_WAITING = insert(CaptureRow), insert(FileRow), insert(WaitingRow)
_ADD_EVENT = insert(EventRow)


_Named = tuple[Capture, Mapping[str, str]]


@dataclass(frozen=True)
class Arrival:
    """A capture with the SHA-256 and size in bytes of each of its files, by name; it may wait to be measured.

    `calibration` are the results by which raw frames were measured (`calibrations.board_results`), else None.
    """

    capture: Capture
    measured: Measured | JsonText
    digests: Mapping[str, str]
    sizes: Mapping[str, int]
    waits: bool = False
    calibration: tuple[int, ...] | None = None


def session_record(db: Transaction, session_id: str) -> Data:
    """Return a session's record without captures; raises NotFoundError."""
    found = db.connection().execute(_SESSION, {"session_id": session_id}).first()
    return _required(found, session_id)[0]


def _refusals(db: Transaction, session_id: str, arriving: Sequence[_Named]) -> list[CalibrationError | None]:
    """Return for each capture why it cannot be stored, None where it can."""
    ids = [capture.id for capture, _ in arriving]
    names = [name for _, digests in arriving for name in digests]
    taken_ids = {found for (found,) in _found(db, session_id, (_TAKEN_ID, _TAKEN_IDS), "ids", ids)}
    taken = _found(db, session_id, (_TAKEN_NAME, _TAKEN_NAMES), "names", names)
    taken_names: dict[str, tuple[str, str]] = {name: (digest, owner) for name, digest, owner in taken}
    reasons: list[CalibrationError | None] = []
    for capture, digests in arriving:
        reason = _refusal(capture, digests, taken_ids, taken_names)
        reasons.append(reason)
        if reason is None:  # the following ones must differ from this one too
            taken_ids.add(capture.id)
            taken_names.update({name: (digest, capture.id) for name, digest in digests.items()})
    return reasons


def _found(
    db: Transaction, session_id: str, statements: tuple[Executable, Executable], name: str, sought: list[str]
) -> Iterable[Any]:
    """Return the rows of what is sought, by the statement for one or the one for any number."""
    if not sought:
        return []
    of_one = len(sought) == 1
    told = {"session_id": session_id, name: sought[0] if of_one else sought}
    return db.connection().execute(statements[0 if of_one else 1], told)


def _refusal(
    capture: Capture, digests: Mapping[str, str], taken_ids: set[str], taken_names: Mapping[str, tuple[str, str]]
) -> CalibrationError | None:
    if capture.id in taken_ids:
        need = "a capture id that is new in this session"
        to_do = "Give the capture another id, or remove the stored one first."
        return ConflictError(need, "'{capture}', which is there already", to_do, capture.id, capture=capture.id)
    for name, digest in digests.items():
        known, owner = taken_names.get(name, (digest, ""))
        if known != digest:
            got = "{name}, which capture '{owner}' has with other content"
            to_do = "Name the file otherwise in the record's `files`."
            need = "file names that are new in this session"
            return ConflictError(need, got, to_do, capture.id, name=name, owner=owner)
    return None


def add_captures(
    db: Transaction, session_id: str, arriving: Sequence[Arrival], measured_for: Data
) -> list[JsonText | CalibrationError]:
    """Store captures in their order; return each with what was measured in it, as JSON, or why it is refused.

    Parameters
    ----------
    db : Transaction
    session_id : str
    arriving : sequence of Arrival
        Their files are blobs already.
    measured_for : dict
        The session's record that they were measured for.

    Raises
    ------
    NotFoundError
        If there is no such session.
    ConflictError
        If its cell was changed meanwhile.
    """
    db.flush()  # what this transaction did before comes first
    run, moment = db.connection().execute, now()
    session = run(_LOCKED_SESSION, {"session_id": session_id}).first()
    record, event, position = _required(session, session_id)
    if record["cell"] != measured_for["cell"]:
        raise ConflictError("a cell that rests", "one that was just changed", "Send the request again.", "cell")
    reasons = _refusals(db, session_id, [(a.capture, a.digests) for a in arriving])
    verified = is_verified(db, session_id)
    answers: list[JsonText | CalibrationError] = []
    captures: list[Data] = []
    files: list[Data] = []
    waiting: list[Data] = []
    for a, reason in zip(arriving, reasons, strict=True):
        if reason is not None:
            answers.append(reason)
            continue
        capture = _as_added(a.capture, moment) if verified else a.capture
        (told, data), (found, seen) = _with_text(capture), _with_text(a.measured)
        signed = {"session_id": session_id, "id": a.capture.id, "record": told, "measured": found}
        keys = {"session_id": session_id, "capture_id": a.capture.id}
        place = position + len(captures) + 1
        captures.append(
            {
                "session_id": session_id,
                "id": a.capture.id,
                "position": place,
                "created": moment,
                "record": data,
                "measured": seen,
                "seal": row_seal("captures", signed),
            }
        )
        files += [{**keys, "name": name, "sha256": d, "size": a.sizes[name]} for name, d in a.digests.items()]
        answers.append(JsonText(f'{data[:-1]}, "measured": {seen}}}'))
        if a.waits or (a.calibration is not None and a.calibration != board_results(db, session_id)):
            waiting.append(keys)
    if captures:
        run(_ADD_CAPTURES, captures)
        if waiting:
            run(_ADD_WAITING, waiting)
        if files:
            run(_ADD_FILES, files)
        told = EventRow(session_id=session_id, id=event + 1, kind="capture", data=_added(captures), created=moment)
        run(_ADD_EVENT, {name: getattr(told, name) for name in ("session_id", "id", "kind", "data", "created")})
        publish_later(db, told)
        touched = {"session": session_id, "count": len(captures), "event": event + 1, "moment": moment}
        run(_TOUCH, {**touched, "place": position + len(captures)})
    return answers


def is_verified(db: Transaction, session_id: str) -> bool:
    """Return whether a verification was solved: what is changed since is kept with who, when and why."""
    return db.connection().execute(_VERIFIED, {"session_id": session_id}).first() is not None


def _as_added(capture: Capture, moment: str) -> Capture:
    """Return a capture that comes after a verification, with who adds it."""
    why = capture.added_because and capture.added_because.why
    return capture.model_copy(update={"added_because": Excluded(who=who_acts(), when=moment, why=why)})


def _with_text(record: Capture | Measured | JsonText) -> tuple[Data, JsonText]:
    if isinstance(record, JsonText):
        return json.loads(record), record
    data = record.to_json()
    return data, JsonText(json.dumps(data, allow_nan=False, ensure_ascii=False))


def is_stored(db: Transaction, session_id: str, arrival: Arrival) -> bool:
    """Return whether this very capture is there already: it was sent again after an answer got lost."""
    row = db.get(CaptureRow, (session_id, arrival.capture.id))
    if row is None:
        return False
    told = arrival.capture.to_json()
    received = {"taken": told["taken"]} if arrival.capture.clock == "received" else {}
    stored, sent = ({**one, "added_because": None} for one in ({**row.record, **received}, told))
    if stored != sent:
        return False
    names = select(FileRow.name, FileRow.sha256).where(
        FileRow.session_id == session_id, FileRow.capture_id == arrival.capture.id
    )
    return dict(db.execute(names).all()) == dict(arrival.digests)


def _added(captures: Sequence[Data]) -> Data:
    """Return the one event that tells of all: by name where it is one, else how many and the last one's name."""
    data: Data = {"action": "added", "capture": captures[-1]["id"]}
    return data if len(captures) == 1 else {**data, "count": len(captures)}


def _required(found: Any, session_id: str) -> tuple[Data, int, int]:
    if found is None:
        raise no_such_session(session_id)
    return found
