"""Bags (RFC 8493, BagIt 1.0) in one zip: a payload below ``data/``, and the SHA-256 of every file."""

import hashlib
import io
import os
import stat
import zipfile
import zlib
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, Final

from calib_core.archive.bag_names import require_distinct_names, require_packable_name
from calib_core.archive.bag_zip import CHUNK_BYTES, LIMITS, ArchiveLimits, ZipFiles, open_zip
from calib_core.errors import InputError, TooLargeError
from calib_core.messages import message, plural

Content = Path | bytes | Callable[[], IO[bytes]]
"""A file's content: its bytes, where they lie, or what opens them."""

BagSource = Path | IO[bytes]
"""A zipped bag: where it lies, or the open file."""

DECLARATION: Final = "bagit.txt"
MANIFEST: Final = "manifest-sha256.txt"
TAG_MANIFEST: Final = "tagmanifest-sha256.txt"
PAYLOAD: Final = "data/"

_DECLARED: Final = b"BagIt-Version: 1.0\nTag-File-Character-Encoding: UTF-8\n"
_VERSIONS: Final = ("1.0", "0.97")
_MAX_TAG_BYTES: Final = 64_000_000
_EARLIEST: Final = (1980, 1, 1, 0, 0, 0)  # every entry's time, so that the same session gives the same bytes
_COPY_AGAIN: Final = message("Copy the archive again from where it was made.")
_DENSE: Final = frozenset(
    {".npy", ".ply", ".pcd", ".png", ".jpg", ".jpeg", ".tif", ".tiff"}
)  # deflating gains little


class Bag:
    """A bag whose manifests agree with the files it holds; `verify` compares the contents too."""

    def __init__(self, files: ZipFiles, base: str, manifest: dict[str, str], tags: dict[str, str]) -> None:
        self._files = files
        self._base = base
        self._manifest = manifest
        self._tags = tags
        self.where = files.where

    @property
    def payload(self) -> list[str]:
        """The payload's file names, relative to ``data/``."""
        return [name.removeprefix(PAYLOAD) for name in self._manifest]

    @property
    def names(self) -> list[str]:
        """All files' names, relative to the bag."""
        return [name.removeprefix(self._base) for name in self._files.names]

    @property
    def payload_bytes(self) -> int:
        """The size of the payload."""
        return sum(self._files.size(self._base + name) for name in self._manifest)

    def size(self, name: str) -> int:
        """Return the size in bytes of a payload's file, named relative to ``data/``."""
        return self._files.size(self._base + PAYLOAD + name)

    def sha256(self, name: str) -> str:
        """Return the SHA-256 that the manifest gives a payload's file, named relative to ``data/``."""
        return self._manifest[PAYLOAD + name]

    def read(self, name: str) -> bytes:
        """Return the bytes of a payload's file, named relative to ``data/``; raises InputError."""
        return b"".join(self.chunks(PAYLOAD + name))

    def chunks(self, name: str) -> Iterator[bytes]:
        """Give a file's bytes, named relative to the bag; raises InputError where they are not those packed."""
        digest = hashlib.sha256()
        for chunk in self._files.chunks(self._base + name):
            digest.update(chunk)
            yield chunk
        packed = self._manifest.get(name) or self._tags.get(name)
        if packed is not None and digest.hexdigest() != packed:
            got = message("another: the file was altered")
            raise InputError("the SHA-256 that the manifest gives", got, _COPY_AGAIN, f"{self.where}: {name}")

    def verify(self) -> None:
        """Compare every file with its SHA-256; raises InputError at the first that differs."""
        for name in self.names:
            for _ in self.chunks(name):
                pass


@contextmanager
def open_bag(source: Path | IO[bytes], where: str = "", limits: ArchiveLimits = LIMITS) -> Generator[Bag]:
    """Open a zipped bag whose manifests name exactly the files that it holds.

    Parameters
    ----------
    source : Path or binary file
    where : str
        What messages call it; left out, the path.
    limits : ArchiveLimits

    Raises
    ------
    InputError
        If it is not a harmless zip (see `open_zip`), not a bag, or a file is missing or not in the manifest.
    TooLargeError
        If it would unpack to more than the limits.
    """
    with open_zip(source, where, limits) as files:
        base = _base(files)
        _require_declaration(files, base)
        manifest = _manifest(files, base, MANIFEST)
        tags = _manifest(files, base, TAG_MANIFEST) if base + TAG_MANIFEST in files.names else {}
        payload = [n.removeprefix(base) for n in files.names if n.startswith(base + PAYLOAD)]
        _require_same(payload, manifest, MANIFEST, files.where)
        others = [n.removeprefix(base) for n in files.names if not n.startswith(base + PAYLOAD)]
        if tags:
            _require_same([n for n in others if n != TAG_MANIFEST], tags, TAG_MANIFEST, files.where)
        if "fetch.txt" in others:
            raise InputError("a bag with all its files", "fetch.txt", "Fetch them, and pack again.", files.where)
        yield Bag(files, base, manifest, tags)


