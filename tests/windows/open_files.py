"""Windows renames and removes no file that is open: here the same, for all tests of a process.

Linux does both without a word, so that such a fault would be seen on Windows first.
"""

import os
import sys
from pathlib import Path

_OPEN = Path("/proc/self/fd")
_SHARING_VIOLATION = 32


def refuse_changes_of_open_files() -> None:
    """Have what is renamed, replaced or removed while this process has it open refused, as Windows does."""
    if _OPEN.is_dir():
        sys.addaudithook(_look)


def _look(event: str, arguments: tuple[object, ...]) -> None:
    if event == "os.rename":
        _require_closed(arguments[:2])
    elif event == "os.remove":
        _require_closed(arguments[:1])


def _require_closed(names: tuple[object, ...]) -> None:
    wanted = [os.path.realpath(os.fsdecode(name)) for name in names]  # type: ignore[arg-type]
    for number in os.listdir(_OPEN):  # noqa: PTH208 (at each rename of every test)
        try:
            there = os.readlink(f"{_OPEN}/{number}")  # noqa: PTH115
        except OSError:  # the listing's own
            continue
        for name in wanted:
            if there == name or there.startswith(name + os.sep):
                error = PermissionError(13, "Windows changes no file that is open", name)
                error.winerror = _SHARING_VIOLATION  # type: ignore[attr-defined]
                raise error
