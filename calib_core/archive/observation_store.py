"""The file that keeps what was seen in captures: in a session folder's `.scancell/`, or in a server's data folder.

It is no part of the session: archives and hashes leave it out, and without it everything is measured again.
"""

import os
import sqlite3
import threading
from contextlib import suppress
from pathlib import Path
from weakref import finalize

from calib_core.disk import journal_of_sqlite, remove_file

OWN_FOLDER = ".scancell"
"""In a session folder: what is no part of the session."""

_FILE = "observations.sqlite"
_MOST_BYTES = 1_000_000_000
_LONGEST_WAIT_S = 0.2  # for another process; what cannot be kept by then is measured again
_DROPPED_AT_ONCE = 100


class KeptObservations:
    """Keeps bytes by key in one SQLite file; the oldest go where it grows too large.

    Nothing here ever fails: where the file cannot be made, read or written, nothing is kept.  Processes may share
    the file, and threads the object.

    Parameters
    ----------
    folder : Path
        Where the file lies; made when something is kept first.
    most_bytes : int
        What all that is kept may come to.
    """

    def __init__(self, folder: Path, most_bytes: int = _MOST_BYTES) -> None:
        self._folder = folder
        self._most_bytes = most_bytes
        self._lock = threading.Lock()
        self._process = 0
        self._failed = False
        self._file: sqlite3.Connection | None = None
        self._inherited: sqlite3.Connection | None = None

    def get(self, key: str) -> bytes | None:
        """Return what was kept under a key."""
        with self._lock:
            file = self._opened(make=False)
            if file is None:
                return None
            try:
                row = file.execute("SELECT value FROM kept WHERE key = ?", (key,)).fetchone()
            except sqlite3.Error:
                return None
        return row[0] if row is not None and isinstance(row[0], bytes) else None

    def put(self, key: str, value: bytes) -> None:
        """Keep it under a key."""
        with self._lock:
            file = self._opened(make=True)
            if file is None or len(value) > self._most_bytes:
                return
            with suppress(sqlite3.Error):
                if self._is_full(file):
                    oldest = "SELECT rowid FROM kept ORDER BY rowid LIMIT ?"
                    file.execute(f"DELETE FROM kept WHERE rowid IN ({oldest})", (_DROPPED_AT_ONCE,))
                file.execute("INSERT OR REPLACE INTO kept VALUES (?, ?)", (key, value))

    def _is_full(self, file: sqlite3.Connection) -> bool:
        """Return whether the file has grown to its limit and has no room left by what was dropped."""
        pages, free, page_bytes = (
            int(file.execute(f"PRAGMA {name}").fetchone()[0])
            for name in ("page_count", "freelist_count", "page_size")
        )
        return (pages - free) * page_bytes > self._most_bytes

    def _opened(self, make: bool) -> sqlite3.Connection | None:
        """Return this process's connection: one that came over a fork must not be used."""
        path = self._folder / _FILE
        if self._process != os.getpid():
            self._inherited = self._file  # held, never closed: it is the other process's
            self._file, self._process, self._failed = None, os.getpid(), False
        if self._file is None and not self._failed and (make or path.exists()):
            try:
                self._folder.mkdir(parents=True, exist_ok=True)
                self._file = _open(path)
                finalize(self, self._file.close)
            except (OSError, sqlite3.Error) as error:
                self._failed = True
                if type(error) is sqlite3.DatabaseError:  # damaged: the next process begins it anew
                    with suppress(OSError):
                        remove_file(path)
        return self._file


def _open(path: Path) -> sqlite3.Connection:
    file = sqlite3.connect(path, timeout=_LONGEST_WAIT_S, isolation_level=None, check_same_thread=False)
    try:
        file.execute(f"PRAGMA journal_mode = {journal_of_sqlite(path.parent)}")
        file.execute("PRAGMA synchronous = OFF")
        file.execute("CREATE TABLE IF NOT EXISTS kept (key TEXT PRIMARY KEY, value BLOB NOT NULL)")
    except sqlite3.Error:
        file.close()
        raise
    return file
