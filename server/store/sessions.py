"""Sessions: made, listed, read as a whole, changed, removed."""

import re
import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from sqlalchemy import Select, Text, cast, delete, func, or_, select, tuple_
from sqlalchemy.orm import Session as Transaction
from sqlalchemy.orm import defer

from calib_core.captures.observation_cache import keeping
from calib_core.errors import CalibrationError, NotFoundError
from calib_core.moment import now
from calib_core.records import Measured, Session, parse_session
from calib_core.review.answer import cell_id_of
from server.store.audit import note_change, note_difference
from server.store.blobs import Blobs
from server.store.database import record_event
from server.store.models import CaptureRow, Data, FileRow, OutputRow, ResultRow, SessionRow, folded
from server.store.paging import Page, after_cursor, page_of
from server.store.process_data import Output, with_stale
from server.store.session_files import files_read
from server.store.signed_log import note
from server.store.staleness import stale_stages

Read = TypeVar("Read")

OF_ARCHIVE, ARCHIVED = "archive", "archive:"
"""What lies beside session and results, and how its names begin: so no stage's output ever has the same."""
"""In place of a stage: of outputs that came with an archive and belong to none."""


class KeptRecords(Generic[Read]):
    """What texts were read into; bounded by the texts' length, and what nobody asks for any more is let go of.

    Parameters
    ----------
    read : callable
        Makes the record of a text.
    most_characters : int
        Of all the texts together; the ones that were asked for longest ago go first.
    rest_s : float
        A record that nobody asked for in this time goes when another one is read.
    """

    def __init__(self, read: Callable[[str], Read], most_characters: int, rest_s: float) -> None:
        self._read = read
        self._most_characters, self._rest_s = most_characters, rest_s
        self._kept: OrderedDict[str, tuple[float, Read]] = OrderedDict()  # what was asked for last is last
        self._characters = 0
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def of(self, text: str) -> Read:
        """Return the record of a text; it may be the one that others have, so nobody may change it."""
        now_s = time.monotonic()
        with self._lock:
            known = self._kept.pop(text, None)
            if known is not None:
                self._kept[text] = (now_s, known[1])
                return known[1]
        record = self._read(text)
        with self._lock:
            if text not in self._kept:
                self._characters += len(text)
            self._kept[text] = (now_s, record)
            self._let_go(now_s)
        return record

    def _let_go(self, now_s: float) -> None:
        while self._kept:
            text, (asked_s, _) = next(iter(self._kept.items()))
            if self._characters <= self._most_characters and now_s - asked_s <= self._rest_s:
                return
            del self._kept[text]
            self._characters -= len(text)


class OutdatedError(CalibrationError):
    """A change that was made against an older revision than the stored one."""

    code = "outdated"
    status = 412


@dataclass(frozen=True)
class StoredSession:
    """All of a session at one moment, for solving, guiding and drawing.

    `digests` maps the file names in the captures' records to the SHA-256 of their content; `results` maps each
    stage to its latest result, as JSON data; `outputs` the names of what stages made beside them; `simulated` is
    the simulated cell that it is of; `kept` the SHA-256 of what else lies beside it, certificates among it.
    """

    id: str
    session: Session
    measured: Mapping[str, Measured]
    results: Mapping[str, Data]
    digests: Mapping[str, str]
    outputs: Mapping[str, Output]
    blobs: Blobs
    simulated: Data | None = None
    kept: Mapping[str, str] = field(default_factory=dict[str, str])

    def read(self, name: str) -> bytes:
        """Return the bytes of a capture's file, or of one that lies beside them; raises NotFoundError."""
        digest = self.digests.get(name) or self.kept.get(name)
        if digest is None:
            raise NotFoundError("a file named {name}", "none", "Check the capture's `files`.", name, name=name)
        return self.blobs.read(digest)

    def read_output(self, name: str) -> bytes | None:
        """Return the bytes of a file that a stage made, None where there is none of this name."""
        output = self.outputs.get(name)
        return None if output is None else self.blobs.read(output.sha256)

    @property
    def reader(self) -> Callable[[str], bytes]:
        """`read`, and what is seen in the files is kept."""
        return keeping(self.read, self.blobs.observations)

    @property
    def stale(self) -> list[str]:
        """The stages whose latest result was solved from something else, in the results' order."""
        from calib_core.graph.keys import Graph

        stale = Graph(self.session, self.digests.__getitem__).stale(self.results)
        return [stage for stage in self.results if stage in stale]

    def results_with_stale(self) -> dict[str, Data]:
        """Return the results, each with whether its inputs changed since, and what it means at the workpiece."""
        return with_stale(self.session, self.results, self.digests)


def new_id() -> str:
    """Return a name that nobody can guess and nothing else has."""
    return secrets.token_hex(8)


