"""Files by the SHA-256 of their content, each written once and never changed: what every place for them can do."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from typing import IO

from calib_core.captures.observation_cache import Keeper
from calib_core.errors import DamagedError, NotFoundError
from calib_core.messages import message

Pieces = Iterable[bytes | memoryview]
YOUNG_S = 3600.0
"""How long a blob that nothing refers to is kept: an upload may be about to refer to it."""
CHUNK_BYTES = 1 << 20
AT_ONCE = 16
"""How many files are on their way to the disk at once."""


class Blobs(ABC):
    """Blobs, whole or not there, whatever happens to the power: what `put` returned for is on the disk.

    Attributes
    ----------
    observations : Keeper, optional
        Keeps beside them what was seen in captures' files.
    """

    observations: Keeper | None = None

    @abstractmethod
    def put(self, content: bytes) -> str:
        """Store bytes durably and return their SHA-256 (64 hex digits)."""

    def put_all(self, contents: Sequence[bytes]) -> list[str]:
        """Store many files durably and return the SHA-256 of each."""
        if len(contents) < 2:
            return [self.put(content) for content in contents]
        with ThreadPoolExecutor(AT_ONCE) as threads:
            return list(threads.map(self.put, contents))

    @abstractmethod
    def put_pieces(self, pieces: Pieces) -> tuple[str, int]:
        """Store bytes that come in pieces, never all of them in memory; return their SHA-256 and their number."""

    @abstractmethod
    def mend(self, content: bytes) -> str:
        """Store bytes durably whatever lies in their place, and return their SHA-256."""

    @abstractmethod
    def read(self, digest: str) -> bytes:
        """Return a blob's bytes, compared with their SHA-256; raises NotFoundError, DamagedError."""

    @abstractmethod
    def open(self, digest: str) -> IO[bytes]:
        """Return a blob as a file to read, after it was compared; raises NotFoundError, DamagedError."""

    @abstractmethod
    def damage(self, digest: str) -> str | None:
        """Return in words what is wrong with a blob (missing from the store, altered), None where nothing is."""

    @abstractmethod
    def digests(self, beginning: str = "") -> Iterator[str]:
        """Give the SHA-256 of every blob there is, or of those that begin with two digits."""

    @abstractmethod
    def remove(self, digests: Iterable[str], young_s: float | None = None) -> None:
        """Remove blobs that nothing refers to, except those younger than `young_s`, left out `YOUNG_S`."""

    @abstractmethod
    def scratch(self) -> IO[bytes]:
        """Return a nameless file on the data disk, for what is on its way in or out; it goes when it is closed."""

    def trouble(self) -> str | None:
        """Return in words why nothing can be stored now, None where it can; raises OSError where it cannot."""
        with self.scratch() as file:
            file.write(b"?")
            file.flush()
        return None

    @abstractmethod
    def interrupted(self) -> list[str]:
        """Return the names of what interrupted uploads left."""

    @abstractmethod
    def clean(self) -> None:
        """Remove what interrupted uploads left; called at start-up, before anything arrives."""


def copied(pieces: Pieces, file: IO[bytes]) -> tuple[str, int]:
    """Write pieces to a file; return their SHA-256 and how many bytes they were."""
    digest, size = sha256(), 0
    for piece in pieces:
        digest.update(piece)
        file.write(piece)
        size += len(piece)
    return digest.hexdigest(), size


def chunks_to_end(file: IO[bytes]) -> Iterator[bytes]:
    """Give a file's bytes from its beginning, and close it."""
    with file:
        file.seek(0)
        while chunk := file.read(CHUNK_BYTES):
            yield chunk


def digest_of(file: IO[bytes]) -> str:
    """Return the SHA-256 of a file from its beginning, and go back there."""
    digest = sha256()
    file.seek(0)
    while chunk := file.read(CHUNK_BYTES):
        digest.update(chunk)
    file.seek(0)
    return digest.hexdigest()


def missing(digest: str) -> NotFoundError:
    """Return the error that a blob is not there."""
    to_do = message(
        "Put it back from a backup, or upload the capture again; `scancell doctor` names what else is missing."
    )
    return NotFoundError("the stored file {digest}…", "nothing there", to_do, "blobs", digest=digest[:12])


def require_same(digest: str, found: str) -> None:
    """Refuse content that is not what was stored; raises DamagedError."""
    if digest != found:
        to_do = message("Put it back from a backup; `scancell doctor` names what else is damaged.")
        need = "the stored file {digest}… as it was stored"
        raise DamagedError(need, "something else", to_do, "blobs", digest=digest[:12])
