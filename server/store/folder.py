"""The data folder: made where it is missing, and one server's alone."""

import errno
import os
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from calib_core.errors import ConflictError, InputError
from server.settings import Settings


@contextmanager
def folder_lock(folder: Path) -> Generator[None]:
    """Keep other servers from a data folder meanwhile; a server that is killed lets go of it by itself.

    Raises
    ------
    InputError
        If the folder cannot be made or written to.
    ConflictError
        If another server uses it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        raise InputError(
            "a folder for the data that can be written to",
            (error.strerror or type(error).__name__).lower(),
            "Choose another with --data, or correct its permissions.",
            str(folder),
        ) from None
    try:
        if not _locked(handle):
            raise ConflictError(
                "a data folder that no other server uses",
                "one in use",
                "End the other server, or choose another folder with --data.",
                str(folder),
            )
        yield
    finally:
        os.close(handle)


def _locked(handle: int) -> bool:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # the file's first byte, also where it is empty
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in (errno.EACCES, errno.EAGAIN, errno.EDEADLK):
            raise
        return False
    return True


def require_store(settings: Settings) -> None:
    """Refuse a data folder in which no server has stored anything yet; raises InputError."""
    if settings.database_url is None and not (settings.data / "scancell.db").is_file():
        to_do = "Name the folder that `scancell serve --data` uses."
        raise InputError("a data folder with a store", "none there", to_do, str(settings.data))
