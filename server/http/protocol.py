"""HTTP/1.1 as uvicorn reads it with httptools: heads have an end, and refusals are problem details."""

import json
from typing import Any

from uvicorn.protocols.http.flow_control import service_unavailable
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from server.http.errors import PROBLEM_JSON, problem_of_status, problem_response

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

    def send_400_response(self, msg: str) -> None:
        """Refuse what no route ever sees, and hang up."""
        body = json.dumps(problem_of_status(400, msg.rstrip(".").lower())).encode()
        head = STATUS_LINE[400] + (
            f"content-type: {PROBLEM_JSON}\r\ncontent-length: {len(body)}\r\n"
            "cache-control: no-store\r\nx-content-type-options: nosniff\r\nconnection: close\r\n\r\n"
        ).encode("ascii")
        self.transport.write(head + body)
        self.transport.close()

    def _start_asgi_task(self, cycle: Any, app: Any) -> None:
        if app is service_unavailable:
            app = problem_response(problem_of_status(503, "more connections at once than this server holds"))
        super()._start_asgi_task(cycle, app)

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
