"""Time-outs: a request's body must keep coming, and its answer must begin in time."""

import asyncio

from starlette.exceptions import HTTPException
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.messages import message
from server.http.errors import problem_of_status, problem_response
from server.http.uploads import comes_in_pieces
from server.settings import Settings


class Timeouts:
    """A layer of the application that ends what would otherwise wait for ever."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._body_s = settings.body_timeout_s
        self._answer_s = settings.answer_timeout_s

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve, and answer with 504 if the route has not begun to answer in time."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        receive = self._with_body_timeout(receive)
        if comes_in_pieces(scope["path"]):  # they must come in time, the answer may take what it needs
            await self._app(scope, receive, send)
            return
        answer = _Answer(send)
        late: asyncio.Task[None] | None = None

        async def say_so() -> None:
            got = message("no answer within {answer_s:g} s", answer_s=self._answer_s)
            to_do = "It may still end well: send it again with the same Idempotency-Key, or look at its session."
            await problem_response(problem_of_status(504, got, to_do))(scope, receive, send)

        def give_up() -> None:
            nonlocal late
            if answer.close():
                late = asyncio.create_task(say_so())

        timer = asyncio.get_running_loop().call_later(self._answer_s, give_up)
        try:
            await self._app(scope, receive, answer.send)
        except Exception:
            if late is None:
                raise  # else nobody waits for it any more
        finally:
            timer.cancel()
            if late is not None:
                await late

    def _with_body_timeout(self, receive: Receive) -> Receive:
        whole = False

        async def receive_in_time() -> Message:
            nonlocal whole
            if whole:  # from here on it tells of a disconnection, which has its time
                return await receive()
            try:
                async with asyncio.timeout(self._body_s):
                    message = await receive()
            except TimeoutError:
                whole = True
                # An HTTPException is the one error that passes through the body parsers unchanged.
                raise HTTPException(408, f"a request whose body stopped for {self._body_s:g} s") from None
            whole = message["type"] != "http.request" or not message.get("more_body", False)
            return message

        return receive_in_time


class _Answer:
    """The way out, until it is closed."""

    def __init__(self, send: Send) -> None:
        self._send = send
        self._closed = self._began = False

    async def send(self, message: Message) -> None:
        if self._closed:
            return
        self._began = True
        await self._send(message)

    def close(self) -> bool:
        """Let nothing more out; returns whether nothing had begun to go out, else it stays open."""
        self._closed = not self._began
        return self._closed
