"""Files on their way out."""

from collections.abc import Iterator, Mapping
from typing import IO

from fastapi.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from server.store.blobs import chunks_to_end


class Download(StreamingResponse):
    """An open file as an answer, from its beginning, or what is made of it while it goes out.

    The file is closed once the answer has gone out or was broken off.
    """

    def __init__(
        self,
        file: IO[bytes],
        media_type: str,
        headers: Mapping[str, str],
        pieces: Iterator[bytes | memoryview] | None = None,
    ) -> None:
        self._file = file
        super().__init__(pieces or chunks_to_end(file), media_type=media_type, headers=headers)

    def discard(self) -> None:
        """Close the file: something else is answered."""
        self._file.close()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer; a broken-off download leaves its pieces half given, so they cannot be what closes the file."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._file.close()
