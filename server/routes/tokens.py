"""Access: logging in and out, tokens, and the log of who did what."""

import json
from datetime import timedelta
from typing import Annotated

from fastapi import Depends, Path, Request, Response
from fastapi.responses import JSONResponse
from sqlalchemy.orm import Session as Transaction

from server.auth.logins import Identity, Logins
from server.auth.middleware import cookie_name
from server.auth.refusals import Refusals
from server.auth.schemas import AuditPage, LoginRequest, MadeToken, Me, TokenRecord, TokenRecords, TokenRequest
from server.http.api_router import api_router, of_app
from server.http.created import created
from server.http.errors import LoginError
from server.routes.dependencies import Cursor, IdempotencyDep, Limit, SettingsDep, StoreDep
from server.store.audit import acting, list_audit
from server.store.models import Data
from server.store.tokens import list_tokens, revoke_token, token_data, token_row

router = api_router("access")


def _identity(request: Request) -> Identity:
    return request.state.identity


IdentityDep = Annotated[Identity, Depends(_identity)]
LoginsDep = Annotated[Logins, of_app("logins")]
RefusalsDep = Annotated[Refusals, of_app("refusals")]
TokenId = Annotated[str, Path(description="A token's `id`.", max_length=64, examples=["8c6e1e7b1501"])]

_LOGIN = {"machine": "not-needed", "nothing": "missing"}


@router.get("/me", response_model=Me)
def me(identity: IdentityDep) -> Response:
    """Return who asks and what they may; answers also those who are not logged in."""
    return JSONResponse(_me(identity))


@router.post("/login", response_model=Me)
def log_in(
    body: LoginRequest,
    _: IdempotencyDep,
    request: Request,
    store: StoreDep,
    logins: LoginsDep,
    refusals: RefusalsDep,
    settings: SettingsDep,
) -> Response:
    """Log a browser in with a token: the answer sets a cookie that scripts cannot read."""
    act = acting.get()
    assert act is not None  # `AuthMiddleware` has set it
    lifetime = timedelta(hours=settings.login_hours)
    try:
        with store.write() as db:
            identity, cookie = logins.log_in(db, body.token, lifetime)
            act.who, act.role, act.token_id = identity.name, identity.role.word, identity.token_id
    except LoginError:
        refusals.note(store, act)
        refusals.wrong_secret(act.address)
        raise
    response = JSONResponse(_me(identity))
    response.set_cookie(
        cookie_name(request),
        cookie,
        max_age=round(lifetime.total_seconds()),
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )
    return response


@router.post("/logout", status_code=204)
def log_out(_: IdempotencyDep, request: Request, response: Response, store: StoreDep, logins: LoginsDep) -> None:
    """End the login of the cookie that comes with this request, if there is one."""
    name = cookie_name(request)
    cookie = request.cookies.get(name)
    if cookie is None:
        return
    with store.write() as db:
        logins.log_out(db, cookie)
    logins.forget()
    secure = request.url.scheme == "https"
    response.delete_cookie(name, httponly=True, samesite="strict", secure=secure)


@router.get("/tokens", response_model=TokenRecords)
def list_all(store: StoreDep) -> Response:
    """List all tokens, also those that are no longer good; never the tokens themselves."""
    with store.read() as db:
        return JSONResponse({"items": [token_data(row) for row in list_tokens(db)]})


@router.post("/tokens", status_code=201, response_model=MadeToken)
def make(body: TokenRequest, idempotency: IdempotencyDep, store: StoreDep, logins: LoginsDep) -> Response:
    """Make a token. It stands in this answer alone: only a hash of it is kept."""
    made: list[str] = []

    def act(db: Transaction) -> Data:
        lifetime = None if body.days is None else timedelta(days=body.days)
        record, token = logins.make_token(db, body.name, body.role, lifetime)
        made.append(token)
        return {**record, "token": None}

    answer, first = idempotency.run(store, body.model_dump(), 201, act)
    if first:
        answer = JSONResponse({**json.loads(bytes(answer.body)), "token": made[0]}, 201)
    return created(answer, "/api/v1/tokens/{id}")


@router.get("/tokens/{token_id}", response_model=TokenRecord)
def get_token(token_id: TokenId, store: StoreDep) -> Response:
    """Return a token's record, also of one that is no longer good; never the token itself."""
    with store.read() as db:
        return JSONResponse(token_data(token_row(db, token_id)))


@router.delete("/tokens/{token_id}", status_code=204)
def revoke(token_id: TokenId, identity: IdentityDep, store: StoreDep, logins: LoginsDep) -> None:
    """End a token and all logins that were made with it; its streams and scenes end within seconds."""
    with store.write() as db:
        revoke_token(db, token_id, but_not=identity.token_id)
    logins.forget()


@router.get("/audit", response_model=AuditPage)
def audit(store: StoreDep, limit: Limit = 200, cursor: Cursor = None) -> Response:
    """List who did what, and who was refused what, the newest first."""
    with store.read() as db:
        return JSONResponse(list_audit(db, limit, cursor))


def _me(identity: Identity) -> Data:
    login = _LOGIN.get(identity.by, identity.by)
    return {"name": identity.name, "role": identity.role.word if identity.role else None, "login": login}
