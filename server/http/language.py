"""The language of an answer: `Accept-Language`, and `Vary` so that caches keep the languages apart."""

from contextvars import ContextVar

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.findings.catalogues import LANGUAGES, catalogue
from calib_core.messages import ENGLISH, Catalogue

_ASKED: ContextVar[Catalogue] = ContextVar("language", default=ENGLISH)


class AnswerLanguage:
    """A layer of the application: whatever answers a request asks `spoken` for its language."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        _ASKED.set(catalogue(preferred(Headers(scope=scope).get("accept-language", ""))))

        async def sending(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).add_vary_header("Accept-Language")
            await send(message)

        await self._app(scope, receive, sending if scope["path"].startswith("/api/") else send)


def spoken() -> Catalogue:
    """Return the language that the request at hand asks for."""
    return _ASKED.get()


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
