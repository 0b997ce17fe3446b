"""Backups: all tables as of one moment and the blobs that they refer to, in a folder; and stores made of them.

They know no database: a backup of SQLite can be restored into PostgreSQL.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

import sqlalchemy as sa
from sqlalchemy.orm import Session as Transaction

from calib_core import __version__, counted
from calib_core.archive.folder import parse_json, to_json_bytes
from calib_core.disk import remove_file, remove_folder
from calib_core.errors import ConflictError, DamagedError, InputError, NotFoundError
from calib_core.formats.shared.writing import write_atomically
from calib_core.messages import Message, message
from calib_core.moment import now
from server.settings import Settings
from server.store.blob_folder import FolderBlobs
from server.store.blob_places import open_blobs
from server.store.blobs import CHUNK_BYTES, Blobs
from server.store.doctor import Progress, referring, rows_of
from server.store.engine import engine_of, reading
from server.store.folder import folder_lock, require_store
from server.store.schema import stored_revision, upgrade
from server.store.secrets import copy_key
from server.store.signed_log import begin

MANIFEST: Final = "backup.json"
_FORMAT: Final = "scancell-backup/1"
_ATTEMPTS: Final = 5
_ROWS: Final = 500


@dataclass(frozen=True)
class Backup:
    """What a backup holds: its moment, the tables' revision, rows by table, and blobs."""

    created: str
    revision: str
    rows: Mapping[str, int]
    blobs: int

    def said_of(self, place: Path) -> Message:
        """Return what it holds, of the place where it lies now."""
        return message(
            "{place}: {sessions}, {captures}, {files}, as of {created}",
            place=str(place),
            sessions=counted.sessions(self.rows["sessions"]),
            captures=counted.captures(self.rows["captures"]),
            files=counted.files(self.blobs),
            created=self.created,
        )


class _GoneError(Exception):
    """A blob was removed since the tables were read: its capture was deleted, and the tables must be read anew."""


def back_up(settings: Settings, target: Path, progress: Progress = lambda _fraction, _what: None) -> Backup:
    """Write a store as it is at one moment; a server may use it meanwhile.

    Parameters
    ----------
    settings : Settings
        Where the store is.
    target : Path
        A new folder, or one with an earlier backup, of which the blobs are kept; it holds the earlier one until
        the new one is whole.

    Raises
    ------
    ConflictError
        If there is something else in the folder.
    InputError
        If there is no store, or no room.
    DamagedError, NotFoundError
        If a stored file is damaged: `scancell doctor` names them all.
    """
    if target.exists() and not all(_is_ours(path) for path in target.iterdir()):
        raise ConflictError("a new folder, or a backup", "something else", "Name another.", str(target))
    require_store(settings)
    source = open_blobs(settings.blob_place)
    try:
        return _written(settings, source, target, progress)
    except OSError as error:
        got = (error.strerror or type(error).__name__).lower()
        to_do = "Make room there, or name another folder."
        raise InputError("a place to write to", got, to_do, str(target)) from None


def _is_ours(path: Path) -> bool:
    return path.name in (MANIFEST, "blobs") or path.name.startswith("tables-")


def _written(settings: Settings, source: Blobs, target: Path, progress: Progress) -> Backup:
    blobs = FolderBlobs(target / "blobs")
    engine = reading(engine_of(settings.sql_url, read_only=True))
    try:
        for _ in range(_ATTEMPTS):
            tables = target / f"tables-{sha256(now().encode()).hexdigest()[:12]}"
            with engine.connect() as connection:
                made = _tables(connection, tables)
                copy_key(settings.data, tables)
                try:
                    kept = _copied(connection, source, blobs, progress)
                except _GoneError:
                    remove_folder(tables)
                    continue
            backup = Backup(now(), made["revision"], made["rows"], len(kept))
            write_atomically(target / MANIFEST, to_json_bytes({**made, **_about(backup), "tables": tables.name}))
            _forget_earlier(target, tables, blobs, kept)
            return backup
    finally:
        engine.dispose()
    to_do = message("Make the backup when fewer sessions are being removed.")
    raise ConflictError("a store that rests for a moment", "files removed while they were copied", to_do)


def _about(backup: Backup) -> dict[str, Any]:
    return {
        "format": _FORMAT,
        "software": f"scancell {__version__}",
        "created": backup.created,
        "revision": backup.revision,
        "rows": dict(backup.rows),
        "blobs": backup.blobs,
    }


def _tables(connection: sa.Connection, folder: Path) -> dict[str, Any]:
    """Write every table as lines of JSON; returns the revision, the rows and the SHA-256 of each."""
    folder.mkdir(parents=True)
    metadata = _reflected(connection)
    rows: dict[str, int] = {}
    digests: dict[str, str] = {}
    for table in metadata.sorted_tables:
        digest = sha256()
        rows[table.name] = 0
        with (folder / f"{table.name}.jsonl").open("wb") as file:
            found = connection.execute(sa.select(table).execution_options(yield_per=_ROWS))
            for row in rows_of(found):
                line = json.dumps(row, ensure_ascii=False, allow_nan=False).encode() + b"\n"
                digest.update(line)
                file.write(line)
                rows[table.name] += 1
        digests[table.name] = digest.hexdigest()
    return {"revision": stored_revision(connection), "rows": rows, "sha256": digests}


