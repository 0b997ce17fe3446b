"""HTTP/1.1 as uvicorn reads it with httptools, which gathers heads without end: here they have one."""

from typing import Any

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

MOST_HEAD_BYTES = 64 * 1024


class LimitedHttp(HttpToolsProtocol):
    """One connection: heads, chunks' own lines and trailers are cut off where they grow too long."""

    def __init__(self, *args: Any, **named: Any) -> None:
        super().__init__(*args, **named)
        self._since_body = 0  # bytes that came since the last piece of a body

    def data_received(self, data: bytes) -> None:
        """Take what came; too much that is no body ends the connection."""
        self._since_body += len(data)
        super().data_received(data)
        if self._since_body > MOST_HEAD_BYTES and not self.transport.is_closing():
            self.send_400_response("Request head too large.")

    def on_headers_complete(self) -> None:
        """Begin to serve a request, whose head may have come with its body."""
        if len(self.url) + sum(len(name) + len(value) for name, value in self.headers) > MOST_HEAD_BYTES:
            raise ValueError("request head too large")  # becomes an answer with 400
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        """Take a piece of the body."""
        self._since_body = 0
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Note that the request is whole: the next one may begin."""
        self._since_body = 0
        super().on_message_complete()
