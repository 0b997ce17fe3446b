"""Where a merge puts the voxels that memory does not hold: one file a tile, in a folder that goes away."""

import shutil
import tempfile
from pathlib import Path
from types import TracebackType

from calib_core.errors import InputError


class FolderSpill:
    """A store of tiles in a temporary folder; use it in a `with` statement.

    Parameters
    ----------
    parent : Path, optional
        Where to make the folder; the system's temporary folder otherwise.

    Raises
    ------
    InputError
        If the disk is full or cannot be written.
    """

    def __init__(self, parent: Path | None = None) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="scancell-merge-", dir=parent))
        self.bytes_written = 0

    def __enter__(self) -> "FolderSpill":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def append(self, tile: int, data: bytes) -> None:
        """Add bytes to a tile; raises InputError."""
        try:
            with (self.folder / f"{tile}.voxels").open("ab") as file:
                file.write(data)
        except OSError as error:
            got = error.strerror or type(error).__name__
            to_do = "Make room there, merge with larger voxels, or allow more memory."
            raise InputError("room for the merge's intermediate files", got, to_do, str(self.folder)) from None
        self.bytes_written += len(data)

    def read(self, tile: int) -> bytes:
        """Return all bytes of a tile."""
        return (self.folder / f"{tile}.voxels").read_bytes()
