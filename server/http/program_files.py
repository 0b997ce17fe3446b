"""Whether the program's files were replaced beneath a running server: what it has not loaded yet is of another
version then.
"""

from functools import cache
from hashlib import sha256
from pathlib import Path

from calib_core.messages import message

UPDATED = message("the program was updated beneath this server")
RESTART = message("Restart the server; nothing that was stored is touched.")


@cache
def remember() -> str:
    """Return the state that the files had when this was asked for first, as a server starts."""
    return _state()


def is_updated(error: BaseException) -> bool:
    """Return whether an error of the program comes from files that are not those that it started with."""
    return not isinstance(error, OSError) and _state() != remember()


def _state() -> str:
    root = Path(__file__).parents[2]
    files = sorted(file for part in ("calib_core", "server") for file in (root / part).rglob("*.py"))
    told = "\n".join(f"{file} {state.st_size} {state.st_mtime_ns}" for file in files if (state := file.stat()))
    return sha256(told.encode()).hexdigest()
