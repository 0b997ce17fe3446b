"""What was seen in captures' files, kept by content: nothing is measured twice.

What is seen depends on the bytes of the files, on the settings that they are read with, and on the code that looks
for it.  It is kept under the hash of just that: in memory, and where a `KeepingReader` reads the files, also
in what that names: a file in the session folder, or in the server's data folder.
"""

import hashlib
import json
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from inspect import isfunction
from pathlib import Path, PurePosixPath
from typing import Protocol, TypeVar

from calib_core.captures.observation_bytes import from_bytes, to_bytes
from calib_core.errors import MeasurementError
from calib_core.records import ReadFile

_MEMORY_BYTES = 64_000_000
_PACKAGE = Path(__file__).resolve().parents[1]
_SEEING = ("captures", "formats", "kernels", "optics", "sphere")
_LIBRARIES = ("numpy", "scipy", "numba", "opencv-python-headless")

_Seen = TypeVar("_Seen")


class Keeper(Protocol):
    """Keeps bytes by key; both ways it never fails: what is not kept is measured again."""

    def get(self, key: str) -> bytes | None:
        """Return what was kept under a key."""
        ...

    def put(self, key: str, value: bytes) -> None:
        """Keep it under a key."""
        ...


@dataclass(frozen=True)
class KeepingReader:
    """The function that reads a session's files, and what keeps what was seen in them."""

    read: ReadFile
    keeper: Keeper

    def __call__(self, name: str) -> bytes:
        """Return the bytes of a file by its name in the capture."""
        return self.read(name)


def keeping(read: ReadFile, keeper: Keeper | None) -> ReadFile:
    """Return what reads files and keeps what is seen in them, where there is a keeper."""
    return read if keeper is None else KeepingReader(read, keeper)


def plain(read: ReadFile) -> ReadFile:
    """Return what reads the same files and keeps nothing beyond this process."""
    return read.read if isinstance(read, KeepingReader) else read


class _Memory:
    """Keeps the latest in memory, up to so many bytes."""

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._bytes = 0
        self._kept: OrderedDict[str, bytes] = OrderedDict()
        self._lock = threading.Lock()

    def get(self, key: str) -> bytes | None:
        with self._lock:
            return self._kept.get(key)

    def put(self, key: str, value: bytes) -> None:
        with self._lock:
            self._bytes += len(value) - len(self._kept.pop(key, b""))
            self._kept[key] = value
            while self._bytes > self._most_bytes:
                self._bytes -= len(self._kept.popitem(last=False)[1])


_memory = _Memory(_MEMORY_BYTES)


def seen_once(
    kind: type[_Seen], names: Sequence[str], read: ReadFile, settings: object, make: Callable[[], _Seen]
) -> _Seen:
    """Return what is seen in files: as it was kept, else made, and kept.

    Parameters
    ----------
    kind : type
        What is looked for: a dataclass among those of `kept_form`.
    names : sequence of str
        The files by their names in the capture; of a name only the ending matters.
    read : callable
        Returns the bytes of a file; a `KeepingReader` keeps what is seen also beyond this process.
    settings : object
        All else that it depends on, as JSON data.
    make : callable
        Looks for it.

    Raises
    ------
    MeasurementError
        What `make` raises; that nothing is seen is kept, too.
    """
    key = _key(kind.__name__, names, read, settings)
    keeper = read.keeper if isinstance(read, KeepingReader) else None
    kept = _memory.get(key)
    if keeper is not None:
        lasting = keeper.get(key)
        if lasting is None and kept is not None:
            keeper.put(key, kept)
        kept = kept or lasting
    if kept is not None:
        found = from_bytes(kept)
        if isinstance(found, MeasurementError):
            raise found
        if isinstance(found, kind):
            return found
    try:
        seen: _Seen | MeasurementError = make()
    except MeasurementError as error:
        seen = error
    value = to_bytes(seen)
    if keeper is not None:
        keeper.put(key, value)
    if keeper is None or keeper.get(key) is None:  # it may fail; what it has need not stand here too
        _memory.put(key, value)
    if isinstance(seen, MeasurementError):
        raise seen
    return seen


def _key(what: str, names: Sequence[str], read: ReadFile, settings: object) -> str:
    digest = hashlib.sha256(f"{_code()}\n{what}\n{json.dumps(settings, sort_keys=True)}\n".encode())
    for name in names:
        digest.update(PurePosixPath(name).suffix.lower().encode() + hashlib.sha256(read(name)).digest())
    return digest.hexdigest()


@cache
def _code() -> str:
    """Return what tells the code that looks from another version of it: its files, others' formats, libraries."""
    from importlib.metadata import version

    from calib_core.formats.points import FORMATS

    files = {file for folder in _SEEING for file in (_PACKAGE / folder).rglob("*.py")}
    files |= {Path(entry.recognise.__code__.co_filename) for entry in FORMATS if isfunction(entry.recognise)}
    stats = [(str(file), file.stat()) for file in sorted(files)]
    told = [(name, stat.st_size, stat.st_mtime_ns) for name, stat in stats]
    return hashlib.sha256(repr([told, *map(version, _LIBRARIES)]).encode()).hexdigest()
