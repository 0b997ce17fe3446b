"""Windows renames and removes no file that is open: here the same, for all tests of a process.

Linux does both without a word, so that such a fault would be seen on Windows first.
"""

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

_OPEN = Path("/proc/self/fd")
_SHARING_VIOLATION = 32


def refuse_changes_of_open_files() -> None:
    """Have what is renamed, replaced or removed while this process has it open refused, as Windows does.

    In place of `os`'s own functions: an audit hook would be asked at each `id`, and copying take twice as long.
    """
    if _OPEN.is_dir():
        for name, paths in (("rename", 2), ("replace", 2), ("remove", 1), ("unlink", 1)):
            setattr(os, name, _of_closed(getattr(os, name), paths))


def _of_closed(change: Callable[..., None], paths: int) -> Callable[..., None]:
    @wraps(change)
    def checked(*arguments: Any, **options: Any) -> None:
        _require_closed(arguments[:paths])
        change(*arguments, **options)

    return checked


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
