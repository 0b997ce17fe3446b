"""How large a request may be: refused by what it says of itself, and where it is longer than it says."""

from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.types import Message, Receive, Scope

from calib_core.errors import TooLargeError
from server.http.uploads import comes_in_pieces
from server.settings import Settings


class RequestSize:
    """The limits of a server: what comes in pieces goes to the disk, all else to memory."""

    def __init__(self, settings: Settings) -> None:
        self._max_bytes = settings.max_upload_bytes
        self._max_archive_bytes = settings.max_archive_bytes

    def check(self, headers: Headers, scope: Scope) -> None:
        """Raise `TooLargeError` for a request that says that it is too long."""
        length, limit = headers.get("content-length", ""), self._limit(scope)
        if length.isdecimal() and int(length) > limit:
            to_do = "Send less at once."
            raise TooLargeError("at most {limit} bytes in one request", length, to_do, "request", limit=limit)

    def counted(self, receive: Receive, scope: Scope) -> Receive:
        """Return what receives a request and ends it with 413 once it is too long."""
        limit, total = self._limit(scope), 0

        async def counting() -> Message:
            nonlocal total
            message = await receive()
            total += len(message.get("body", b""))
            if total > limit:
                # An HTTPException is the one error that passes through the body parsers unchanged.
                raise HTTPException(413, f"a request of more than {limit} bytes")
            return message

        return counting

    def _limit(self, scope: Scope) -> int:
        return self._max_archive_bytes if comes_in_pieces(scope["path"]) else self._max_bytes
