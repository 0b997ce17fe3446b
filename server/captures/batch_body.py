"""Many captures in one request, for machines that deliver thousands of profiles.

The body is one capture after the other: a line of JSON, the record with `sizes` beside it (the bytes of each of
its `files`, in their order), then the files themselves, back to back.  It is stored while it comes, in bunches,
each on the disk before the next is begun.
"""

from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from calib_core.errors import CalibrationError, InputError, TooLargeError
from calib_core.messages import message
from calib_core.records import Capture, Session, parse_capture
from calib_core.records.strict_fields import require_known_fields
from server.http.strict_json import parse_json
from server.measuring import check_poses

_MAX_LINE_BYTES = 1_000_000
_BUNCH_CAPTURES = 250
_BUNCH_BYTES = 8_000_000


@dataclass(frozen=True)
class CaptureInBody:
    """A capture as it came: its record's data and its files' bytes, or why the body cannot be read on."""

    where: str
    data: dict[str, Any]
    contents: Sequence[bytes]
    broken: CalibrationError | None = None

    def parsed(self, session: Session) -> tuple[Capture, Mapping[str, bytes]] | CalibrationError:
        """Return the capture and its files by name, or why it is of no use."""
        if self.broken is not None:
            return self.broken
        try:
            capture = parse_capture(self.data, self.where)
            if not len(set(capture.files)) == len(self.contents) == len(capture.files):
                got, to_do = (
                    message("{count} for {count_other}", count=len(capture.files), count_other=len(self.contents)),
                    message("Name it once."),
                )
                raise InputError("as many different `files` as `sizes`", got, to_do, self.where)
            require_known_fields(capture, self.where)
            check_poses(session, capture)
        except CalibrationError as error:
            return error
        return capture, dict(zip(capture.files, self.contents, strict=True))


async def bunches(stream: AsyncIterator[bytes], max_capture_bytes: int) -> AsyncIterator[list[CaptureInBody]]:
    """Yield the captures of a body in bunches that fit in memory; a body that cannot be read on ends with why."""
    body = _Body(stream)
    bunch: list[CaptureInBody] = []
    held = number = 0
    while True:
        number += 1
        where = f"capture {number} of the batch"
        try:
            line = await body.line(where)
            if line is None:
                break
            data = parse_json(line, where)
            sizes = _sizes(data, where, max_capture_bytes)
            bunch.append(CaptureInBody(where, data, [await body.take(size, where) for size in sizes]))
        except CalibrationError as error:
            bunch.append(CaptureInBody(where, {}, [], error))
            break
        held += sum(sizes)
        if len(bunch) == _BUNCH_CAPTURES or held > _BUNCH_BYTES:
            yield bunch
            bunch, held = [], 0
    if bunch:
        yield bunch


def _sizes(data: Any, where: str, limit: int) -> list[int]:
    """Take out of a record how many bytes each of its files has."""
    sizes: Any = data.pop("sizes", None) if isinstance(data, dict) else None
    if not isinstance(sizes, list) or not all(type(size) is int and size >= 0 for size in sizes):
        to_do = message("Add `sizes` to each record: the number of bytes of each of its files.")
        raise InputError("a record with the `sizes` of its files", "something else", to_do, where)
    data.pop("measured", None)  # of a record that came from here
    if sum(sizes) > limit:
        to_do = message(
            "Thin the points, crop the frame, or split the capture; then send it and all that follows again."
        )
        raise TooLargeError("at most {limit} bytes in one capture", f"{sum(sizes)}", to_do, where, limit=limit)
    return sizes


class _Body:
    """A request's body, taken piece by piece."""

    def __init__(self, stream: AsyncIterator[bytes]) -> None:
        self._stream = stream
        self._held = bytearray()
        self._place = 0

    async def line(self, where: str) -> bytes | None:
        """Return the next line that is not empty, None at the end."""
        while True:
            end = await self._line_end(where)
            line = bytes(self._held[self._place : end])
            ended = end == len(self._held)
            self._place = min(end + 1, len(self._held))
            if line.strip():
                return line
            if ended:
                return None

    async def take(self, size: int, where: str) -> bytes:
        """Return the next bytes."""
        while len(self._held) - self._place < size:
            if not await self._more():
                got = message("the end {size} bytes before", size=size - (len(self._held) - self._place))
                to_do = message("Send this capture and all that follow again.")
                raise InputError("a file of {size} bytes", got, to_do, where, size=size)
        taken = bytes(self._held[self._place : self._place + size])
        self._place += size
        return taken

    async def _line_end(self, where: str) -> int:
        """Return where the next line ends: at its newline, or with the body."""
        searched = self._place
        while (end := self._held.find(b"\n", searched)) < 0:
            length = len(self._held) - self._place
            if length > _MAX_LINE_BYTES:
                to_do = message("Check the `sizes` of the capture before.")
                need = "a line of at most {max_line_bytes} bytes"
                raise InputError(need, "a longer one", to_do, where, max_line_bytes=_MAX_LINE_BYTES)
            if not await self._more():
                return len(self._held)
            searched = self._place + length
        return end

    async def _more(self) -> bool:
        """Get another piece, and let go of what was taken."""
        del self._held[: self._place]
        self._place = 0
        async for piece in self._stream:
            self._held += piece
            return True
        return False
