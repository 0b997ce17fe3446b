"""A store that is ready for one server: nobody else's meanwhile, and in this version's form."""

import logging
import threading
from collections.abc import Generator
from contextlib import contextmanager
from typing import Final

from sqlalchemy import Connection, Engine, text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError, InputError
from calib_core.messages import message
from server.settings import Settings
from server.store.database import Store
from server.store.engine import engine_of
from server.store.folder import folder_lock
from server.store.unavailable import UnavailableError
from server.store.updates import keep_before_update

log = logging.getLogger("scancell")
_LOCK: Final = 0x7363616E63656C6C  # "scancell": PostgreSQL's advisory locks have numbers for names
_WRITING: Final = _LOCK + 1
_END_THE_OTHER: Final = message("End the other server, or choose another database.")
_LOOK_S: Final = 2.0
_LOOK_AGAIN_S: Final = 0.5  # while the lock is gone

_TAKEN_OVER: Final = message("another server has taken over the database")


class DatabaseLock:
    """PostgreSQL's lock of one server, and the number by which its writes are known.

    The lock goes with its connection, as when the database is restarted.  Whichever server takes it next
    numbers itself anew, and each write checks that the number is still its server's: so two never write, however
    long one of them takes to notice.
    """

    def __init__(self, engine: Engine, connection: Connection) -> None:
        self._engine, self._connection = engine, connection
        self._own: set[int] = set()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._work, name="database lock", daemon=True)
        self.trouble: str | None = None

    def start(self) -> None:
        """Number this server, which has the lock, and keep it from here on."""
        self._number()
        self._thread.start()

    def stop(self) -> None:
        """Let go."""
        self._stopping.set()
        self._thread.join()
        self._connection.close()

    def require(self, db: Transaction) -> None:
        """Refuse a transaction that would write beside another server; raises UnavailableError."""
        db.execute(text("SELECT pg_advisory_xact_lock_shared(:lock)"), {"lock": _WRITING})
        if db.execute(text("SELECT number FROM server_number")).scalar() not in self._own:
            raise UnavailableError(
                _TAKEN_OVER, message("Send it to that one; this one goes on once the other has ended.")
            )

    def _number(self) -> None:
        """Take the next number, once no other write is under way."""
        with self._engine.begin() as connection:
            connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _WRITING})
            number = connection.scalar(text("SELECT coalesce(max(number), 0) + 1 FROM server_number"))
            connection.execute(text("DELETE FROM server_number"))
            connection.execute(text("INSERT INTO server_number (number) VALUES (:number)"), {"number": number})
            self._own.add(int(number or 0))

    def _work(self) -> None:
        while not self._stopping.wait(_LOOK_S if self.trouble is None else _LOOK_AGAIN_S):
            try:
                if self.trouble is None:
                    self._connection.execute(text("SELECT 1"))
                    continue
                self._connection.close()
                self._connection = _own_connection(self._engine)
                if not _taken(self._connection):
                    self.trouble = _TAKEN_OVER
                    continue
                self._number()
                self.trouble = None
                log.warning("the lock of the database was taken again")
            except DBAPIError as error:
                if self.trouble is None:
                    log.warning("the connection that holds the database's lock is gone: %s", error.orig)
                self.trouble = "the database does not answer"


@contextmanager
def store_lock(settings: Settings) -> Generator[DatabaseLock | None]:
    """Keep other servers from data folder and database meanwhile, the tables brought up to date.

    A server that is killed lets go of both by itself.  Gives what each write must ask, None where the folder's
    lock is enough.

    Raises
    ------
    InputError
        If the folder, the database or the bucket cannot be used, or a later version has written there.
    ConflictError
        If another server uses them.
    """
    with folder_lock(settings.data), _database_lock(settings) as lock:
        store = Store(settings, lambda _: None)
        try:
            if settings.database_url is None and (kept := keep_before_update(settings.data)):
                log.info("the database gets this version's form; as it was, it is kept in %s", kept)
            store.migrate()
            if lock is not None:
                lock.start()
        except DBAPIError as error:
            raise _unusable(settings, error) from None
        finally:
            store.close()
        try:
            yield lock
        finally:
            if lock is not None:
                lock.stop()


@contextmanager
def _database_lock(settings: Settings) -> Generator[DatabaseLock | None]:
    engine = engine_of(settings.sql_url)
    if engine.dialect.name == "sqlite":  # it lies in the folder
        yield None
        return
    try:
        try:
            connection = _own_connection(engine)
        except DBAPIError as error:
            raise _unusable(settings, error) from None
        with connection:
            if not _taken(connection):
                need, got = message("a database that no other server uses"), message("one in use")
                raise ConflictError(need, got, _END_THE_OTHER, "database_url")
            yield DatabaseLock(engine, connection)
    finally:
        engine.dispose()


def _own_connection(engine: Engine) -> Connection:
    # The lock goes with the connection; an open transaction would hold back the database's cleaning.
    return engine.connect().execution_options(isolation_level="AUTOCOMMIT")


def _taken(connection: Connection) -> bool:
    return bool(connection.scalar(text("SELECT pg_try_advisory_lock(:lock)"), {"lock": _LOCK}))


def _unusable(settings: Settings, error: DBAPIError) -> InputError:
    got = " ".join(str(error.orig).split())
    to_do = (
        message("Check that the database runs, its address and the rights there (SCANCELL_DATABASE_URL).")
        if settings.database_url
        else message("Make room there, or correct its permissions; `scancell doctor` says what is wrong.")
    )
    return InputError("a database that can be read and written", got, to_do, str(settings.data))
