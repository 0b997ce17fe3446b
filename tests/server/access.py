"""Servers that demand a login, tokens for them, and every way in that there is."""

from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from pathlib import Path
from typing import Any

import httpx

from server.app import create_app
from server.auth.logins import Logins
from server.settings import Settings
from server.store.database import Store
from server.store.tokens import revoke_token
from tests.server.live_server import serving

ROLES = ("read", "capture", "release", "admin")


def make_tokens(settings: Settings) -> dict[str, str]:
    """Make a token of each role, one that has expired and one that was revoked, in a store that nobody serves."""
    store = Store(settings, lambda _: None)
    store.migrate()
    logins = Logins(settings.data, store)
    with store.write() as db:
        tokens = {role: logins.make_token(db, f"one who may {role}", role, None)[1] for role in ROLES}
        tokens["expired"] = logins.make_token(db, "too late", "admin", timedelta(seconds=-1))[1]
        record, tokens["revoked"] = logins.make_token(db, "sacked", "admin", None)
        db.flush()
        revoke_token(db, record["id"])
    store.close()
    return tokens


@contextmanager
def guarded(data: Path, **changes: Any) -> Generator[tuple[httpx.Client, dict[str, str]]]:
    """Serve with a login on loopback; gives a client without one, and the tokens."""
    settings = Settings(**{"data": data, "port": 0, "warm_up": False, "require_login": True, **changes})
    tokens = make_tokens(settings)
    with serving(settings) as client:
        yield client, tokens


def bearer(token: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {token}"}


def site_of(client: httpx.Client) -> str:
    return str(client.base_url).removesuffix("/api/v1/")


def log_in(client: httpx.Client, token: str) -> dict[str, str]:
    """Log in as the page does; gives the headers that its browser then sends."""
    answer = client.post("/login", json={"token": token}, headers={"Origin": site_of(client)})
    assert answer.status_code == 200, answer.text
    client.cookies.clear()
    cookie = answer.headers["set-cookie"].split(";")[0]
    return {"Cookie": cookie, "Origin": site_of(client)}


def every_route() -> list[tuple[str, str]]:
    """Return (method, template) of all that the application answers, in its description or not; WS: WebSockets."""
    app = create_app(Settings(data=Path("unused")))
    return sorted(set(_walk(app.router.routes)))


def _walk(routes: Iterable[Any]) -> Iterator[tuple[str, str]]:
    for route in routes:
        if hasattr(route, "effective_candidates"):  # a router that was included, perhaps within another
            yield from _walk(route.effective_candidates())
            continue
        bare = getattr(route, "starlette_route", None) or getattr(route, "original_route", None) or route
        path = getattr(route, "path", None) or bare.path
        if type(bare).__name__ == "Mount":
            yield "GET", path.removesuffix("/{path:path}") + "/{path:path}"
        elif "WebSocket" in type(bare).__name__:
            yield "WS", path
        else:
            for method in getattr(route, "methods", None) or bare.methods:
                if method != "HEAD":
                    yield method, path
