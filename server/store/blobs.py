"""Files by the SHA-256 of their content, each written once and never changed."""

import os
import tempfile
import threading
import time
from collections.abc import Iterable
from hashlib import sha256
from pathlib import Path
from typing import IO

from calib_core.errors import NotFoundError

_YOUNG_S = 3600.0


class Blobs:
    """A folder of blobs.

    A blob is written beside its place, forced to the disk and renamed, so that under its name there is either all
    of it or nothing, whatever happens to the power.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._arriving = folder / "arriving"
        self._arriving.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()  # between finding a blob present and its removal

    def path(self, digest: str) -> Path:
        """Return where the blob with a SHA-256 (64 hex digits) lies."""
        return self._folder / digest[:2] / digest

    def put(self, content: bytes) -> str:
        """Store bytes durably and return their SHA-256."""
        digest = sha256(content).hexdigest()
        target = self.path(digest)
        with self._lock:
            if target.exists():
                os.utime(target)  # young again: not to be removed before it is referred to
                return digest
        target.parent.mkdir(exist_ok=True)
        handle, name = tempfile.mkstemp(dir=self._arriving)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            Path(name).replace(target)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise
        _sync_folder(target.parent)
        _sync_folder(self._folder)
        return digest

    def read(self, digest: str) -> bytes:
        """Return a blob's bytes.

        Raises
        ------
        NotFoundError
            If it is missing from the data folder.
        """
        try:
            return self.path(digest).read_bytes()
        except FileNotFoundError:
            raise NotFoundError(
                f"the stored file {digest[:12]}…",
                "nothing in its place",
                "Put the data folder back from a backup, or upload the capture again.",
                str(self._folder.name),
            ) from None

    def remove(self, digests: Iterable[str]) -> None:
        """Remove blobs that nothing refers to, except young ones: an upload may be about to refer to them."""
        oldest_s = time.time() - _YOUNG_S
        for digest in digests:
            path = self.path(digest)
            with self._lock:
                if path.exists() and path.stat().st_mtime < oldest_s:
                    path.unlink()

    def scratch(self) -> IO[bytes]:
        """Return a nameless file on the same disk, for what is on its way in or out; it goes when it is closed."""
        return tempfile.TemporaryFile(dir=self._arriving)

    def clean(self) -> None:
        """Remove what an interrupted upload left; called at start-up, before anything arrives."""
        for path in self._arriving.iterdir():
            path.unlink()


def _sync_folder(folder: Path) -> None:
    if os.name == "nt":  # folders cannot be opened there; the rename itself is journalled
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
