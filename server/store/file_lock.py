"""Locks of open files, which go with the file or the process: on Windows too."""

import errno
import os
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

_TAKEN = (errno.EACCES, errno.EAGAIN, errno.EDEADLK)
_LOOK_S = 0.002


def try_lock(handle: int) -> bool:
    """Lock an open file for this handle alone; return whether nobody else has it. Raises OSError."""
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)  # the file's first byte, also where it is empty
        else:
            import fcntl

            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno not in _TAKEN:
            raise
        return False
    return True


@contextmanager
def file_lock(path: Path) -> Generator[None]:
    """Have a file, made where it is missing, or a folder locked meanwhile; whoever else wants it waits.

    Windows locks no folders.
    """
    handle = os.open(path, os.O_RDONLY if path.is_dir() else os.O_RDWR | os.O_CREAT, 0o600)
    try:
        while not try_lock(handle):
            time.sleep(_LOOK_S)
        yield
    finally:
        os.close(handle)