def create_session(db: Transaction, record: Data, simulated: Data | None) -> SessionRow:
    """Store a new session; `record` is a session record without captures."""
    moment = now()
    row = SessionRow(
        id=new_id(),
        name=record.get("name", ""),
        created=moment,
        updated=moment,
        record=record,
        simulated=simulated,
    )
    db.add(row)
    db.flush()
    record_event(db, row, "session", {"action": "added"})
    return row


def session_row(db: Transaction, session_id: str) -> SessionRow:
    """Return a session's row; raises NotFoundError."""
    return _required(db.get(SessionRow, session_id), session_id)


def locked_session(db: Transaction, session_id: str) -> SessionRow:
    """Return a session's row, locked until this transaction ends; raises NotFoundError."""
    row = db.get(SessionRow, session_id, with_for_update=True, populate_existing=True)
    return _required(row, session_id)


def _required(row: SessionRow | None, session_id: str) -> SessionRow:
    if row is None:
        raise no_such_session(session_id)
    return row


def no_such_session(session_id: str) -> NotFoundError:
    """Return what is said where a session is not there."""
    to_do = "List the sessions: it may have been removed."
    return NotFoundError("the name of a session", repr(session_id), to_do, "session")


def require_revision(row: SessionRow | CaptureRow, if_match: str | None) -> None:
    """Refuse a change that was made against another revision.

    Raises
    ------
    OutdatedError
        If `if_match` (the If-Match header) is given and does not name the stored revision.
    """
    if (
        if_match is not None
        and if_match.strip() != "*"
        and etag(row) not in {p.strip() for p in if_match.split(",")}
    ):
        to_do = "Read it again, make the change there, and send it with the new ETag."
        raise OutdatedError("the stored revision {row} in If-Match", if_match[:80], to_do, row.id, row=etag(row))


def etag(row: SessionRow | CaptureRow) -> str:
    """Return a row's entity tag."""
    return f'"{row.revision}"'


def touch(row: SessionRow) -> None:
    """Note that a session's record or one of its captures was changed."""
    row.revision += 1
    row.updated = now()


STORE_FIELDS = frozenset({"id", "created", "updated", "revision", "scene", "simulated"})
"""What the store knows about a session beside its record; what comes back with a record is left out of it."""


def session_data(db: Transaction, row: SessionRow) -> Data:
    """Return a session's record, captures inside, with what the store knows about it."""
    captures = db.scalars(
        select(CaptureRow.record).where(CaptureRow.session_id == row.id).order_by(CaptureRow.position)
    )
    return {
        **row.record,
        "captures": list(captures),
        **row.fields("id", "created", "updated", "revision"),
        "scene": f"/scenes/{row.id}/",
        "simulated": row.simulated is not None,
    }


def empty_session(record: Data, session_id: str) -> Session:
    """Return the session of a stored record, without captures: all that measuring one of them needs."""
    return parse_session({**record, "captures": []}, session_id)


# The session that is worked on is asked for again with every event; a record takes six times its text's room.
_HASH = re.compile(r"[0-9a-fA-F]{8,64}$")
_MEASURED = KeptRecords(Measured.model_validate_json, most_characters=6_000_000, rest_s=30.0)


class _MeasuredWhenAsked(Mapping[str, Measured]):
    """What was measured, by capture, read from its JSON text when it is asked for: mostly it is not."""

    def __init__(self, texts: Mapping[str, str]) -> None:
        self._texts = texts

    def __getitem__(self, capture: str) -> Measured:
        return _MEASURED.of(self._texts[capture])

    def __iter__(self) -> Iterator[str]:
        return iter(self._texts)

    def __len__(self) -> int:
        return len(self._texts)


def load_session(db: Transaction, blobs: Blobs, session_id: str) -> StoredSession:
    """Return all of a session; raises NotFoundError."""
    row = session_row(db, session_id)
    captures = db.execute(
        select(CaptureRow.id, CaptureRow.record, cast(CaptureRow.measured, Text).label("measured"))
        .where(CaptureRow.session_id == session_id)
        .order_by(CaptureRow.position)
    ).all()
    files = db.execute(files_read([session_id]))
    beside = db.scalars(select(OutputRow).where(OutputRow.session_id == session_id)).all()
    return StoredSession(
        id=session_id,
        session=parse_session({**row.record, "captures": [c.record for c in captures]}, session_id),
        measured=_MeasuredWhenAsked({c.id: c.measured for c in captures}),
        results=latest_results(db, session_id),
        digests={name: sha256 for _, name, sha256 in files},
        outputs={row.name: Output(row.sha256, row.size) for row in beside if row.stage != OF_ARCHIVE},
        kept={row.name.removeprefix(ARCHIVED): row.sha256 for row in beside if row.stage == OF_ARCHIVE},
        blobs=blobs,
        simulated=row.simulated,
    )


