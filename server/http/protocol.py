"""HTTP/1.1 as uvicorn reads it with httptools: heads have an end, and refusals are problem details."""

import asyncio
import json
import sys
import time
from typing import Any

import httptools
from uvicorn.protocols.http.flow_control import service_unavailable
from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from server.http.address_limit import AddressLimit
from server.http.errors import PROBLEM_JSON, problem_of_status, problem_response

MOST_HEAD_BYTES = 64 * 1024
HEALTH = "/health", "/api/v1/health"
_OFFER = (b"upgrade", b"http2-settings", b"connection")


class LimitedHttp(HttpToolsProtocol):
    """One connection: heads, chunks' own lines and trailers are cut off where they grow too long."""

    def __init__(self, *args: Any, of_address: AddressLimit, **named: Any) -> None:
        super().__init__(*args, **named)
        self._of_address = of_address
        self.opened_s = 0.0
        self._since_body = 0  # bytes that came since the last piece of a body
        self._data = b""  # what came last

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Begin; its address may have had to give up another one."""
        super().connection_made(transport)
        self.opened_s = time.monotonic()
        self._of_address.make_room(self, self.connections)

    @property
    def waits(self) -> bool:
        """Whether it is open, and no request is being answered."""
        cycle: Any = self.cycle
        return self.is_open and (cycle is None or cycle.response_complete)

    @property
    def is_open(self) -> bool:
        """Whether nobody has hung up yet."""
        return not self.transport.is_closing()

    def hang_up(self) -> None:
        """Close the connection."""
        self.transport.close()

    def data_received(self, data: bytes) -> None:
        """Take what came; too much that is no body ends the connection."""
        self._since_body += len(data)
        self._data = data
        super().data_received(data)
        if self._since_body > MOST_HEAD_BYTES and not self.transport.is_closing():
            self.send_400_response("Request head too large.")

    @property
    def head_begun(self) -> bool:
        """Whether anything came since the last request was whole."""
        return self._since_body > 0

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
        if self.scope["path"].startswith(HEALTH):
            app = self.app  # whoever watches is answered, however many there are
        elif not self._of_address.has_room(self, self.connections):
            app = problem_response(problem_of_status(503, "more connections than an address may hold"))
        elif app is service_unavailable:
            app = problem_response(problem_of_status(503, "more connections at once than this server holds"))
        super()._start_asgi_task(cycle, app)

    def _unsupported_upgrade_warning(self) -> None:
        """Go on in HTTP/1.1 where another protocol is offered, as Java's client does with HTTP/2.

        The parser has stopped after the head, and would take the body for the other protocol's: a new one reads
        the request without the offer.
        """
        error = sys.exception()
        assert isinstance(error, httptools.HttpParserUpgrade)
        rest = self._data[error.args[0] :]
        kept = [(name, value) for name, value in self.headers if name not in _OFFER]
        line = self.parser.get_method() + b" " + self.url + b" HTTP/1.1\r\n"
        head = line + b"".join(name + b": " + value + b"\r\n" for name, value in kept) + b"\r\n"
        self.parser = httptools.HttpRequestParser(self)
        self.parser.set_dangerous_leniencies(lenient_data_after_close=True)  # as uvicorn's own
        super().data_received(head + rest)

    def _offers_another_protocol(self) -> bool:
        return self.parser.should_upgrade() and not self._should_upgrade()

    def on_headers_complete(self) -> None:
        """Begin to serve a request, whose head may have come with its body."""
        if self._offers_another_protocol():
            return
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
        if self._offers_another_protocol():
            return
        super().on_message_complete()