def write_bag(
    out: IO[bytes],
    base: str,
    payload: Mapping[str, Content],
    about: Mapping[str, str],
    more_tags: Callable[[Mapping[str, str]], Mapping[str, bytes]] = lambda _digests: {},
) -> None:
    """Write a zipped bag; the same payload gives the same bytes.

    Parameters
    ----------
    out : binary file
        Seekable.
    base : str
        The name of the one folder at the top of the zip.
    payload : mapping
        From names relative to ``data/`` to contents.
    about : mapping
        What ``bag-info.txt`` says beside the payload's size.
    more_tags : callable, optional
        Returns further tag files by name, given the payload's SHA-256 by their names in the bag.

    Raises
    ------
    InputError
        If a name cannot be stored everywhere, collides with another, or a file cannot be read.
    """
    names = sorted(payload)
    for name in names:
        require_packable_name(f"{base}/{PAYLOAD}{name}", "session")
    require_distinct_names(names, "session")
    with zipfile.ZipFile(out, "w", strict_timestamps=True) as archive:
        digests = {PAYLOAD + n: _add(archive, f"{base}/{PAYLOAD}{n}", payload[n]) for n in names}
        sizes = [info.file_size for info in archive.infolist()]
        info = {**about, "Payload-Oxum": f"{sum(sizes)}.{len(sizes)}"}
        tags = {
            "bag-info.txt": "".join(f"{key}: {' '.join(info[key].split())}\n" for key in info).encode(),
            DECLARATION: _DECLARED,
            MANIFEST: _manifest_text(digests),
            **more_tags(digests),
        }
        tag_digests = {name: _add(archive, f"{base}/{name}", content) for name, content in tags.items()}
        _add(archive, f"{base}/{TAG_MANIFEST}", _manifest_text(tag_digests))


def _add(archive: zipfile.ZipFile, name: str, content: Content) -> str:
    """Write one entry and return its SHA-256."""
    entry = zipfile.ZipInfo(name, _EARLIEST)
    entry.create_system = 3  # Unix, wherever it is written
    entry.external_attr = (stat.S_IFREG | 0o644) << 16
    digest = hashlib.sha256()
    with opened_content(content) as source:
        entry.file_size = source.seek(0, os.SEEK_END)
        entry.compress_type = zipfile.ZIP_STORED if _is_better_stored(name, source) else zipfile.ZIP_DEFLATED
        with archive.open(entry, "w") as file:
            for chunk in _chunks(source):
                digest.update(chunk)
                file.write(chunk)
    return digest.hexdigest()


@contextmanager
def opened_content(content: Content) -> Generator[IO[bytes]]:
    """Give a file's content to be read; raises InputError where it cannot be."""
    if isinstance(content, bytes):
        yield io.BytesIO(content)
        return
    try:
        file = content.open("rb") if isinstance(content, Path) else content()
    except OSError as error:
        raise _unreadable(str(content), error) from None
    with file:
        yield file


def _is_better_stored(name: str, source: IO[bytes]) -> bool:
    """Return whether deflating gains nothing, or so much that a reader must take the file for a bomb."""
    if PurePosixPath(name).suffix.lower() in _DENSE:
        return True
    size = source.seek(0, os.SEEK_END)
    if size <= CHUNK_BYTES:
        return False
    deflate = zlib.compressobj()
    packed = sum(len(deflate.compress(chunk)) for chunk in _chunks(source)) + len(deflate.flush())
    return size > LIMITS.ratio / 2 * packed


def _chunks(source: IO[bytes]) -> Iterator[bytes]:
    source.seek(0)
    while chunk := _read(source):
        yield chunk


def _read(source: IO[bytes]) -> bytes:
    try:
        return source.read(CHUNK_BYTES)
    except OSError as error:
        raise _unreadable(source.name, error) from None


