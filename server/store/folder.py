"""The data folder: made where it is missing, and one server's alone."""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from calib_core.disk import LONGEST_PLAIN, WINDOWS
from calib_core.errors import ConflictError, InputError
from calib_core.messages import message
from server.settings import Settings
from server.store.file_lock import try_lock

_LONGEST_ON_WINDOWS = LONGEST_PLAIN - 80  # blobs have names of 64 characters, two folders down


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
    if WINDOWS and len(str(folder.absolute())) > _LONGEST_ON_WINDOWS:
        need = message(
            "a data folder whose path has at most {longest_on_windows} characters",
            longest_on_windows=_LONGEST_ON_WINDOWS,
        )
        got = message("{count}: Windows ends a path at 260", count=len(str(folder.absolute())))
        raise InputError(need, got, "Choose another with --data.", str(folder))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    except OSError as error:
        need = "a folder for the data that can be written to"
        to_do = "Choose another with --data, or correct its permissions."
        raise InputError(need, (error.strerror or type(error).__name__).lower(), to_do, str(folder)) from None
    try:
        if not try_lock(handle):
            to_do = "End the other server, or choose another folder with --data."
            raise ConflictError("a data folder that no other server uses", "one in use", to_do, str(folder))
        yield
    finally:
        os.close(handle)


def require_store(settings: Settings) -> None:
    """Refuse a data folder in which no server has stored anything yet; raises InputError."""
    if settings.database_url is None and not (settings.data / "scancell.db").is_file():
        to_do = message("Name the folder that `scancell serve --data` uses.")
        raise InputError("a data folder with a store", "none", to_do, str(settings.data))
