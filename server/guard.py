"""What every request passes first: names and origins, size limits, security headers.

A server on loopback is still reachable from any page in the user's browser.  Two checks keep those out: the Host
header must be a name of this server (else a foreign name was pointed at 127.0.0.1), and what changes something, or
opens a WebSocket, must come from this server's own pages.
"""

from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.errors import CalibrationError, TooLargeError
from server.errors import ForbiddenError, problem, problem_response
from server.settings import Settings, is_loopback

_ARCHIVES = "/api/v1/archives"
_SAFE_METHODS = ("GET", "HEAD", "OPTIONS")

_PAGE_POLICY = (
    "default-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'self'"
)
# The documentation page starts itself by an inline script.
_DOCS_POLICY = _PAGE_POLICY + "; script-src 'self' 'unsafe-inline'"


class Guard:
    """The outermost layer of the application."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._max_bytes = settings.max_upload_bytes
        self._max_archive_bytes = settings.max_archive_bytes
        self._open_to_names = not is_loopback(settings.host) and not settings.allowed_hosts
        self._names = {"localhost", "127.0.0.1", "::1", settings.host, *settings.allowed_hosts}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, or let pass with limits and headers."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        try:
            self._check(scope)
        except CalibrationError as error:
            if scope["type"] == "websocket":
                await receive()
                await send({"type": "websocket.close", "code": 1008, "reason": error.need})
            else:
                await problem_response(problem(error))(scope, receive, _with_headers(scope, send))
            return
        if scope["type"] == "websocket":
            await self._app(scope, receive, send)
        else:
            await self._app(scope, _limited(receive, self._limit(scope)), _with_headers(scope, send))

    def _check(self, scope: Scope) -> None:
        headers = Headers(scope=scope)
        host = headers.get("host", "")
        if not self._open_to_names and (urlsplit(f"//{host}").hostname or "") not in self._names:
            raise ForbiddenError(
                "a name of this server in the Host header",
                repr(host),
                "Open it by the address that it printed at its start, or add the name to SCANCELL_ALLOWED_HOSTS.",
            )
        if scope["type"] == "websocket" or scope["method"] not in _SAFE_METHODS:
            _check_origin(headers, host)
        length, limit = headers.get("content-length", ""), self._limit(scope)
        if length.isdecimal() and int(length) > limit:
            raise TooLargeError(f"at most {limit} bytes in one request", length, "Send less at once.", "request")

    def _limit(self, scope: Scope) -> int:
        """Return how many bytes a request may have: archives go to a file as they come, all else to memory."""
        return self._max_archive_bytes if scope["path"].startswith(_ARCHIVES) else self._max_bytes


def _limited(receive: Receive, limit: int) -> Receive:
    total = 0

    async def counting() -> Message:
        nonlocal total
        message = await receive()
        total += len(message.get("body", b""))
        if total > limit:
            # An HTTPException is the one error that passes through the body parsers unchanged.
            raise HTTPException(413, f"a request of more than {limit} bytes")
        return message

    return counting


def _check_origin(headers: Headers, host: str) -> None:
    origin = headers.get("origin")
    foreign = origin is not None and (urlsplit(origin).netloc != host or not origin.startswith("http"))
    if foreign or headers.get("sec-fetch-site") in ("cross-site", "same-site"):
        raise ForbiddenError(
            "a request from this server's own pages",
            f"one from {origin or 'another site'}",
            "Open the workbench itself; programs leave the Origin header out.",
        )


def _with_headers(scope: Scope, send: Send) -> Send:
    path = scope["path"]

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", _DOCS_POLICY if path == "/docs" else _PAGE_POLICY)
            headers["X-Content-Type-Options"] = "nosniff"
            headers["X-Frame-Options"] = "SAMEORIGIN"
            headers["Referrer-Policy"] = "same-origin"
            headers["Cross-Origin-Opener-Policy"] = "same-origin"
            headers["Cross-Origin-Resource-Policy"] = "same-origin"
            headers.setdefault("Cache-Control", "no-cache" if path.startswith("/web/") else "no-store")
        await send(message)

    return sending
