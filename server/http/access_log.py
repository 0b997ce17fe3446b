"""What is known of each request: an id, one line in the log, and the figures of `/metrics`."""

import logging
import re
import time
from contextvars import ContextVar
from itertools import count
from secrets import token_hex

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server.metrics import Metrics

log = logging.getLogger("scancell.requests")

request_id: ContextVar[str | None] = ContextVar("request_id", default=None)
"""The id of the request that the present task or thread works for."""

_GIVEN_ID = re.compile(r"[A-Za-z0-9._-]{1,64}\Z")
_HEADER = "X-Request-ID"
_START, _NUMBERS = token_hex(4), count()  # differs from one start of the server to the next


class AccessLog:
    """The outermost layer of the application."""

    def __init__(self, app: ASGIApp, metrics: Metrics) -> None:
        self._app = app
        self._metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let everything pass and take notes."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        number = _id_of(scope)
        request_id.set(number)
        began_s = time.perf_counter()
        status = 0

        async def noting(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                MutableHeaders(scope=message)[_HEADER] = number
            await send(message)

        self._metrics.in_progress.inc()
        try:
            await self._app(scope, receive, noting)
        finally:
            self._metrics.in_progress.dec()
            self._note(scope, status, time.perf_counter() - began_s)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        route = _route(scope)
        self._metrics.count_request(scope["method"], route, status, seconds)
        if log.isEnabledFor(logging.INFO):
            identity = scope.get("state", {}).get("identity")
            user = identity.name if identity is not None else None
            facts = {"user": user, "method": scope["method"], "route": route, "path": scope["path"]}
            facts |= {"status": status, "ms": round(1e3 * seconds, 1)}
            log.info(
                "%s %s %d in %.1f ms",
                scope["method"],
                scope["path"],
                status,
                1e3 * seconds,
                extra={"facts": facts},
            )


def _id_of(scope: Scope) -> str:
    """Return the id that the request brings, where it looks like one, else a new one."""
    given = Headers(scope=scope).get(_HEADER, "")
    return given if _GIVEN_ID.match(given) else f"{_START}{next(_NUMBERS):08x}"


def _route(scope: Scope) -> str:
    """Return the route's template: there are few of them, and endless paths."""
    return getattr(scope.get("route"), "path", "none")
