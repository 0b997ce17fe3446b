"""Other sides that leave before the end: nobody is left to be told, and nothing has failed."""

from anyio import BrokenResourceError
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocketDisconnect
from uvicorn.protocols.utils import ClientDisconnected


class Disconnects:
    """A layer of the application that ends a WebSocket, or a stream of events, in silence once it was left.

    What is sent to a WebSocket then fails with an OSError, which further in would be taken for a disk that cannot
    be used; and uvicorn takes a refusal, once it is sent, for a handshake that was forgotten. Events that wait to
    be sent when their reader hangs up find their stream closed.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve; raises ClientDisconnected, which the server expects, where nobody is there any more."""
        if scope["type"] != "websocket":
            try:
                await self._app(scope, receive, send)
            except* BrokenResourceError:
                pass
            return
        disconnected = False

        async def receive_noting() -> Message:
            nonlocal disconnected
            message = await receive()
            disconnected = disconnected or message["type"] == "websocket.disconnect"
            return message

        async def send_noting(message: Message) -> None:
            nonlocal disconnected
            try:
                await send(message)
            except OSError as error:
                disconnected = True
                raise WebSocketDisconnect(1006) from error
            disconnected = disconnected or message["type"] == "websocket.http.response.body"

        try:
            await self._app(scope, receive_noting, send_noting)
        except WebSocketDisconnect:
            if not disconnected:
                raise
        if disconnected:
            raise ClientDisconnected
