"""Blobs in a folder of the data disk."""

import os
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from hashlib import sha256
from pathlib import Path
from secrets import token_hex
from typing import IO

from calib_core.disk import WINDOWS, remove_file, replace_file, sync_folder
from calib_core.messages import message
from server.store.blobs import AT_ONCE, YOUNG_S, Blobs, Pieces, copied, digest_of, missing, require_same
from server.store.file_lock import file_lock

_FEW = 2  # from here on threads are worth it


class FolderBlobs(Blobs):
    """A folder of blobs.

    A blob is written beside its place, forced to the disk and renamed, so that under its name there is either all
    of it or nothing.
    """

    def __init__(self, folder: Path, make: bool = True) -> None:
        self._folder = folder
        self._arriving = folder / "arriving"
        self._lock = (
            folder / "lock" if WINDOWS else folder
        )  # others may not remove a blob between its being found and being renewed
        self._threads = ThreadPoolExecutor(AT_ONCE, "blobs")  # they begin when needed, and stay
        if make:
            self._make()

    def _make(self) -> None:
        self._arriving.mkdir(parents=True, exist_ok=True)
        for first in range(256):  # all at once, so that no blob has to wait until its folder's name is on the disk
            (self._folder / f"{first:02x}").mkdir(exist_ok=True)
        sync_folder(self._folder)

    def path(self, digest: str) -> Path:
        """Return where the blob with a SHA-256 (64 hex digits) lies."""
        return Path(f"{self._folder}/{digest[:2]}/{digest}")  # a third of the time that two steps take

    def put(self, content: bytes) -> str:
        """Store bytes durably and return their SHA-256."""
        digest = sha256(content).hexdigest()
        return digest if self._renewed(digest) else self.mend(content)

    def put_all(self, contents: Sequence[bytes]) -> list[str]:
        """Store many files durably and return the SHA-256 of each."""
        if len(contents) < _FEW:
            return [self.put(content) for content in contents]
        digests = [sha256(content).hexdigest() for content in contents]
        with ExitStack() as stack:
            written: dict[str, tuple[IO[bytes], Path]] = {}
            for digest, content in zip(digests, contents, strict=True):
                if digest not in written and not self._renewed(digest):
                    written[digest] = stack.enter_context(self._new_file())
                    written[digest][0].write(content)
                    written[digest][0].flush()
            # Many threads at once: the disk's journal is forced for all that wait, not for each.
            list(self._threads.map(os.fsync, [file.fileno() for file, _ in written.values()]))
            for digest, (file, path) in written.items():
                file.close()  # Windows renames no open file
                replace_file(path, self.path(digest))
            list(self._threads.map(sync_folder, [self._folder / first for first in {one[:2] for one in written}]))
        return digests

    def put_pieces(self, pieces: Pieces) -> tuple[str, int]:
        """Store bytes that come in pieces; return their SHA-256 and their number."""
        with self._new_file() as (file, path):
            digest, size = copied(pieces, file)
            if not self._renewed(digest):
                self._place(file, path, digest)
        return digest, size

    def mend(self, content: bytes) -> str:
        """Store bytes durably whatever lies in their place, and return their SHA-256."""
        digest = sha256(content).hexdigest()
        with self._new_file() as (file, path):
            file.write(content)
            self._place(file, path, digest)
        return digest

    def read(self, digest: str) -> bytes:
        """Return a blob's bytes, compared with their SHA-256; raises NotFoundError, DamagedError."""
        try:
            content = self.path(digest).read_bytes()
        except FileNotFoundError:
            raise missing(digest) from None
        require_same(digest, sha256(content).hexdigest())
        return content

    def open(self, digest: str) -> IO[bytes]:
        """Return a blob as a file to read, after it was compared; raises NotFoundError, DamagedError."""
        try:
            file = self.path(digest).open("rb")
        except FileNotFoundError:
            raise missing(digest) from None
        try:
            require_same(digest, digest_of(file))
        except BaseException:
            file.close()
            raise
        return file

    def damage(self, digest: str) -> str | None:
        """Return in words what is wrong with a blob, None where nothing is."""
        try:
            with self.path(digest).open("rb") as file:
                return None if digest_of(file) == digest else message("altered since it was stored")
        except FileNotFoundError:
            return message("missing from the store")
        except OSError as error:
            return message("unreadable ({error})", error=error.strerror or type(error).__name__)

    def digests(self, beginning: str = "") -> Iterator[str]:
        """Give the SHA-256 of every blob there is, or of those that begin with two digits."""
        for folder in [self._folder / beginning] if beginning else sorted(self._folder.glob("*")):
            if len(folder.name) == 2 and folder.is_dir():
                yield from sorted(path.name for path in folder.iterdir() if len(path.name) == 64)

    def remove(self, digests: Iterable[str], young_s: float | None = None) -> None:
        """Remove blobs that nothing refers to, except young ones."""
        oldest_s = time.time() - (YOUNG_S if young_s is None else young_s)
        for digest in digests:
            path = self.path(digest)
            with file_lock(self._lock):
                if path.exists() and path.stat().st_mtime < oldest_s:
                    remove_file(path)

    def scratch(self) -> IO[bytes]:
        """Return a nameless file on the same disk; it goes when it is closed."""
        return tempfile.TemporaryFile(dir=self._arriving)

    def interrupted(self) -> list[str]:
        """Return the names of what interrupted uploads left."""
        return sorted(path.name for path in self._arriving.glob("*"))

    def clean(self) -> None:
        """Remove what interrupted uploads left."""
        for path in self._arriving.iterdir():
            remove_file(path)

    def _renewed(self, digest: str) -> bool:
        """Return whether a blob is there and whole; it is made young again, for it is about to be referred to."""
        path = self.path(digest)
        if self.damage(digest):
            return False
        with file_lock(self._lock):
            try:
                os.utime(path)
            except FileNotFoundError:
                return False
        return True

    @contextmanager
    def _new_file(self) -> Generator[tuple[IO[bytes], Path]]:
        path = Path(f"{self._arriving}/{token_hex(16)}")
        try:
            with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
                yield file, path
        finally:
            remove_file(path, missing_ok=True)  # it has another name now; else it is not wanted

    def _place(self, file: IO[bytes], path: Path, digest: str) -> None:
        target = self.path(digest)
        file.flush()
        os.fsync(file.fileno())
        file.close()  # Windows renames no open file
        replace_file(path, target)
        sync_folder(target.parent)
