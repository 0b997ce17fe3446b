"""A session's past: what came when, how everything stood at each moment, and every result that there was."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, TypeVar

from sqlalchemy import select
from sqlalchemy.orm import Session as Transaction
from sqlalchemy.orm import undefer

from calib_core.archive.release_file import RELEASE_FILE, acknowledged_told, release_told
from calib_core.captures.measured import measured_of
from calib_core.errors import InputError, NotFoundError
from calib_core.findings import verdict_of
from calib_core.findings.codes.quality import FILES_REMOVED
from calib_core.messages import message
from calib_core.records import Capture, LimitChange, Measured, Session, parse_session
from calib_core.records.policy import Excluded, Removed
from calib_core.review.standing import said_acknowledgement, said_release, said_signed
from calib_core.stages.verify.limits import said_change
from server.store.blobs import Blobs
from server.store.models import CaptureRow, Data, JobRow, OutputRow, ReleaseRow, ResultRow, SessionRow
from server.store.releases import release_data
from server.store.sessions import ARCHIVED, StoredSession, load_session, session_row
from server.store.solves import ALL, COMPARE, REPLAY
from server.store.standing import acknowledgements_of

if TYPE_CHECKING:
    from calib_core.review.compare import Compared

_Read = TypeVar("_Read")


@dataclass(frozen=True)
class PastResult:
    """One result of a session: its number, when it came, and what it was solved from as far as that is known."""

    number: int
    stage: str
    created: str
    record: Data
    session: Session | None
    files: Mapping[str, str]


@dataclass(frozen=True)
class Moment:
    """How a session stood at one place of its time line; `numbers` are those of its results by stage."""

    place: int
    stored: StoredSession
    numbers: Mapping[str, int]


def timeline(db: Transaction, blobs: Blobs, session_id: str) -> list[Data]:
    """Return what happened in a session, in order: captures, results, releases, failed solves; `now` ends it.

    Captures that were removed since stand before the first result that they were in.

    Raises
    ------
    NotFoundError
    """
    session = session_row(db, session_id)
    past = past_results(db, session_id)
    others = (
        *_results(past),
        *_limits(session.record),
        *_removed(session.record),
        *_released(db, session_id),
        *_acknowledged(db, blobs, session, past),
        *_brought(db, blobs, session_id, past),
        *_ended_without_result(db, session_id),
    )
    items = [*_captures(db, session_id, past), *others]
    items.sort(key=lambda item: item[0])
    found = [data for _, data in items]
    found.append({"kind": "now", "at": max([session.updated, *(item["at"] for item in found)])})
    return [{"place": place, **data} for place, data in enumerate(found)]


def moment(db: Transaction, blobs: Blobs, session_id: str, place: int) -> Moment:
    """Return how a session stood at a place of its time line, counted from 0.

    Captures are as the next solve found them, or as they are now where none came after.

    Raises
    ------
    NotFoundError
        If there is no such session or place.
    """
    items = timeline(db, blobs, session_id)
    if not 0 <= place < len(items):
        need = "a place on the time line from 0 to {count}"
        raise NotFoundError(need, f"{place}", "Read the time line.", "place", count=len(items) - 1)
    stored = load_session(db, blobs, session_id)
    if place == len(items) - 1:
        return Moment(place, stored, latest_numbers(db, session_id))
    past = {result.number: result for result in past_results(db, session_id)}
    before = items[: place + 1]
    numbers = {item["stage"]: item["number"] for item in before if item["kind"] == "result"}
    earlier = [past[item["number"]] for item in before if item["kind"] == "result"]
    later = [past[item["number"]] for item in items[place:] if item["kind"] == "result"]
    ids = list(dict.fromkeys(item["capture"] for item in before if item["kind"] == "capture"))
    session = _session_then(stored.session, ids, _sessions(earlier), _sessions(later))
    digests: dict[str, str] = {}
    for result in past.values():
        digests |= result.files
    digests |= stored.digests
    then = StoredSession(
        id=stored.id,
        session=session,
        measured=measured_then(stored.measured, session, before),
        results={stage: past[number].record for stage, number in numbers.items()},
        digests=digests,
        outputs=stored.outputs,
        blobs=blobs,
        kept=stored.kept,
    )
    return Moment(place, then, numbers)


def latest_numbers(db: Transaction, session_id: str) -> dict[str, int]:
    """Return the number of each stage's latest result."""
    query = select(ResultRow.stage, ResultRow.number).where(ResultRow.session_id == session_id)
    return dict(db.execute(query.order_by(ResultRow.number)).all())


