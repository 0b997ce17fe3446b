"""What is wrong with a store, named by session and capture; nothing is changed unless it is asked for."""

import json
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import sqlalchemy as sa
from sqlalchemy.exc import DBAPIError

from calib_core.archive.stored_results import require_result
from calib_core.errors import CalibrationError
from calib_core.messages import message, plural
from calib_core.records import Measured, parse_session
from server.settings import Settings
from server.store.blob_places import open_blobs
from server.store.blobs import Blobs
from server.store.changed_rows import changed_rows
from server.store.engine import engine_of, reading
from server.store.folder import require_store
from server.store.schema import head_revision, stored_revision

Kind = Literal["damage", "leftover", "note"]
Row = dict[str, Any]

# Tables by the columns that they have had since the first version: any store can be examined.
_SESSIONS: Final = sa.table(
    "sessions", sa.column("id"), sa.column("name"), sa.column("record", sa.Text), sa.column("last_event")
)
_CAPTURES: Final = sa.table(
    "captures", sa.column("session_id"), sa.column("id"), sa.column("position"),
    sa.column("record", sa.Text), sa.column("measured", sa.Text),
)  # fmt: skip
_FILES: Final = sa.table(
    "files", sa.column("session_id"), sa.column("capture_id"), sa.column("name"), sa.column("sha256"),
    sa.column("size"),
)  # fmt: skip
_OUTPUTS: Final = sa.table("outputs", sa.column("session_id"), sa.column("name"), sa.column("sha256"))
_RESULTS: Final = sa.table(
    "results", sa.column("number"), sa.column("session_id"), sa.column("stage"), sa.column("record", sa.Text)
)
_EVENTS: Final = sa.table("events", sa.column("session_id"), sa.column("id"))


@dataclass(frozen=True)
class Finding:
    """One thing that was found: `damage` (something stored is lost), `leftover` (harmless), or a `note`."""

    kind: Kind
    what: str
    session: str = ""
    capture: str = ""
    sha256: str = ""


@dataclass
class Examination:
    """What was looked at, and what was found."""

    sessions: int = 0
    captures: int = 0
    files: int = 0
    findings: list[Finding] = field(default_factory=list[Finding])

    @property
    def damaged(self) -> bool:
        """Whether something stored is lost."""
        return any(finding.kind == "damage" for finding in self.findings)


Progress = Callable[[float, str], None]


def examine(settings: Settings, progress: Progress = lambda _fraction, _what: None) -> Examination:
    """Return what is wrong with a store; it may be in use meanwhile, and is not changed.

    Raises
    ------
    InputError
        If there is no store.
    """
    require_store(settings)
    found = Examination()
    blobs = open_blobs(settings.blob_place, make=False)
    engine = reading(engine_of(settings.sql_url, read_only=True))
    try:
        with engine.connect() as connection:
            _integrity(connection, found)
            _revision(connection, found)
            _records(connection, found)
            if stored_revision(connection) == head_revision():
                named = {(one.session, one.capture) for one in found.findings if one.capture}
                found.findings += (
                    Finding("damage", *one) for one in changed_rows(connection) if one[1:] not in named
                )
            _blobs(connection, blobs, found, progress)
    except DBAPIError as error:
        said = " ".join(str(error.orig).split())
        what = message(
            "the database cannot be read: {said}. Restore it from a backup (`scancell restore`).", said=said
        )
        found.findings.append(Finding("damage", what))
    finally:
        engine.dispose()
    return found


def referring(connection: sa.Connection) -> Generator[Row]:
    """Give the rows of captures' files and of results' outputs that refer to blobs, in the order of these."""
    tables = [_FILES, *([_OUTPUTS] if sa.inspect(connection).has_table("outputs") else [])]
    for table in tables:
        query = sa.select(table).order_by(table.c.sha256).execution_options(yield_per=1000)
        with connection.execute(query) as found:
            yield from rows_of(found)


def rows_of(found: sa.CursorResult[Any]) -> Iterator[Row]:
    """Give the rows that a query found, by the columns' names."""
    names = list(found.keys())
    for row in found:
        yield dict(zip(names, row, strict=True))


def _integrity(connection: sa.Connection, found: Examination) -> None:
    if connection.dialect.name != "sqlite":  # PostgreSQL keeps checksums of its own
        return
    for (said,) in connection.exec_driver_sql("PRAGMA integrity_check"):
        if said != "ok":
            found.findings.append(Finding("damage", message("the database is damaged: {said}", said=said)))
    for row in connection.exec_driver_sql("PRAGMA foreign_key_check"):
        what = message("a row of {table} belongs to one of {other} that is not there", table=row[0], other=row[2])
        found.findings.append(Finding("damage", what))


