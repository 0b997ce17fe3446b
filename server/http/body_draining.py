"""Requests are read to their end before they are answered.

A server that answers in the middle of a body and hangs up may take the answer along: the other side is still
sending, and the reset that this meets throws away what it has not read yet.
"""

import asyncio

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_MOST_BYTES = 64 * 1024 * 1024
_LONGEST_S = 10.0
_LONGEST_PAUSE_S = 1.0  # who has stopped sending is told why at once


class BodyDraining:
    """A layer of the application that takes in what the others have left of a body, up to a limit."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve; an answer begins once the body has come, or what may be waited for of it."""
        if scope["type"] != "http" or not _has_body(scope):
            await self._app(scope, receive, send)
            return
        whole = False

        async def noting() -> Message:
            nonlocal whole
            message = await receive()
            whole = message["type"] != "http.request" or not message.get("more_body", False)
            return message

        async def take_rest() -> None:
            taken = 0
            while not whole and taken < _MOST_BYTES:
                message = await asyncio.wait_for(noting(), _LONGEST_PAUSE_S)
                taken += len(message.get("body", b""))

        async def sending(message: Message) -> None:
            nonlocal whole
            if message["type"] == "http.response.start" and not whole:
                try:
                    await asyncio.wait_for(take_rest(), _LONGEST_S)
                except TimeoutError:
                    whole = True
            await send(message)

        await self._app(scope, noting, sending)


def _has_body(scope: Scope) -> bool:
    headers = Headers(scope=scope)
    return headers.get("content-length", "0") != "0" or "transfer-encoding" in headers