def stage_history(db: Transaction, session_id: str, stage: str) -> list[PastResult]:
    """Return all results of a stage, the newest first; raises NotFoundError where there is no such session."""
    session_row(db, session_id)
    return [result for result in reversed(past_results(db, session_id, stage)) if result.stage == stage]


def past_result(db: Transaction, session_id: str, stage: str, number: int | None = None) -> PastResult:
    """Return a result of a stage by its number, or the latest; raises NotFoundError."""
    found = [r for r in stage_history(db, session_id, stage) if number is None or r.number == number]
    if not found:
        got = message("'{stage}', which was not solved", stage=stage) if number is None else f"{number}"
        to_do = "List its history; solve the stage where it is empty."
        raise NotFoundError("a result of this stage", got, to_do, "number")
    return found[0]


def compared(db: Transaction, blobs: Blobs, stage: str, side: str) -> "Compared":
    """Return one side of a comparison by its name, SESSION or SESSION:NUMBER, without a number the latest result.

    Raises
    ------
    InputError
        If the number is none.
    NotFoundError
        If there is no such session or result.
    """
    from calib_core.review.compare import Compared

    session_id, _, number = side.partition(":")
    if number and not (number.isascii() and number.isdigit() and len(number) < 16):
        raise InputError("SESSION or SESSION:NUMBER", repr(side), "Take both from the session's history.", "side")
    found = past_result(db, session_id, stage, int(number) if number else None)
    now = load_session(db, blobs, session_id).session
    files = found.files if found.session is not None else None
    return Compared(session_id, found.record, found.session or now, files, found.number, found.created)


def past_results(db: Transaction, session_id: str, stage: str | None = None) -> list[PastResult]:
    """Return all results of a session, or of one stage, in the order in which they came."""
    query = select(ResultRow).options(undefer(ResultRow.solved_from)).where(ResultRow.session_id == session_id)
    if stage is not None:
        query = query.where(ResultRow.stage == stage)
    return [_past(row) for row in db.scalars(query.order_by(ResultRow.number))]


def _past(row: ResultRow) -> PastResult:
    solved_from = row.origin()
    return PastResult(
        number=row.number,
        stage=row.stage,
        created=row.created,
        record=row.proved(),
        session=parse_session(solved_from["session"], row.session_id) if solved_from else None,
        files=solved_from["files"] if solved_from else {},
    )


_Item = tuple[tuple[str, int, int], Data]


def _captures(db: Transaction, session_id: str, past: Sequence[PastResult]) -> Iterator[_Item]:
    rows = db.scalars(select(CaptureRow).where(CaptureRow.session_id == session_id).order_by(CaptureRow.position))
    since: dict[str, str] = {}
    for row in rows:
        since[row.id] = row.created
        data = {"kind": "capture", "at": row.created, "capture": row.id, "step": row.record["step"]}
        told_of = {"verdict": row.measured["verdict"], "removed": False}
        names = ("excluded_because", "included_because", "added_because", "changed_because")
        told_of |= {name: row.record[name] for name in names if row.record.get(name)}
        yield (row.created, 0, row.position), {**data, **told_of}
    told: set[str] = set()
    for result in past:
        for position, capture in enumerate(result.session.captures if result.session else ()):
            # Another capture of this name may have come since.
            if capture.id in told or since.get(capture.id, "~") <= result.created:
                continue
            told.add(capture.id)
            data = {"kind": "capture", "at": result.created, "capture": capture.id, "step": capture.step}
            verdict = verdict_of([FILES_REMOVED()])
            yield (result.created, 0, position), {**data, "verdict": verdict, "removed": True}


def _results(past: Sequence[PastResult]) -> Iterator[_Item]:
    for result in past:
        data = {"kind": "result", "at": result.created, "stage": result.stage, "number": result.number}
        yield (
            (result.created, 1, result.number),
            {**data, "verdict": result.record["verdict"], "software": result.record["software"]},
        )


def _limits(record: Data) -> Iterator[_Item]:
    """Return each late change of the verification's limits."""
    for place, one in enumerate((record["cell"].get("verification") or {}).get("changes") or ()):
        change = LimitChange.model_validate(one)
        yield (change.at, 0, place), {"kind": "limit", "at": change.at, "message": said_change(change)}