def _revision(connection: sa.Connection, found: Examination) -> None:
    stored, head = stored_revision(connection), head_revision()
    if stored == head:
        return
    said = message(
        "the tables are those of another version of scancell; use that one (they have {stored}, this has {head})"
        if stored is None or stored > head
        else "the tables are those of an earlier version; the next start brings it up to date "
        "(they have {stored}, this has {head})",
        stored=stored,
        head=head,
    )
    found.findings.append(Finding("note", said))


def _records(connection: sa.Connection, found: Examination) -> None:
    for row in list(rows_of(connection.execute(sa.select(_SESSIONS).order_by(_SESSIONS.c.id)))):
        found.sessions += 1
        _session(connection, row, found)


def _session(connection: sa.Connection, row: Row, found: Examination) -> None:
    """Hold a session's rows against the records that they should be, and against each other."""
    session = row["id"]

    def damage(what: str, capture: str = "") -> None:
        found.findings.append(Finding("damage", what, session, capture))

    captures = connection.execute(
        sa.select(_CAPTURES).where(_CAPTURES.c.session_id == session).order_by(_CAPTURES.c.position)
    ).mappings()
    named = _files_of(connection, session)
    records: list[Any] = []
    for capture in captures:
        found.captures += 1
        try:
            record = _data(capture["record"])
            Measured.model_validate(_data(capture["measured"]))
        except ValueError as error:  # pydantic's are of this kind too
            damage(message("its record is not what was stored: {error}", error=_first_line(error)), capture["id"])
            continue
        records.append(record)
        if sorted(record.get("files", [])) != sorted(named.get(capture["id"], [])):
            damage(message("its record names other files than are stored"), capture["id"])
    try:
        parse_session({**_data(row["record"]), "captures": records}, "session.json")
    except (ValueError, CalibrationError) as error:
        damage(message("its record is not what was stored: {error}", error=_first_line(error)))
    _results(connection, session, damage)
    last = connection.scalar(sa.select(sa.func.max(_EVENTS.c.id)).where(_EVENTS.c.session_id == session))
    if last is not None and last != row["last_event"]:
        damage(message("its log ends at {last}, not at {told}", last=last, told=row["last_event"]))


def _files_of(connection: sa.Connection, session: str) -> dict[str, list[str]]:
    query = sa.select(_FILES.c.capture_id, _FILES.c.name).where(_FILES.c.session_id == session)
    named: dict[str, list[str]] = {}
    for capture, name in connection.execute(query):
        named.setdefault(capture, []).append(name)
    return named


def _results(connection: sa.Connection, session: str, damage: Callable[[str], None]) -> None:
    for result in connection.execute(sa.select(_RESULTS).where(_RESULTS.c.session_id == session)).mappings():
        try:
            require_result(result["stage"], _data(result["record"]), f"result {result['number']}")
        except (ValueError, CalibrationError) as error:
            said = _first_line(error)
            damage(
                message("its result of {stage} is not what was stored: {error}", stage=result["stage"], error=said)
            )


def _blobs(connection: sa.Connection, blobs: Blobs, found: Examination, progress: Progress) -> None:
    known: dict[str, str | None] = {}
    total = connection.scalar(sa.select(sa.func.count()).select_from(_FILES)) or 1
    for row in referring(connection):
        digest = row["sha256"]
        if digest not in known:
            known[digest] = blobs.damage(digest)
            progress(min(found.files / total, 1.0), message("comparing files"))
        found.files += 1
        wrong = known[digest]
        if wrong:
            found.findings.append(_damaged(row, wrong))
    orphans = sum(digest not in known for digest in blobs.digests())
    if orphans:
        what = plural(
            "{count} stored file that nothing refers to; `--repair` removes it",
            "{count} stored files that nothing refers to; `--repair` removes them",
            by="count",
            count=orphans,
        )
        found.findings.append(Finding("leftover", what))
    halves = blobs.interrupted()
    if halves:
        what = plural(
            "{count} file of an upload that is under way or was cut off; the next start, or `--repair`, removes "
            "it",
            "{count} files of uploads that are under way or were cut off; the next start, or `--repair`, removes "
            "them",
            by="count",
            count=len(halves),
        )
        found.findings.append(Finding("leftover", what))


def _damaged(row: Row, wrong: str) -> Finding:
    to_do = message(
        "Restore it from a backup (`scancell doctor --repair --backup DIR`), or upload the capture again."
    )
    if "capture_id" not in row:
        to_do = message(
            "Solve the stage again, or restore it from a backup (`scancell doctor --repair --backup DIR`)."
        )
    what = message(
        "the file {name} is {wrong} ({digest}…). {to_do}",
        name=row["name"],
        wrong=wrong,
        digest=row["sha256"][:12],
        to_do=to_do,
    )
    return Finding("damage", what, row["session_id"], row.get("capture_id", ""), row["sha256"])


def _data(stored: Any) -> Any:
    """Return what a column of JSON holds: SQLite gives its text, PostgreSQL's driver has read it already."""
    return json.loads(stored) if isinstance(stored, str) else stored


def _first_line(error: Exception) -> str:
    return str(error).splitlines()[0][:200]
