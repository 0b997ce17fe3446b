"""The zip around an archive, read with suspicion: nothing in it is believed before it is checked."""

import stat
import struct
import zipfile
import zlib
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from calib_core.archive.bag_names import require_distinct_names, require_safe_name
from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message

CHUNK_BYTES = 1 << 20

_COPY_AGAIN = message("Copy the archive again from where it was made.")
_PACK_AGAIN = message("Make it with `scancell archive pack`, and import nothing that you did not expect to be so.")
_END, _END_64, _LOCATOR_64 = b"PK\5\6", b"PK\6\6", b"PK\6\7"
_END_BYTES, _LOCATOR_64_BYTES, _END_64_BYTES = 22, 20, 56
_HEADER_BYTES = 30
_ENCRYPTED = 0x1 | 0x40 | 0x2000  # by password, strongly, with a hidden directory
_METHODS = {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}

# What zipfile raises where a file is not what its headers say.
_DAMAGE = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    ValueError,
    RuntimeError,
    NotImplementedError,
    OverflowError,
    OSError,
)


@dataclass(frozen=True)
class ArchiveLimits:
    """How much an archive may become when it is unpacked.

    Attributes
    ----------
    entries : int
        Files and folders in it.
    total_bytes : int
        All its files together, unpacked.
    ratio : int
        Of unpacked to packed bytes, of one file beyond a mebibyte.
    """

    entries: int = 100_000
    total_bytes: int = 16_000_000_000
    ratio: int = 200


LIMITS = ArchiveLimits()


class ZipFiles:
    """The checked files of a zip."""

    def __init__(self, archive: zipfile.ZipFile, files: dict[str, zipfile.ZipInfo], where: str) -> None:
        self._archive = archive
        self._files = files
        self.where = where

    @property
    def names(self) -> list[str]:
        """The files' names, in their order."""
        return list(self._files)

    def size(self, name: str) -> int:
        """Return a file's size in bytes."""
        return self._files[name].file_size

    def chunks(self, name: str) -> Iterator[bytes]:
        """Give a file's bytes piece by piece; raises InputError where they are damaged."""
        place = f"{self.where}: {name}"
        with _damage_told(place):
            file = self._archive.open(self._files[name])
        with file:
            while True:
                with _damage_told(place):
                    chunk = file.read(CHUNK_BYTES)
                if not chunk:
                    return
                yield chunk

    def read(self, name: str) -> bytes:
        """Return a file's bytes; raises InputError where they are damaged."""
        return b"".join(self.chunks(name))


@contextmanager
def open_zip(source: Path | IO[bytes], where: str = "", limits: ArchiveLimits = LIMITS) -> Generator[ZipFiles]:
    """Open a zip whose names, sizes and kinds of entries are harmless.

    Parameters
    ----------
    source : Path or binary file
    where : str
        What messages call it; left out, the path.
    limits : ArchiveLimits

    Raises
    ------
    InputError
        If it is no zip, is cut off, is encrypted, or holds links, devices, or names that lead elsewhere or
        collide.
    TooLargeError
        If it would unpack to more than the limits.
    """
    where = where or str(source)
    with _opened(source, where) as file:
        _require_directory(file, where, limits)
        with _damage_told(where):
            archive = zipfile.ZipFile(file)
        with archive:
            yield ZipFiles(archive, _checked(archive, where, limits), where)


@contextmanager
def _opened(source: Path | IO[bytes], where: str) -> Generator[IO[bytes]]:
    if not isinstance(source, Path):
        yield source
        return
    if not source.is_file():
        got = message("something else") if source.exists() else message("no such file")
        raise InputError("an archive, a .zip file", got, "Name an archive of a session.", where)
    try:
        file = source.open("rb")
    except OSError as error:
        got = (error.strerror or type(error).__name__).lower()
        raise InputError("a whole zip archive", got, "Check its permissions and the disk.", where) from None
    with file:
        yield file


@contextmanager
def _damage_told(where: str) -> Generator[None]:
    try:
        yield
    except _DAMAGE as error:
        got = " ".join(str(error).split())[:120] or type(error).__name__
        need = "a whole zip archive"
        raise InputError(need, "one that cannot be read ({found})", _COPY_AGAIN, where, found=got) from None


