"""The two databases that the store works with, made to behave alike."""

import json
from functools import partial
from pathlib import Path, PurePath
from typing import Any
from urllib.parse import quote

from sqlalchemy import URL, Connection, Engine, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError

from calib_core.disk import journal_of_sqlite
from calib_core.errors import InputError
from calib_core.messages import message
from server.store.json_text import JsonText

_TIMEOUTS = {
    "connect_timeout": 5,
    "tcp_user_timeout": 10_000,
    "keepalives_idle": 5,
    "keepalives_interval": 3,
    "keepalives_count": 3,
}
"""Of PostgreSQL's connections: a database whose machine is gone is noticed in seconds, not in hours."""

_CACHE_KIB, _STATEMENTS_KEPT = 512, 40
"""Pages and prepared statements (some 8 kB each) that each connection to SQLite keeps.  The system keeps the
file's pages besides; by default 2 MB and 128 fill over hours in each of ten connections, and look like a leak."""


def engine_of(url: str, read_only: bool = False, wait_s: float = 10.0) -> Engine:
    """Return what speaks to the database at an address; it connects later, `read_only` without changing a byte.

    `wait_s` is how long SQLite waits for another program that holds its lock.

    Raises
    ------
    InputError
        If it is no such address, or the database's extra is not installed.
    """
    try:
        address = make_url(url)
    except ArgumentError:
        got, to_do = (
            message("something else"),
            message("Write SCANCELL_DATABASE_URL=postgresql://user@host/database."),
        )
        raise InputError("the address of a database", got, to_do, "database_url") from None
    kind = address.get_backend_name()
    if kind not in ("sqlite", "postgresql"):
        to_do = message("Name a PostgreSQL database, or leave SCANCELL_DATABASE_URL out.")
        raise InputError("an address that begins with postgresql:// or sqlite:///", kind, to_do, "database_url")
    if kind == "sqlite":
        engine = create_engine(
            _unchanged(address) if read_only else address,
            json_serializer=_json_text,
            pool_use_lifo=True,  # what one connection has prepared and kept serves the next request
            connect_args={"cached_statements": _STATEMENTS_KEPT},
        )
        journal = journal_of_sqlite(Path(address.database or "").parent)
        set_up = _own_transactions if read_only else partial(_set_up_sqlite, round(1000 * wait_s), journal)
        event.listen(engine, "connect", set_up)
        event.listen(engine, "begin", _begin_sqlite)
        return engine
    try:
        # A connection that the database has closed meanwhile (a restart) is noticed before it is used.
        return create_engine(
            address.set(drivername="postgresql+psycopg"),
            json_serializer=_json_text,
            pool_pre_ping=True,
            connect_args=_TIMEOUTS,
        )
    except ModuleNotFoundError:
        to_do = message(
            "Install it: pip install 'scancell[{extra}]'; or leave {setting} out.",
            extra="postgres",
            setting="SCANCELL_DATABASE_URL",
        )
        raise InputError("the extra '{extra}'", "none", to_do, "database_url", extra="postgres") from None


def _json_text(data: Any) -> str:
    return str(data) if isinstance(data, JsonText) else json.dumps(data, allow_nan=False, ensure_ascii=False)


def reading(engine: Engine) -> Engine:
    """Return an engine whose transactions see one state throughout, as SQLite's do by themselves."""
    if engine.dialect.name == "sqlite":
        return engine
    return engine.execution_options(isolation_level="REPEATABLE READ", postgresql_readonly=True)


def _unchanged(address: URL) -> URL:
    path = Path(address.database or "")
    log = path.with_name(path.name + "-wal")
    # Without a log nobody writes, and the folder may be one that cannot be written to; an empty one is a server's
    # that is about to.
    still = "" if log.exists() else "&immutable=1"
    return make_url(f"sqlite:///{address_for_reading(path.resolve())}{still}&uri=true")


def _own_transactions(connection: Any, _: Any) -> None:
    connection.isolation_level = None  # this module begins transactions itself


def _set_up_sqlite(wait_ms: int, journal: str, connection: Any, _: Any) -> None:
    _own_transactions(connection, _)
    for pragma in (
        f"journal_mode={journal}",
        "synchronous=FULL",
        "foreign_keys=ON",
        f"busy_timeout={wait_ms}",
        f"cache_size=-{_CACHE_KIB}",
    ):
        connection.execute(f"PRAGMA {pragma}").close()


def _begin_sqlite(connection: Connection) -> None:
    # A transaction that will write takes the lock at once: it never fails half-way because another was faster.
    writing = connection.get_execution_options().get("writing")
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")


def address_for_reading(file: PurePath) -> str:
    """Return a file's address for SQLite, which takes none with a machine in it: a share has two slashes."""
    path = quote(file.as_posix(), safe="/:")
    return f"file://{path if path[0] == '/' else f'/{path}'}?mode=ro"
