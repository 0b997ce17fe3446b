"""Webhooks: programs that are notified of what happens by signed POSTs, repeated until they are taken."""

import json
from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from fastapi import Path, Response
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import InputError
from calib_core.messages import message
from calib_core.records import Record
from calib_core.records.strict_fields import require_known_fields
from server.http.api_router import API, api_router
from server.http.created import created
from server.routes.dependencies import Cursor, IdempotencyDep, Limit, SettingsDep, StoreDep, WebhooksDep
from server.store.models import Data
from server.store.secrets import load_key
from server.store.webhooks import (
    KINDS,
    PING,
    Kind,
    add_webhook,
    list_deliveries,
    list_webhooks,
    remove_webhook,
    send,
    webhook_data,
    webhook_row,
)
from server.webhooks.signing import secret_of

router = api_router("webhooks", f"{API}/webhooks")

WebhookId = Annotated[str, Path(description="A webhook's `id`.", max_length=64, examples=["5f1c0a92e6b37d58"])]


class WebhookRequest(Record):
    """Where to send what: `events` left out is all; with `cell` only what happens in that cell's sessions."""

    model_config = ConfigDict(
        json_schema_extra={"examples": [{"url": "https://plc.example/scancell", "events": ["result", "verdict"]}]}
    )

    url: str = Field(max_length=2000, description="http:// or https://; no redirect is followed.")
    name: str = Field(default="", max_length=200)
    events: list[Kind] = Field(default=list(KINDS), min_length=1, max_length=20)
    cell: str | None = Field(default=None, max_length=64)


class Webhook(BaseModel):
    """A webhook; `disabled` is since when its receiver wants no more (it answered with 410)."""

    id: str
    url: str
    name: str
    events: list[Kind]
    cell: str | None
    created: str
    disabled: str | None


class MadeWebhook(Webhook):
    """A new webhook, with the secret by which its receiver checks signatures (Standard Webhooks, `whsec_…`)."""

    secret: str


class Webhooks(BaseModel):
    """All webhooks, the newest first."""

    items: list[Webhook]


class WebhookDelivery(BaseModel):
    """One message: what was sent, how often, what the receiver answered, and when it is tried next."""

    number: int
    event: str
    payload: dict[str, Any]
    status: Literal["waiting", "delivered", "failed"]
    attempts: int
    due: str | None
    answered: int | None
    error: str | None
    created: str
    finished: str | None


class WebhookDeliveries(BaseModel):
    """A page of deliveries, the newest first; `next` is the following page's cursor."""

    items: list[WebhookDelivery]
    next: str | None


class SentPing(BaseModel):
    """The id of the message that was sent."""

    id: str


@router.get("", response_model=Webhooks)
def list_all(store: StoreDep) -> Response:
    """List all webhooks."""
    with store.read() as db:
        return JSONResponse({"items": list_webhooks(db)})


@router.post("", status_code=201, response_model=MadeWebhook)
def make(body: WebhookRequest, idempotency: IdempotencyDep, store: StoreDep, settings: SettingsDep) -> Response:
    """Make a webhook; its secret stands in this answer alone."""
    require_known_fields(body, "request")
    _require_address(body.url)

    def act(db: Transaction) -> Data:
        events = [kind for kind in KINDS if kind in body.events]
        return webhook_data(add_webhook(db, body.url, body.name, events, body.cell))

    answer, _ = idempotency.run(store, body.to_json(), 201, act)
    data = json.loads(bytes(answer.body))
    secret = secret_of(load_key(settings.data), data["id"])
    return created(JSONResponse({**data, "secret": secret}, 201, _kept(answer)), "/api/v1/webhooks/{id}")


@router.get("/{webhook_id}", response_model=Webhook)
def get_webhook(webhook_id: WebhookId, store: StoreDep) -> Response:
    """Return a webhook."""
    with store.read() as db:
        return JSONResponse(webhook_data(webhook_row(db, webhook_id)))


@router.delete("/{webhook_id}", status_code=204)
def remove(webhook_id: WebhookId, store: StoreDep) -> None:
    """Remove a webhook; what waits for its receiver is not sent any more."""
    with store.write() as db:
        remove_webhook(db, webhook_id)


@router.get("/{webhook_id}/deliveries", response_model=WebhookDeliveries)
def get_deliveries(webhook_id: WebhookId, store: StoreDep, limit: Limit = 50, cursor: Cursor = None) -> Response:
    """List what was sent to a webhook or waits to be, the newest first."""
    with store.read() as db:
        return JSONResponse(list_deliveries(db, webhook_id, limit, cursor))


@router.post("/{webhook_id}/ping", status_code=202, response_model=SentPing)
def ping(webhook_id: WebhookId, idempotency: IdempotencyDep, store: StoreDep, webhooks: WebhooksDep) -> Response:
    """Send a message of the type `ping`, to try the way to the receiver."""

    def act(db: Transaction) -> Data:
        return {"id": send(db, webhook_row(db, webhook_id).id, PING, None, {})}

    answer, _ = idempotency.run(store, "ping", 202, act)
    webhooks.wake()
    return answer


def _require_address(url: str) -> None:
    """Refuse what is no address of a web server; raises InputError."""
    try:
        parts = urlsplit(url)
        good = parts.scheme in ("http", "https") and parts.hostname and parts.port != 0
    except ValueError:
        good, parts = False, urlsplit("")
    if not good or any(c.isspace() or not c.isprintable() for c in url):
        to_do = message("Write it as https://host/path.")
        raise InputError("an address that begins with http:// or https://", repr(url[:80]), to_do, "url")
    if parts.username or parts.password:
        to_do = message("Leave user and password out: the receiver knows the sender by the signature.")
        raise InputError("an address without a password", "one with it", to_do, "url")


def _kept(answer: Response) -> dict[str, str]:
    return {n: v for n, v in answer.headers.items() if n.startswith("idempotency")}