def _reflected(connection: sa.Connection) -> sa.MetaData:
    """Return the tables as they are, whichever revision wrote them."""
    metadata = sa.MetaData()
    metadata.reflect(connection, only=lambda name, _: name != "alembic_version")
    for table in metadata.tables.values():
        for column in table.columns:
            if isinstance(column.type, sa.JSON):
                column.type = sa.JSON(none_as_null=True)
    return metadata


def _copied(connection: sa.Connection, source: Blobs, target: FolderBlobs, progress: Progress) -> set[str]:
    kept: set[str] = set()
    with closing(referring(connection)) as rows:
        for digest in (row["sha256"] for row in rows):
            if digest not in kept:
                kept.add(digest)
                progress(0.0, f"copying files ({len(kept)})")
                _copy(connection, source, target, digest)
    return kept


def _copy(connection: sa.Connection, source: Blobs, target: FolderBlobs, digest: str) -> None:
    if target.damage(digest) is None:
        return
    try:
        with source.open(digest) as file:
            target.put_pieces(iter(lambda: file.read(CHUNK_BYTES), b""))
    except NotFoundError:
        if _is_still_referred_to(connection, digest):
            raise
        raise _GoneError from None


def _is_still_referred_to(connection: sa.Connection, digest: str) -> bool:
    with connection.engine.connect() as fresh:
        query = sa.text("SELECT 1 FROM files WHERE sha256 = :digest")
        return fresh.execute(query, {"digest": digest}).first() is not None


def _forget_earlier(target: Path, tables: Path, blobs: FolderBlobs, kept: set[str]) -> None:
    for path in target.glob("tables-*"):
        if path != tables:
            remove_folder(path)
    for digest in set(blobs.digests()) - kept:
        remove_file(blobs.path(digest))


def restore(source: Path, settings: Settings) -> Backup:
    """Make a store of a backup, all or nothing; the tables are brought to this version's form.

    Raises
    ------
    InputError
        If it is no backup, or a later version made it.
    DamagedError, NotFoundError
        If the backup is damaged.
    ConflictError
        If there is a store already, or a server uses the place.
    """
    manifest = _manifest(source)
    kept = FolderBlobs(source / "blobs")
    engine = engine_of(settings.sql_url)
    with folder_lock(settings.data):
        target = open_blobs(settings.blob_place)
        try:
            with engine.execution_options(writing=True).begin() as connection:
                if stored_revision(connection) is not None:
                    to_do = message(
                        "Name a new data folder (or an empty database), and change over when all is there."
                    )
                    raise ConflictError("a place without a store", "one", to_do, str(settings.data))
                upgrade(connection, manifest["revision"])
                _fill(connection, source / manifest["tables"], manifest)
                for digest in sorted({row["sha256"] for row in referring(connection)}):
                    with kept.open(digest) as file:
                        target.put_pieces(iter(lambda file=file: file.read(CHUNK_BYTES), b""))
                upgrade(connection)
                with Transaction(connection, join_transaction_mode="rollback_only") as db:
                    begin(db, "restored")
                    db.commit()
            copy_key(source / manifest["tables"], settings.data)
        finally:
            engine.dispose()
    return Backup(manifest["created"], manifest["revision"], manifest["rows"], manifest["blobs"])


def _manifest(source: Path) -> dict[str, Any]:
    file = source / MANIFEST
    if not file.is_file():
        to_do = message("Name the folder that `scancell backup --out` wrote.")
        raise InputError("a backup with {manifest}", "none", to_do, str(source), manifest=MANIFEST)
    manifest = parse_json(file.read_bytes(), str(file))
    if not isinstance(manifest, dict) or manifest.get("format") != _FORMAT:
        need = "a backup of the form {format}"
        to_do = "Use the version that wrote it, or a later one."
        raise InputError(need, "something else", to_do, str(file), format=_FORMAT)
    return manifest


def _fill(connection: sa.Connection, folder: Path, manifest: Mapping[str, Any]) -> None:
    metadata = _reflected(connection)
    for table in metadata.sorted_tables:
        if table.name == "signed_log":  # it has begun already
            connection.execute(sa.delete(table))
        digest = sha256()
        batch: list[dict[str, Any]] = []
        for line in _lines(folder / f"{table.name}.jsonl"):
            digest.update(line)
            batch.append(json.loads(line))
            if len(batch) == _ROWS:
                connection.execute(sa.insert(table), batch)
                batch = []
        if batch:
            connection.execute(sa.insert(table), batch)
        if digest.hexdigest() != manifest["sha256"].get(table.name):
            got, to_do = message("something else"), message("Use another backup.")
            raise DamagedError("{table}.jsonl as it was written", got, to_do, str(folder), table=table.name)
        _renumber(connection, table)


def _lines(path: Path) -> Iterator[bytes]:
    try:
        with path.open("rb") as file:
            yield from file
    except FileNotFoundError:
        to_do = "Use another backup."
        raise NotFoundError("the table {file}", "nothing", to_do, str(path), file=path.name) from None


def _renumber(connection: sa.Connection, table: sa.Table) -> None:
    """Let a database that counts for itself go on after the rows that are there."""
    column = table.autoincrement_column
    if connection.dialect.name == "sqlite" or column is None or column.server_default is None:
        return
    sequence = sa.func.pg_get_serial_sequence(table.name, column.name)
    last = sa.select(sa.func.coalesce(sa.func.max(column), 0) + 1).scalar_subquery()
    connection.execute(sa.select(sa.func.setval(sequence, last, False)))
