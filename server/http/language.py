"""The language of an answer: `lang` in its address, else `Accept-Language`; `Vary` keeps caches from mixing them.

Whatever answers a request speaks English; what it says is put into the language here, in one place: JSON, events
of a stream, and messages of a WebSocket.
"""

import json
from contextvars import ContextVar
from typing import Any
from urllib.parse import parse_qs

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.findings.catalogues import LANGUAGES, catalogue
from calib_core.findings.telling import told
from calib_core.messages import ENGLISH, SAID, Catalogue

_ASKED: ContextVar[Catalogue] = ContextVar("language", default=ENGLISH)
_LARGE = 50_000
_EVENT = b"data: "
_PARTS = f'"{SAID}":['.encode()


class AnswerLanguage:
    """A layer of the application that puts what it answers into the language that is asked for."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve."""
        says = {"http": ("/api/", "/scenes/", "/login"), "websocket": ("/api/",)}.get(scope["type"], ())
        if says and scope["path"].startswith(says):
            language = catalogue(_asked(scope))
            _ASKED.set(language)
            send = _Saying(language, send)
        await self._app(scope, receive, send)


def spoken() -> Catalogue:
    """Return the language that the request at hand asks for."""
    return _ASKED.get()


def _asked(scope: Scope) -> str:
    wanted = parse_qs(scope["query_string"].decode("latin-1")).get("lang", [""])[0]
    return wanted if wanted in LANGUAGES else preferred(Headers(scope=scope).get("accept-language", ""))


class _Saying:
    """Sends what is to be sent, in a language."""

    def __init__(self, language: Catalogue, send: Send) -> None:
        self._language, self._send = language, send
        self._start: Message | None = None  # of an answer whose length is not known yet
        self._body = b""
        self._streams = False

    async def __call__(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            await self._begin(message)
        elif message["type"] == "http.response.body" and self._start is not None:
            await self._gather(message)
        else:
            if message["type"] == "http.response.body" and self._streams:
                message = {**message, "body": self._events(message.get("body", b""))}
            elif message["type"] == "websocket.send" and message.get("text") and self._language.language != "en":
                message = {**message, "text": self._said(message["text"].encode()).decode()}
            await self._send(message)

    async def _begin(self, start: Message) -> None:
        headers = MutableHeaders(scope=start)
        headers.add_vary_header("Accept-Language")
        kind = headers.get("content-type", "")
        if "content-disposition" in headers:
            kind = ""
        self._streams = kind.startswith("text/event-stream") and self._language.language != "en"
        if kind.partition(";")[0].endswith("json"):
            self._start = start
        else:
            await self._send(start)

    async def _gather(self, message: Message) -> None:
        self._body += message.get("body", b"")
        if message.get("more_body"):
            return
        assert self._start is not None
        if self._body:
            large = len(self._body) > _LARGE
            body = await run_in_threadpool(self._said, self._body) if large else self._said(self._body)
            MutableHeaders(scope=self._start)["content-length"] = str(len(body))
            message = {**message, "body": body}
        await self._send(self._start)
        await self._send(message)

    def _events(self, body: bytes) -> bytes:
        lines = body.split(b"\n")
        return b"\n".join(
            _EVENT + self._said(line.removeprefix(_EVENT)) if line.startswith(_EVENT) else line for line in lines
        )

    def _said(self, text: bytes) -> bytes:
        if self._language.language == "en" and _PARTS not in text:
            return text
        try:
            data: Any = json.loads(text)
        except ValueError:
            return text
        return json.dumps(told(data, self._language), ensure_ascii=False, separators=(",", ":")).encode()


def preferred(accepted: str) -> str:
    """Return which of our languages an `Accept-Language` header prefers; English where it names none of them."""
    ranked: list[tuple[float, str]] = []
    for part in accepted.split(","):
        name, _, quality = part.strip().lower().partition(";")
        language = name.strip().split("-")[0]
        if language in LANGUAGES or language == "*":
            ranked.append((_quality(quality), "en" if language == "*" else language))
    best = max(ranked, key=lambda one: one[0], default=(0.0, "en"))
    return best[1] if best[0] > 0 else "en"


def _quality(text: str) -> float:
    try:
        return float(text.strip().removeprefix("q=") or 1)
    except ValueError:
        return 0.0
