"""Who sends a request, whether they may, how often, and for how long a stream may go on."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from urllib.parse import quote

import anyio
from sqlalchemy.exc import DBAPIError
from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from calib_core.errors import CalibrationError
from calib_core.messages import message
from server.auth.buckets import Buckets
from server.auth.logins import MACHINE, NOBODY, REMEMBERED_S, Identity, Logins
from server.auth.refusals import Refusals, too_many
from server.auth.roles import Role, needed_role
from server.http.errors import ForbiddenError, LoginError, deny, refuse, storage_answer
from server.http.same_origin import is_safe
from server.settings import Settings, is_loopback
from server.store.audit import Act, acting

_NO_PAGES = ("/api/", "/scenes/", "/openapi.json", "/metrics")
_LOOPBACK_FACTOR = 10.0
"""How many times more often a program on this machine may ask."""


class AuthMiddleware:
    """The layer of the application that knows who asks; behind it every request has an identity with the right."""

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._anybody = NOBODY if settings.login_required else MACHINE
        self._buckets = Buckets(settings.rate_per_s, settings.rate_burst)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, send to the login page, or let in."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        act = _act(scope)
        try:
            identity = await self._identify(scope, act)
            self._count(identity, act.address)
            _require(identity, scope, act)
        except (LoginError, ForbiddenError) as error:
            if isinstance(error, LoginError) and _is_page(scope):
                page = RedirectResponse(f"/login?next={quote(act.path, safe='')}", status_code=303)
                await page(scope, receive, send)
                return
            await run_in_threadpool(_refusals(scope).note, scope["app"].state.store, act)
            await refuse(error, scope, receive, send)
            return
        except CalibrationError as error:
            await refuse(error, scope, receive, send)
            return
        except (OSError, DBAPIError) as error:  # nobody knows who it is while the database is away
            await deny(storage_answer(error), scope, receive, send)
            return
        scope.setdefault("state", {})["identity"] = identity
        acting.set(act)
        if identity.token_id is not None and (scope["type"] == "websocket" or act.path.endswith("/events")):
            await self._while_good(identity, scope, receive, send)
        else:
            await self._app(scope, receive, send)

    async def _identify(self, scope: Scope, act: Act) -> Identity:
        """Return who asks, and say so in `act`.

        Raises
        ------
        LoginError, TooManyError
            If a token is given and is not good.  An old cookie is as good as none.
        """
        identity = self._anybody
        logins: Logins = scope["app"].state.logins
        secret, look_up = _secret(scope, logins)
        if secret is not None:
            found = logins.remembered(secret) or await run_in_threadpool(look_up, secret)
            if found is not None:
                identity = found
            elif look_up == logins.by_token:
                _refusals(scope).wrong_secret(act.address)
                to_do = "Ask an admin of this server for a new one."
                raise LoginError("a good token", "one that is unknown, expired or revoked", to_do, "Authorization")
        act.who, act.role, act.token_id = identity.name, identity.role.word, identity.token_id
        return identity

    def _count(self, identity: Identity, address: str) -> None:
        factor = _LOOPBACK_FACTOR if is_loopback(address) else 1.0
        wait_s = self._buckets.wait_s(identity.token_id or address, factor)
        if wait_s:
            raise too_many(
                wait_s, message("requests at a rate that leaves room for others"), message("more than that")
            )

    async def _while_good(self, identity: Identity, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a stream until it ends, or until the token behind it does."""
        logins: Logins = scope["app"].state.logins
        secret, look_up = _secret(scope, logins)
        assert secret is not None
        began = False

        async def noting(message: Message) -> None:
            nonlocal began
            began = True
            await send(message)

        async def watch(serving: anyio.CancelScope) -> None:
            while await run_in_threadpool(look_up, secret) == identity:
                await asyncio.sleep(REMEMBERED_S)
            serving.cancel()

        with anyio.CancelScope() as serving:
            watcher = asyncio.create_task(watch(serving))
            try:
                await self._app(scope, receive, noting)
            finally:
                watcher.cancel()
        if serving.cancelled_caught and began:
            with suppress(OSError, RuntimeError):  # the other side may have gone by itself meanwhile
                await send(_END if scope["type"] == "http" else _CLOSE)


_END: Message = {"type": "http.response.body", "body": b"", "more_body": False}
_CLOSE: Message = {"type": "websocket.close", "code": 1008, "reason": "The login has ended."}


def cookie_name(connection: HTTPConnection) -> str:
    """Return the name of the login's cookie, which differs between servers on one machine.

    Under https its prefix makes browsers refuse to have it set by other hosts or without encryption.
    """
    server = connection.scope.get("server")
    name = f"scancell-{server[1] if server else 0}"
    return f"__Host-{name}" if connection.scope["scheme"] in ("https", "wss") else name


def _secret(scope: Scope, logins: Logins) -> tuple[str | None, Callable[[str], Identity | None]]:
    """Return the token or the cookie of a request (None: neither) and what finds out whose it is."""
    kind, _, token = Headers(scope=scope).get("authorization", "").partition(" ")
    if kind.lower() == "bearer":
        return token.strip(), logins.by_token
    connection = HTTPConnection(scope)
    return connection.cookies.get(cookie_name(connection)), logins.by_cookie


def _require(identity: Identity, scope: Scope, act: Act) -> None:
    needed = needed_role("WS" if scope["type"] == "websocket" else scope["method"], act.path)
    _require_no_webhook(identity, scope)
    if identity.role >= needed:
        _require_own_page(identity, scope)
    elif identity.role == Role.NOBODY:
        to_do = "Log in at /login, or send a token: Authorization: Bearer scancell_…"
        raise LoginError("a login", "a request without one", to_do, "request")
    else:
        need = "the role {word}"
        to_do = "Ask an admin of this server for a token that may do this."
        raise ForbiddenError(need, f"{identity.role.word} ({identity.name})", to_do, "request", word=needed.word)


def _require_no_webhook(identity: Identity, scope: Scope) -> None:
    """Refuse a webhook that comes back, as by a proxy here: it would act with the trust of this machine."""
    if identity.token_id is None and "webhook-signature" in Headers(scope=scope):
        need = "a request of a program or a page"
        to_do = "Give the webhook the address of a receiver."
        raise ForbiddenError(need, "a webhook's delivery", to_do, "request")


def _require_own_page(identity: Identity, scope: Scope) -> None:
    """Refuse what a cookie would change for a page that does not say whose it is."""
    if identity.by == "cookie" and not is_safe(scope) and "origin" not in Headers(scope=scope):
        need = "a request from this server's own pages"
        to_do = "Programs send a token instead: Authorization: Bearer scancell_…"
        raise ForbiddenError(need, "a login's cookie without an Origin", to_do, "Origin")


def _act(scope: Scope) -> Act:
    client = scope.get("client")
    method = "WS" if scope["type"] == "websocket" else scope["method"]
    return Act(NOBODY.name, NOBODY.role.word, None, client[0] if client else "", method, scope["path"])


def _is_page(scope: Scope) -> bool:
    return scope["type"] == "http" and scope["method"] == "GET" and not scope["path"].startswith(_NO_PAGES)


def _refusals(scope: Scope) -> Refusals:
    return scope["app"].state.refusals
