"""Names in an archive: relative, plain, and different from each other on every file system."""

import re
import unicodedata
from collections.abc import Iterable
from typing import Final

from calib_core.errors import InputError
from calib_core.messages import explained, message

MAX_NAME_BYTES: Final = 1000
MAX_PART_BYTES: Final = 240
MAX_DEPTH: Final = 32

_ASCII_CONTROLS = frozenset(map(chr, [*range(32), 127]))
_RENAME = message("Rename the file.")
_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9¹²³]|lpt[0-9¹²³]|conin\$|conout\$)[ ]*(\..*)?", re.IGNORECASE)
_NOT_ON_WINDOWS = frozenset('<>"|?*')


def require_safe_name(name: str, where: str) -> None:
    """Refuse a name that could lead out of a folder, or that not every system can store.

    Parameters
    ----------
    name : str
        A path with ``/`` between its parts, relative to the archive.
    where : str
        The archive, for the message.

    Raises
    ------
    InputError
    """
    got = _fault(name)
    if got:
        need = message("names that stay inside the archive's folder and that every system can store")
        raise InputError(need, explained(_shown(name), got), _RENAME, where)


def require_distinct_names(names: Iterable[str], where: str) -> None:
    """Refuse names that are one file, or a file and a folder, on some system.

    Upper and lower case are the same on Windows and macOS, and so are the Unicode forms of an accented letter.

    Raises
    ------
    InputError
    """
    files: dict[str, str] = {}
    folders: dict[str, str] = {}
    need = message("names that differ by more than case and Unicode form")
    for name in names:
        other = files.get(folded(name))
        if other is not None:
            got = (
                message("'{name}' twice", name=_shown(name))
                if other == name
                else message("{other} and {name}", other=_shown(other), name=_shown(name))
            )
            raise InputError(need, got, _RENAME, where)
        files[folded(name)] = name
        parts = name.split("/")[:-1]
        for depth in range(1, len(parts) + 1):
            folder = "/".join(parts[:depth])
            other = folders.setdefault(folded(folder), folder)
            if other != folder:
                raise InputError(
                    need,
                    "the folders {other} and {folder}",
                    _RENAME,
                    where,
                    other=_shown(other),
                    folder=_shown(folder),
                )
    for name in files.keys() & folders.keys():
        need = "files and folders with different names"
        raise InputError(need, "{name} as both", _RENAME, where, name=_shown(name))


def folded(name: str) -> str:
    """Return what names have in common that case-insensitive and normalising file systems hold for one."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def is_device_name(part: str) -> bool:
    """Return whether Windows holds a file's name, with whatever ending, for a device: `con`, `nul.csv`, `COM1`."""
    return _DEVICE.fullmatch(part) is not None


def require_packable_name(name: str, where: str) -> None:
    """Refuse what `require_safe_name` does, and names of new archives that Windows could not unpack.

    Raises
    ------
    InputError
    """
    require_safe_name(name, where)
    need = message("names that every system can store")
    for part in name.split("/"):
        if is_device_name(part):
            raise InputError(need, "{part}, a device's on Windows", _RENAME, where, part=_shown(part))
        if not _NOT_ON_WINDOWS.isdisjoint(part):
            got = message("{part}, with a sign that Windows' names have not", part=_shown(part))
            raise InputError(need, got, _RENAME, where)


def _fault(name: str) -> str:
    """Return what is wrong with a name, nothing where it is good."""
    parts = name.split("/")
    if name.startswith("/"):
        return message("an absolute path")
    if "\\" in name or ":" in name:
        return message("a backslash or a colon, which leads elsewhere on Windows")
    if any(part in (".", "..") for part in parts):
        return message("a part that leads to another folder")
    if "" in parts:
        return message("an empty part")
    if not _ASCII_CONTROLS.isdisjoint(name):
        return message("control characters")
    if any(part.endswith((" ", ".")) for part in parts):
        return message("a part that ends with a space or a full stop, which Windows drops")
    return _too_long(name, parts)


def _too_long(name: str, parts: list[str]) -> str:
    try:
        size, longest = len(name.encode()), max(len(part.encode()) for part in parts)
    except UnicodeEncodeError:
        return message("half of a surrogate pair")
    if size > MAX_NAME_BYTES or longest > MAX_PART_BYTES:
        return message("{size} bytes long", size=size)
    return message("{count} folders deep", count=len(parts)) if len(parts) > MAX_DEPTH else ""


def _shown(name: str) -> str:
    text = ascii(name)
    return text if len(text) <= 80 else f"{text[:60]}…{text[-16:]}"
