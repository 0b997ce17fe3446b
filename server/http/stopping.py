"""Requests that a server which is told to stop can wait for no longer: refused, as what may be asked for again."""

import asyncio

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.messages import message
from server.http.errors import storage_answer
from server.http.language import AnswerLanguage
from server.store.unavailable import UnavailableError


class Stopping:
    """A layer of the application, outside of what waits for a body's end: that would take too long now."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve; what is called off is answered with 503, unless its answer goes out already."""
        begun = False

        async def noting(sent: Message) -> None:
            nonlocal begun
            begun = True
            await send(sent)

        try:
            await self._app(scope, receive, noting)
        except asyncio.CancelledError:
            if scope["type"] != "http":
                raise
            if not begun:
                answer = storage_answer(UnavailableError(message("this server is being stopped")))
                await AnswerLanguage(answer)(scope, receive, send)