def _unreadable(place: str, error: OSError) -> InputError:
    got = (error.strerror or type(error).__name__).lower()
    return InputError("a file that can be read", got, "Check its permissions and the disk.", place)


def _manifest_text(digests: Mapping[str, str]) -> bytes:
    return "".join(f"{digest}  {_encoded(name)}\n" for name, digest in digests.items()).encode()


def _encoded(name: str) -> str:
    return name.replace("%", "%25").replace("\n", "%0A").replace("\r", "%0D")


def _decoded(name: str) -> str:
    for code, character in (("%0A", "\n"), ("%0a", "\n"), ("%0D", "\r"), ("%0d", "\r"), ("%25", "%")):
        name = name.replace(code, character)
    return name


def _base(files: ZipFiles) -> str:
    """Return the folder that holds the bag: the only one at the top, or the top itself."""
    bases = {name.removesuffix(DECLARATION) for name in files.names if name.split("/")[-1] == DECLARATION}
    found = sorted((base for base in bases if base.count("/") <= 1), key=len)
    if not found:
        got = message("none among {count} files", count=len(files.names))
        to_do = "Name an archive of a session."
        raise InputError("a bag, with {declaration}", got, to_do, files.where, declaration=DECLARATION)
    outside = [name for name in files.names if not name.startswith(found[0])]
    if outside:
        got = message("{outside} outside of {found}", outside=ascii(outside[0])[:80], found=found[0])
        raise InputError("one bag and nothing beside it", got, "Pack the session again.", files.where)
    return found[0]


def _require_declaration(files: ZipFiles, base: str) -> None:
    lines = [line.partition(":") for line in _lines(files, base + DECLARATION)]
    fields = {key: value for key, _, value in lines}
    version, encoding = (fields.get(key, "").strip() for key in ("BagIt-Version", "Tag-File-Character-Encoding"))
    if version not in _VERSIONS or encoding.upper() != "UTF-8":
        got = f"version {version!r}, encoding {encoding!r}"[:120]
        raise InputError("a bag of version 1.0 in UTF-8", got, _COPY_AGAIN, f"{files.where}: {DECLARATION}")


def _manifest(files: ZipFiles, base: str, name: str) -> dict[str, str]:
    """Return the SHA-256 by file name that a manifest lists."""
    place = f"{files.where}: {name}"
    digests: dict[str, str] = {}
    there = {file.removeprefix(base) for file in files.names}
    if name not in there:
        raise InputError("a bag with {name}", "none", _COPY_AGAIN, files.where, name=name)
    for line in _lines(files, base + name):
        digest, _, listed = line.partition(" ")
        listed = listed.lstrip(" ").removeprefix("*").removeprefix("./")
        # Some tools write a per cent sign as it is.
        listed = listed if listed in there else _decoded(listed)
        if len(digest) != 64 or not listed:
            raise InputError("lines of a SHA-256 and a name", ascii(line)[:80], _COPY_AGAIN, place)
        if listed in digests:
            raise InputError("each file once", "'{name}' twice", _COPY_AGAIN, place, name=ascii(listed)[1:-1][:80])
        digests[listed] = digest.lower()
    return digests


def _lines(files: ZipFiles, name: str) -> list[str]:
    if files.size(name) > _MAX_TAG_BYTES:
        need, got = (
            message("at most {max_tag_bytes} bytes of a tag file", max_tag_bytes=_MAX_TAG_BYTES),
            f"{files.size(name)}",
        )
        raise TooLargeError(need, got, "Split it.", f"{files.where}: {name}")
    try:
        text = files.read(name).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        got = message("a byte that is no text at {start}", start=error.start)
        raise InputError("text in UTF-8", got, _COPY_AGAIN, f"{files.where}: {name}") from None
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return [line for line in lines if line.strip()]


def _require_same(there: Iterable[str], listed: Mapping[str, str], manifest: str, where: str) -> None:
    missing, extra = listed.keys() - set(there), set(there) - listed.keys()
    if missing or extra:
        name = min(missing or extra)
        got = (
            message("{name} missing", name=ascii(name)[:80])
            if missing
            else message("{name} beside them", name=ascii(name)[:80])
        )
        more = len(missing) + len(extra) - 1
        got = (
            plural(
                "{got}, and {count} more difference",
                "{got}, and {count} more differences",
                by="count",
                got=got,
                count=more,
            )
            if more
            else got
        )
        raise InputError("the files that {manifest} names", got, _COPY_AGAIN, where, manifest=manifest)
