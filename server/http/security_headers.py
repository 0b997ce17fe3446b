"""Names and origins, and security headers of every request.

A server on loopback is still reachable from any page in the user's browser.  Two checks keep those out: the Host
header must be a name of this server (else a foreign name was pointed at 127.0.0.1), and what changes something, or
opens a WebSocket, must come from this server's own pages.
"""

from ipaddress import ip_address
from socket import gethostname
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.errors import CalibrationError
from server.http.errors import ForbiddenError, refuse
from server.http.request_size import RequestSize
from server.http.same_origin import is_safe, is_same_origin
from server.settings import Settings, is_loopback

_PAGE = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "style-src-attr 'unsafe-inline'",  # widths and places in plots
        "img-src 'self' data: blob:",
        "connect-src 'self'",
        "frame-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    )
)
# The documentation page starts itself by an inline script and styles itself.
_DOCS = _PAGE.replace("script-src 'self'", "script-src 'self' 'unsafe-inline'").replace(
    "style-src 'self'", "style-src 'self' 'unsafe-inline'"
)
# One file that carries its own style and pictures, and runs nothing.
_REPORT = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'; " + (
    "frame-ancestors 'self'"
)
_DATA = "default-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"

_NO_DEVICES = "camera=(), microphone=(), geolocation=(), usb=(), serial=(), payment=(), display-capture=()"


class SecurityHeaders:
    """A layer of the application, outside of all that looks at who asks."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._size = RequestSize(settings)
        # No foreign name leads here by an address, so beyond this machine every address of it is one of its names.
        self._any_address = not is_loopback(settings.host)
        names = ("localhost", "127.0.0.1", "::1", settings.host, gethostname(), *settings.allowed_hosts)
        self._names = {name.lower() for name in names}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, or let pass with limits and headers."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        try:
            self._check(scope)
        except CalibrationError as error:
            await refuse(error, scope, receive, _with_headers(scope, send))
            return
        if scope["type"] == "websocket":
            await self._app(scope, receive, _with_headers(scope, send))
        else:
            await self._app(scope, self._size.counted(receive, scope), _with_headers(scope, send))

    def _check(self, scope: Scope) -> None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        host = ", ".join(hosts)
        if len(hosts) != 1 or not self._is_own(host):
            raise ForbiddenError(
                "one Host header with a name of this server",
                repr(host[:200]),
                "Open it by the address that it printed at its start, or add the name to SCANCELL_ALLOWED_HOSTS.",
            )
        if not is_safe(scope):
            _check_origin(headers, host)
        self._size.check(headers, scope)

    def _is_own(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        if name in self._names:
            return True
        try:
            return self._any_address and bool(ip_address(name))
        except ValueError:
            return False


def _check_origin(headers: Headers, host: str) -> None:
    origin = headers.get("origin")
    foreign = origin is not None and not is_same_origin(origin, host)
    if foreign or headers.get("sec-fetch-site") in ("cross-site", "same-site"):
        need = "a request from this server's own pages"
        to_do = "Open the workbench itself; programs leave the Origin header out."
        raise ForbiddenError(need, "one from {origin}", to_do, origin=origin or "another site")


def _with_headers(scope: Scope, send: Send) -> Send:
    path = scope["path"]

    async def sending(message: Message) -> None:
        if message["type"] in ("http.response.start", "websocket.http.response.start"):
            headers = MutableHeaders(scope=message)
            headers.setdefault("Content-Security-Policy", policy_for(path))
            headers["X-Content-Type-Options"] = "nosniff"
            headers["X-Frame-Options"] = "SAMEORIGIN"
            headers["Referrer-Policy"] = "same-origin"
            headers["Cross-Origin-Opener-Policy"] = "same-origin"
            headers["Cross-Origin-Resource-Policy"] = "same-origin"
            headers["Permissions-Policy"] = _NO_DEVICES
            headers.setdefault("Cache-Control", "no-cache" if path.startswith("/web/") else "no-store")
        await send(message)

    return sending


def policy_for(path: str) -> str:
    """Return the policy of an answer that does not bring its own."""
    if path == "/docs":
        return _DOCS
    if path.startswith("/api/"):
        return _REPORT if path.endswith("/report") else _DATA
    return _PAGE
