"""Where a merge puts the voxels that memory does not hold: a nameless file, which goes away whatever happens."""

import tempfile
from types import TracebackType

from calib_core.errors import InputError
from calib_core.messages import message


class FileSpill:
    """A store of tiles in a temporary file that has no name; use it in a `with` statement.

    However the process ends, the system takes the file away with it.

    Raises
    ------
    InputError
        If the disk is full or cannot be written.
    """

    def __init__(self) -> None:
        self._folder = tempfile.gettempdir()
        try:
            # Every write goes to the disk, so that a full one is met here.
            self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 (`__exit__` closes it)
        except OSError as error:
            raise self._no_room(error) from None
        self._places: dict[int, list[tuple[int, int]]] = {}
        self.bytes_written = 0

    def __enter__(self) -> "FileSpill":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, tile: int, data: bytes) -> None:
        """Add bytes to a tile; raises InputError."""
        place = self.bytes_written
        try:
            self._file.seek(place)
            rest = memoryview(data)
            while len(rest):
                rest = rest[self._file.write(rest) :]
        except OSError as error:
            raise self._no_room(error) from None
        self._places.setdefault(tile, []).append((place, len(data)))
        self.bytes_written += len(data)

    def read(self, tile: int) -> bytes:
        """Return all bytes of a tile."""
        pieces: list[bytes] = []
        for place, size in self._places[tile]:
            self._file.seek(place)
            pieces.append(self._file.read(size))
        return b"".join(pieces)

    def _no_room(self, error: OSError) -> InputError:
        got = (error.strerror or type(error).__name__).lower()
        to_do = message("Make room there, merge with larger voxels, or allow more memory (cell.merge.memory_mb).")
        return InputError("room for the merge's intermediate file", got, to_do, self._folder)