def stored_record(db: Transaction, session_id: str) -> Session:
    """Return a session's record with its captures; raises NotFoundError."""
    row = session_row(db, session_id)
    captures = db.scalars(
        select(CaptureRow.record).where(CaptureRow.session_id == session_id).order_by(CaptureRow.position)
    )
    return parse_session({**row.record, "captures": list(captures)}, session_id)


def latest_results(db: Transaction, session_id: str) -> dict[str, Data]:
    """Return each stage's latest result, as JSON data."""
    latest = select(func.max(ResultRow.number)).where(ResultRow.session_id == session_id).group_by(ResultRow.stage)
    rows = db.scalars(select(ResultRow).where(ResultRow.number.in_(latest)).order_by(ResultRow.number))
    return {row.stage: row.proved() for row in rows}


def _with_result_from(begin: str) -> Select[str]:
    """Select the sessions that have a result computed from what has this SHA-256, or one that begins so."""
    hashed = ResultRow.record["inputs_sha256"].as_string()
    return select(ResultRow.session_id).where(hashed.startswith(begin.lower(), autoescape=True))


def list_sessions(db: Transaction, limit: int, cursor: str | None, search: str) -> Page:
    """Return a page of sessions, the newest first."""
    query = select(SessionRow).options(defer(SessionRow.simulated))
    if search:
        named = SessionRow.name_folded.contains(folded(search), autoescape=True)
        query = query.where(
            or_(named, SessionRow.id.in_(_with_result_from(search))) if _HASH.match(search) else named
        )
    if cursor is not None:
        created, last_id = after_cursor(cursor, str, str)
        # As a row: either database then begins in the index where the page before ended.
        query = query.where(tuple_(SessionRow.created, SessionRow.id) < (created, last_id))
    query = query.order_by(SessionRow.created.desc(), SessionRow.id.desc()).limit(limit + 1)
    rows = list(db.scalars(query))
    ids = [row.id for row in rows]
    counts = _capture_counts(db, ids)
    verdicts, stale = _verdicts(db, ids), stale_stages(db, ids)
    items = [
        {
            **row.fields("id", "name", "created", "updated"),
            "cell": row.record["cell"],
            "cell_id": cell_id_of(row.record["cell"].get("id"), row.name),
            "capture_count": counts.get(row.id, 0),
            "archived": bool(row.record.get("archived")),
            "verdicts": verdicts.get(row.id, {}),
            "stale": sorted(stale.get(row.id, ())),
        }
        for row in rows
    ]
    return page_of(items, limit, lambda item: [item["created"], item["id"]])


def _capture_counts(db: Transaction, ids: list[str]) -> dict[str, int]:
    query = select(CaptureRow.session_id, func.count()).where(CaptureRow.session_id.in_(ids))
    return dict(db.execute(query.group_by(CaptureRow.session_id)).all())


def _verdicts(db: Transaction, ids: list[str]) -> dict[str, dict[str, str]]:
    query = select(ResultRow.session_id, ResultRow.stage, ResultRow.verdict).where(ResultRow.session_id.in_(ids))
    verdicts: dict[str, dict[str, str]] = {}
    for session_id, stage, verdict in db.execute(query.order_by(ResultRow.number)):
        verdicts.setdefault(session_id, {})[stage] = verdict
    return verdicts


def change_session(db: Transaction, row: SessionRow, record: Data, measured: Mapping[str, Data]) -> None:
    """Replace a session's record (without captures) and, by capture id, what was measured anew."""
    note_difference(row.record, record)
    row.record = record
    row.name = record.get("name", "")
    for capture_id, data in measured.items():
        db.get_one(CaptureRow, (row.id, capture_id)).measured = data
        record_event(db, row, "capture", {"action": "changed", "capture": capture_id})
    touch(row)
    record_event(db, row, "session", {"action": "changed"})


def delete_session(db: Transaction, session_id: str) -> set[str]:
    """Remove a session with all that belongs to it; returns its files' digests (see `remove_unreferenced`)."""
    row = locked_session(db, session_id)
    digests = set(db.scalars(select(FileRow.sha256).where(FileRow.session_id == session_id)))
    digests |= set(db.scalars(select(OutputRow.sha256).where(OutputRow.session_id == session_id)))
    note_change({"before": {"name": row.name, "cell": row.cell_id}, "after": None})
    record_event(db, row, "session", {"action": "removed"})
    note(db, "removed", session_id, {"cell": row.cell_id})
    db.execute(delete(SessionRow).where(SessionRow.id == session_id).execution_options(synchronize_session=False))
    return digests
