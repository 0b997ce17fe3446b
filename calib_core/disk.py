"""Files and folders renamed, removed, and made to stay where the power goes.

Windows refuses both while anybody has the file open: a virus scanner, an indexer, a reader, each for some
milliseconds.  All that renames or removes goes through here, and tries again.
"""

import os
import re
import secrets
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path, PureWindowsPath
from typing import Any, Final, TypeVar

AnyPath = TypeVar("AnyPath", Path, PureWindowsPath)

_HELD = (5, 32, 33)
"""Windows' numbers for what passes: access denied, a sharing violation, a lock violation."""
_SYSTEM = re.compile(r"(?:^|/)(?:\.[^/]*|Thumbs\.db|desktop\.ini|~\$[^/]*|__MACOSX/.*)\Z", re.IGNORECASE)
_SHARE = re.compile(r"\\\\(?!\?\\)|\\\\\?\\UNC\\")
_REMOTE_DRIVE: Final = 4
_REMOTE_FILE_SYSTEMS: Final = {"nfs", "nfs4", "cifs", "smb3", "smbfs", "fuse.sshfs", "afs", "ceph"}
_MOUNTS: Final = Path("/proc/self/mounts")
_PAUSES_S = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.0)

WINDOWS: Final = sys.platform == "win32"

LONGEST_PLAIN: Final = 240
"""Longer paths Windows takes in its extended form alone, unless an administrator has allowed them: it ends at 260,
and folders at 248."""


def extended(path: AnyPath, room: int = 0) -> AnyPath:
    r"""Return a path that Windows takes however long it is: `\\?\C:\…` for a long one, itself on other systems.

    `room` is how many more characters names below it may have.
    """
    if not (WINDOWS or type(path) is PureWindowsPath) or str(path).startswith("\\\\?\\"):
        return path
    whole = os.path.abspath(path) if isinstance(path, Path) else str(path)  # noqa: PTH100 (links stay)
    if len(whole) + room <= LONGEST_PLAIN:
        return path
    unc = whole.startswith("\\\\")
    return type(path)("\\\\?\\UNC\\" + whole[2:] if unc else "\\\\?\\" + whole)


def is_remote(path: Path) -> bool:
    """Return whether a folder lies on another machine, as far as the system tells."""
    if WINDOWS:
        import ctypes

        anchor = path.resolve().anchor
        return _SHARE.match(anchor) is not None or ctypes.WinDLL("kernel32").GetDriveTypeW(anchor) == _REMOTE_DRIVE  # pyright: ignore
    return _mounted_as(str(path.resolve())) in _REMOTE_FILE_SYSTEMS


def journal_of_sqlite(folder: Path) -> str:
    """Return how SQLite logs changes: what is quick needs memory that is shared, which network drives have not."""
    return "TRUNCATE" if is_remote(folder) else "WAL"


def _mounted_as(path: str) -> str:
    """Return the kind of file system that Linux has mounted where a path lies, nothing on other systems."""
    try:
        lines = _MOUNTS.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    mounts = [(place.replace("\\040", " "), kind) for _, place, kind in (line.split()[:3] for line in lines)]
    return max([("", ""), *(m for m in mounts if f"{path}/".startswith(f"{m[0]}/"))])[1]


def write_private(path: Path, content: bytes) -> None:
    """Write a secret whole and durably, readable by its owner alone; of two writers the first wins.

    Raises
    ------
    OSError
    """
    fresh = path.with_name(f"{path.name}.{secrets.token_hex(8)}")
    handle = os.open(fresh, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        with suppress(FileExistsError):
            _name_new(fresh, path)
    finally:
        remove_file(fresh, missing_ok=True)


def _name_new(fresh: Path, path: Path) -> None:
    """Give a file a name that nothing has; raises FileExistsError. Network and USB drives know no second names."""
    try:
        os.link(fresh, path)
    except FileExistsError:
        raise
    except OSError:
        if path.exists():
            raise FileExistsError(path) from None
        rename_new(fresh, path)


def replace_file(source: Path, target: Path) -> None:
    """Rename a file, which nobody may have open, in place of what stands under its new name; raises OSError."""
    _until_let_go(lambda: source.replace(target))


def rename_new(source: Path, target: Path) -> None:
    """Rename a file or folder to a name under which nothing stands; raises OSError."""
    _until_let_go(lambda: source.rename(target))


def remove_file(path: Path, missing_ok: bool = False) -> None:
    """Remove a file; raises OSError."""
    _until_let_go(lambda: path.unlink(missing_ok=missing_ok))


def remove_folder(path: Path) -> None:
    """Remove a folder and all that is in it; raises OSError."""
    _until_let_go(lambda: shutil.rmtree(path, onerror=_allow_and_go_on))


def _allow_and_go_on(remove: Callable[[str], object], name: str, told: tuple[Any, BaseException, Any]) -> None:
    """Remove what is marked as read-only, which Windows removes only after that was taken back."""
    if not isinstance(told[1], PermissionError) or os.access(name, os.W_OK):
        raise told[1]
    Path(name).chmod(stat.S_IWRITE | stat.S_IREAD)
    remove(name)


@contextmanager
def temporary_folder(name: str = "scancell-", within: Path | None = None) -> Generator[Path]:
    """Give a folder that is removed afterwards; what is held for longer stays, and what was done in it is done."""
    folder = Path(tempfile.mkdtemp(prefix=name, dir=within))
    try:
        yield folder
    finally:
        with suppress(OSError):
            remove_folder(folder)


def is_system_file(name: str) -> bool:
    """Return whether a system or an office program put a file there, and nobody measured it; parts end in `/`."""
    return _SYSTEM.search(name) is not None


def is_held(error: OSError) -> bool:
    """Return whether another program holds a file, as Windows says it: that passes."""
    return getattr(error, "winerror", None) in _HELD


def sync_folder(folder: Path) -> None:
    """Have the names in a folder on the disk."""
    if os.name == "nt":  # folders cannot be opened there; the rename itself is journalled
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _until_let_go(change: Callable[[], object]) -> None:
    """Do it, again after ever longer pauses for as long as another program holds what is to be changed."""
    for pause_s in _PAUSES_S:
        try:
            change()
        except OSError as error:
            if not is_held(error):
                raise
            time.sleep(pause_s)
        else:
            return
    change()