def _require_directory(file: IO[bytes], where: str, limits: ArchiveLimits) -> None:
    """Refuse what does not begin and end as a zip does, or lists more than the limits, before the list is read."""
    with _damage_told(where):
        size = file.seek(0, 2)
        file.seek(0)
        begin = file.read(4)
        tail_bytes = min(size, _END_BYTES + _LOCATOR_64_BYTES + _END_64_BYTES)
        file.seek(size - tail_bytes)
        tail = file.read(tail_bytes)
    if begin[:2] != b"PK" or size < _END_BYTES:
        raise InputError("a whole zip archive", "something else" if size else "an empty file", _COPY_AGAIN, where)
    end = tail[-_END_BYTES:]
    if begin != b"PK\3\4" or end[:4] != _END or end[-2:] != b"\0\0":
        got = message("one that was cut off, is empty, or has something before or behind it")
        raise InputError("a whole zip archive", got, _COPY_AGAIN, where)
    count, directory_bytes = struct.unpack("<H2xL", end[10:12] + b"\0\0" + end[12:16])
    locator = tail[-_END_BYTES - _LOCATOR_64_BYTES : -_END_BYTES]
    if locator[:4] == _LOCATOR_64:
        end_64 = tail[:_END_64_BYTES]
        if len(end_64) < _END_64_BYTES or end_64[:4] != _END_64:
            raise InputError("a whole zip archive", "one with a broken end", _COPY_AGAIN, where)
        count, directory_bytes = struct.unpack("<QQ", end_64[32:48])
    if count > limits.entries or directory_bytes > 400 * limits.entries:
        _refuse_size(
            message("at most {entries} entries", entries=limits.entries),
            message("{count} in {directory_bytes} bytes", count=count, directory_bytes=directory_bytes),
            where,
        )


def _checked(archive: zipfile.ZipFile, where: str, limits: ArchiveLimits) -> dict[str, zipfile.ZipInfo]:
    """Return the files by name, or refuse the archive."""
    entries = archive.infolist()
    if len(entries) > limits.entries:
        _refuse_size(message("at most {entries} entries", entries=limits.entries), str(len(entries)), where)
    _require_apart(archive, entries, where)
    for entry in entries:
        require_safe_name(entry.orig_filename.removesuffix("/"), where)
        if entry.filename != entry.orig_filename:
            raise InputError("plain names", ascii(entry.orig_filename)[:80], _PACK_AGAIN, where)
        _require_ordinary(entry, where)
        if entry.file_size > max(limits.ratio * entry.compress_size, CHUNK_BYTES):
            got = message(
                "{file_size} from {compress_size} in {filename}: a bomb",
                file_size=entry.file_size,
                compress_size=entry.compress_size,
                filename=entry.filename,
            )
            _refuse_size(message("at most {ratio} bytes unpacked from one packed", ratio=limits.ratio), got, where)
    total_bytes = sum(entry.file_size for entry in entries)
    if total_bytes > limits.total_bytes:
        _refuse_size(
            message("at most {total_bytes:.0f} MB unpacked", total_bytes=limits.total_bytes / 1000000.0),
            message("{total_bytes:.0f} MB", total_bytes=total_bytes / 1000000.0),
            where,
        )
    # A folder's own entry counts as something in it: it may not be there twice, nor share its name with a file.
    require_distinct_names((e.filename + "(folder)" if e.is_dir() else e.filename for e in entries), where)
    return {entry.filename: entry for entry in entries if not entry.is_dir()}


def _require_ordinary(entry: zipfile.ZipInfo, where: str) -> None:
    """Refuse links, devices, encrypted entries, and ways of packing that need another program."""
    place = f"{where}: {ascii(entry.filename)[:80]}"
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFDIR if entry.is_dir() else stat.S_IFREG):
        got = (
            message("a link") if kind == stat.S_IFLNK else message("a device, a pipe or a folder by a file's name")
        )
        raise InputError("files and folders alone", got, _PACK_AGAIN, place)
    if entry.is_dir() and entry.file_size:
        raise InputError("folders without content", "one with content", _PACK_AGAIN, place)
    if entry.flag_bits & _ENCRYPTED:
        raise InputError("entries that anyone can read", "an encrypted one", "Pack it without a password.", place)
    if entry.compress_type not in _METHODS:
        got = message("method {compress_type}", compress_type=entry.compress_type)
        raise InputError("entries stored or deflated", got, "Pack it with an ordinary zip program.", place)


def _require_apart(archive: zipfile.ZipFile, entries: list[zipfile.ZipInfo], where: str) -> None:
    """Refuse entries that lie in each other: a small file unpacks to a huge one that way."""
    begins = sorted((entry.header_offset, entry.compress_size) for entry in entries)
    ends = [begin + _HEADER_BYTES + size for begin, size in begins]
    nexts = [begin for begin, _ in begins[1:]] + [archive.start_dir]
    if any(end > following for end, following in zip(ends, nexts, strict=True)) or (begins and begins[0][0]):
        raise InputError("entries one behind the other", "some that overlap, or a gap before", _PACK_AGAIN, where)


def _refuse_size(need: str, got: str, where: str) -> None:
    raise TooLargeError(need, got, "Split the session, or check where the archive comes from.", where)
