"""A store that is ready for one server: nobody else's meanwhile, and in this version's form."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Final

from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError

from calib_core.errors import ConflictError, InputError
from server.settings import Settings
from server.store.database import Store
from server.store.engine import engine_of
from server.store.folder import folder_lock

_LOCK: Final = 0x7363616E63656C6C  # "scancell": PostgreSQL's advisory locks have numbers for names
_END_THE_OTHER: Final = "End the other server, or choose another database."


@contextmanager
def store_lock(settings: Settings) -> Generator[None]:
    """Keep other servers from data folder and database meanwhile, the tables brought up to date.

    A server that is killed lets go of both by itself.

    Raises
    ------
    InputError
        If the folder, the database or the bucket cannot be used, or a later version has written there.
    ConflictError
        If another server uses them.
    """
    with folder_lock(settings.data), _database_lock(settings):
        store = Store(settings, lambda _: None)
        try:
            store.migrate()
        except DBAPIError as error:
            raise _unusable(settings, error) from None
        finally:
            store.close()
        yield


@contextmanager
def _database_lock(settings: Settings) -> Generator[None]:
    engine = engine_of(settings.sql_url)
    if engine.dialect.name == "sqlite":  # it lies in the folder
        yield
        return
    try:
        # The lock goes with the connection; an open transaction would hold back the database's cleaning.
        connection = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    except DBAPIError as error:
        raise _unusable(settings, error) from None
    try:
        _take_lock(connection)
        yield
    finally:
        connection.close()
        engine.dispose()


def _take_lock(connection: Connection) -> None:
    if not connection.scalar(text("SELECT pg_try_advisory_lock(:lock)"), {"lock": _LOCK}):
        raise ConflictError("a database that no other server uses", "one in use", _END_THE_OTHER, "database_url")


def _unusable(settings: Settings, error: DBAPIError) -> InputError:
    got = " ".join(str(error.orig).split())
    to_do = (
        "Check that the database runs, its address and the rights there (SCANCELL_DATABASE_URL)."
        if settings.database_url
        else "Make room there, or correct its permissions; `scancell doctor` says what is wrong."
    )
    return InputError("a database that can be read and written", got, to_do, str(settings.data))