def _removed(record: Data) -> Iterator[_Item]:
    """Return each capture that was removed once something was solved: by whom, when and why."""
    for place, one in enumerate(record.get("removed") or ()):
        told = Removed.model_validate(one)
        because = told.model_dump(include={*Excluded.model_fields}, exclude_none=True)
        data = {"kind": "removed", "at": told.when, "capture": told.capture, "removed_because": because}
        yield (told.when, 0, place), {**data, "step": told.step or None}


def _released(db: Transaction, session_id: str) -> Iterator[_Item]:
    """Return each release of one of its answers: who decided, when and why."""
    for row in db.scalars(select(ReleaseRow).where(ReleaseRow.session_id == session_id)):
        yield (
            (row.created, 3, row.number),
            {"kind": "release", "at": row.created, "message": said_release(release_data(row))},
        )


def _acknowledged(
    db: Transaction, blobs: Blobs, session: SessionRow, past: Sequence[PastResult]
) -> Iterator[_Item]:
    """Return who acknowledged that the cell changed with it, or its equipment, when and why."""
    brought = next(_read_then(_release_file(db, blobs, session.id), past, acknowledged_told), ())
    for place, one in enumerate(acknowledgements_of(db, session, brought)):
        message = said_signed(said_acknowledgement(one), one)
        yield (one["created"], 3, place), {"kind": "acknowledged", "at": one["created"], "message": message}


def _brought(db: Transaction, blobs: Blobs, session_id: str, past: Sequence[PastResult]) -> Iterator[_Item]:
    """Return the release that came with an archive, of the answer that it is of, however long ago."""
    for told in islice(_read_then(_release_file(db, blobs, session_id), past, release_told), 1):
        data = {"kind": "release", "at": told["created"], "message": said_signed(said_release(told), told)}
        yield (told["created"], 3, 0), {**data, "brought": True}


def _read_then(content: bytes, past: Sequence[PastResult], read: Callable[..., _Read | None]) -> Iterator[_Read]:
    """Give what a `release.json` tells of the results as they were after each solve, where it tells anything."""
    results: dict[str, Data] = {}
    for result in past if content else ():
        results[result.stage] = result.record
        if told := read(content, results, str(result.record.get("solved"))):
            yield told


def _release_file(db: Transaction, blobs: Blobs, session_id: str) -> bytes:
    kept = db.get(OutputRow, (session_id, ARCHIVED + RELEASE_FILE))
    return b"" if kept is None else blobs.read(kept.sha256)


def _ended_without_result(db: Transaction, session_id: str) -> Iterator[_Item]:
    query = select(JobRow).where(JobRow.session_id == session_id, JobRow.status.in_(("failed", "cancelled")))
    for row in db.scalars(query.where(JobRow.stage.not_in((ALL, COMPARE, REPLAY)))):
        at = row.finished or row.created
        data = {"kind": row.status, "at": at, "stage": row.stage}
        yield (at, 2, 0), {**data, "message": row.error["detail"] if row.error else row.message}


def _sessions(past: Sequence[PastResult]) -> list[Session]:
    return [result.session for result in past if result.session is not None]


def _session_then(
    now: Session, ids: Sequence[str], earlier: Sequence[Session], later: Sequence[Session]
) -> Session:
    """Return a session as it was between what earlier and later solves found, with the captures of these ids."""
    captures: dict[str, Capture] = {}
    for session in [*earlier, now, *reversed(later)]:  # what is nearest in the future counts
        captures |= {capture.id: capture for capture in session.captures}
    nearest = later[0] if later else now
    stayed = {one.id for session in [*later, now] for one in session.captures} if later else captures.keys()
    there = [captures[name] for name in ids if name in captures and name in stayed]
    return nearest.model_copy(update={"captures": there})


def measured_then(
    measured: Mapping[str, Measured], session: Session, before: Sequence[Data]
) -> dict[str, Measured]:
    """Return what was measured; of a capture that was removed it is not known any more."""
    removed = {item["capture"]: item["removed"] for item in before if item["kind"] == "capture"}
    return {
        capture.id: measured_of(capture, [FILES_REMOVED()]) if removed[capture.id] else measured[capture.id]
        for capture in session.captures
    }
