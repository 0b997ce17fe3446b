"""Webhooks and their deliveries, which a transaction leaves behind together with what it tells of."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta
from secrets import token_hex
from typing import Final, Literal, get_args

from sqlalchemy import ForeignKey, Index, String, delete, insert, select, update
from sqlalchemy.orm import Mapped, Session, mapped_column

from calib_core.messages import message
from calib_core.moment import from_now, now
from server.store.models import Base, Data, EventRow, SessionRow, required
from server.store.paging import Page, after_cursor, page_of

Kind = Literal[
    "capture", "result", "verdict", "job", "session", "release", "verify-fail", "drift", "overdue", "device-lost",
    "job-failed", "disk",
]  # fmt: skip
KINDS: Final[tuple[Kind, ...]] = get_args(Kind)
"""What a webhook may be told: captures that came or changed, results, verdicts that differ from the one before,
jobs that ended, sessions, answers that were released, verifications that failed, steps of a cell,
answers in force that became overdue, devices that were lost, jobs that failed, and a disk that fills."""

PING: Final = "ping"
_WAITS_S: Final = (5, 30, 120, 600, 3600, 3 * 3600, 6 * 3600, 12 * 3600, 24 * 3600)
"""How long a delivery waits after each attempt that failed; after the last one it is given up."""
_AT_ONCE: Final = 100
_KEPT_DAYS: Final = 30
_GONE: Final = 410  # the receiver wants no more
_CACHE: Final = "webhooks"


class WebhookRow(Base):
    """Where to send what; `disabled` says since when it is not used any more, because the receiver is gone."""

    __tablename__ = "webhooks"
    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    url: Mapped[str]
    name: Mapped[str]
    events: Mapped[str]
    cell: Mapped[str | None] = mapped_column(String(64))
    created: Mapped[str] = mapped_column(String(32))
    disabled: Mapped[str | None] = mapped_column(String(32))


class DeliveryRow(Base):
    """One message to one webhook: `status` is waiting, delivered or failed; `due` when it is tried next."""

    __tablename__ = "deliveries"
    number: Mapped[int] = mapped_column(primary_key=True, autoincrement=True)
    webhook_id: Mapped[str] = mapped_column(ForeignKey("webhooks.id", ondelete="CASCADE"))
    event: Mapped[str] = mapped_column(String(16))
    payload: Mapped[Data]
    status: Mapped[str] = mapped_column(String(16), server_default="waiting")
    attempts: Mapped[int] = mapped_column(server_default="0")
    due: Mapped[str] = mapped_column(String(32))
    answered: Mapped[int | None]
    error: Mapped[str | None]
    created: Mapped[str] = mapped_column(String(32))
    finished: Mapped[str | None] = mapped_column(String(32))

    __table_args__ = (
        Index("deliveries_due", "status", "due"),
        Index("deliveries_by_webhook", "webhook_id", "number"),
    )


@dataclass(frozen=True)
class Delivery:
    """A delivery that is due."""

    number: int
    webhook_id: str
    url: str
    attempts: int
    payload: Data


def add_webhook(db: Session, url: str, name: str, events: Sequence[str], cell: str | None) -> WebhookRow:
    """Store a webhook."""
    row = WebhookRow(
        id=token_hex(8), url=url, name=name, events=",".join(events), cell=cell, created=now(), disabled=None
    )
    db.add(row)
    return row


def webhook_row(db: Session, webhook_id: str) -> WebhookRow:
    """Return a webhook; raises NotFoundError."""
    row, to_do = db.get(WebhookRow, webhook_id), message("Take one of those that are listed.")
    return required(row, message("the id of a webhook"), repr(webhook_id[:80]), to_do, "webhook")


def list_webhooks(db: Session) -> list[Data]:
    """Return all webhooks, the newest first."""
    rows = db.scalars(select(WebhookRow).order_by(WebhookRow.created.desc(), WebhookRow.id))
    return [webhook_data(row) for row in rows]


def remove_webhook(db: Session, webhook_id: str) -> None:
    """Remove a webhook with its deliveries; raises NotFoundError."""
    db.delete(webhook_row(db, webhook_id))


def webhook_data(row: WebhookRow) -> Data:
    """Return a webhook as JSON data, without its secret."""
    data = row.fields("id", "url", "name", "cell", "created", "disabled")
    return data | {"events": row.events.split(",")}


def list_deliveries(db: Session, webhook_id: str, limit: int, cursor: str | None) -> Page:
    """Return a page of a webhook's deliveries, the newest first; raises NotFoundError."""
    webhook_row(db, webhook_id)
    query = select(DeliveryRow).where(DeliveryRow.webhook_id == webhook_id)
    if cursor is not None:
        query = query.where(DeliveryRow.number < after_cursor(cursor, int)[0])
    rows = db.scalars(query.order_by(DeliveryRow.number.desc()).limit(limit + 1))
    return page_of([delivery_data(row) for row in rows], limit, lambda item: [item["number"]])


def delivery_data(row: DeliveryRow) -> Data:
    """Return a delivery as JSON data."""
    names = (
        "number", "event", "payload", "status", "attempts", "due", "answered", "error", "created", "finished",
    )  # fmt: skip
    return row.fields(*names) | {"due": row.due if row.status == "waiting" else None}


_WANTED = select(WebhookRow.id, WebhookRow.events, WebhookRow.cell).where(WebhookRow.disabled.is_(None))


def tell(db: Session, kind: str, session_id: str | None, data: Data, cell: str | None = None) -> None:
    """Leave a delivery to each webhook that wants to know, in the transaction that makes it happen."""
    if _CACHE not in db.info:
        db.info[_CACHE] = db.connection().execute(_WANTED).all()
    for webhook_id, events, only_cell in db.info[_CACHE]:
        if kind in events.split(",") and (
            only_cell is None or only_cell == (cell or _cell_of(db, session_id or ""))
        ):
            send(db, webhook_id, kind, session_id, data)


def wanted(db: Session, kind: str) -> bool:
    """Return whether a webhook wants to be told of such events."""
    return any(kind in events.split(",") for _, events, _ in db.execute(_WANTED))


def tell_event(db: Session, event: EventRow) -> None:
    """Tell webhooks of a session's event; of jobs, their ends alone; of releases nothing: they are told once."""
    if event.kind == "release":
        return
    if event.kind != "job" or event.data["status"] not in ("queued", "running"):
        tell(db, event.kind, event.session_id, event.data)
    if event.kind == "job" and event.data["status"] == "failed":
        tell(db, "job-failed", event.session_id, event.data)
    if event.kind == "device" and event.data["action"] == "lost":
        tell(db, "device-lost", event.session_id, event.data)


def send(db: Session, webhook_id: str, kind: str, session_id: str | None, data: Data) -> str:
    """Leave a delivery to one webhook; returns the message's id."""
    moment = now()
    message = f"msg_{token_hex(12)}"
    payload: Data = {"id": message, "type": kind, "timestamp": moment, "session": session_id, "data": data}
    values = {"webhook_id": webhook_id, "event": kind, "payload": payload, "due": moment, "created": moment}
    db.connection().execute(insert(DeliveryRow).values(**values))
    return message


def due_deliveries(db: Session) -> list[Delivery]:
    """Return what is to be sent now, each webhook's together and in their order."""
    query = (
        select(DeliveryRow.number, WebhookRow.id, WebhookRow.url, DeliveryRow.attempts, DeliveryRow.payload)
        .join(WebhookRow, WebhookRow.id == DeliveryRow.webhook_id)
        .where(DeliveryRow.status == "waiting", DeliveryRow.due <= now())
        .order_by(DeliveryRow.number)
        .limit(_AT_ONCE)
    )
    return sorted((Delivery(*row) for row in db.execute(query)), key=lambda one: (one.webhook_id, one.number))


def note_attempt(db: Session, delivery: Delivery, answered: int | None, error: str | None) -> bool:
    """Store how an attempt ended; returns whether the receiver takes more now.

    A 2xx is success.  After anything else all that waits for this receiver waits on, longer each time; a 410 ends
    the webhook.
    """
    good = answered is not None and 200 <= answered < 300
    attempts = delivery.attempts + 1
    values: Data = {"attempts": attempts, "answered": answered, "error": error}
    if good:
        values |= {"status": "delivered", "finished": now()}
    elif answered == _GONE or attempts > len(_WAITS_S):
        values |= {"status": "failed", "finished": now()}
    db.execute(update(DeliveryRow).where(DeliveryRow.number == delivery.number).values(**values))
    if good:
        return True
    of_webhook = (DeliveryRow.webhook_id == delivery.webhook_id, DeliveryRow.status == "waiting")
    if answered == _GONE:
        db.execute(update(WebhookRow).where(WebhookRow.id == delivery.webhook_id).values(disabled=now()))
        db.execute(update(DeliveryRow).where(*of_webhook).values(status="failed", finished=now()))
        return False
    wait = timedelta(seconds=_WAITS_S[min(attempts, len(_WAITS_S)) - 1])
    db.execute(update(DeliveryRow).where(*of_webhook).values(due=from_now(wait)))
    return False


def forget_old_deliveries(db: Session) -> None:
    """Remove deliveries that ended long ago."""
    before = from_now(-timedelta(days=_KEPT_DAYS))
    db.execute(delete(DeliveryRow).where(DeliveryRow.finished.is_not(None), DeliveryRow.finished < before))


def _cell_of(db: Session, session_id: str) -> str:
    row = db.get(SessionRow, session_id)
    return "" if row is None else row.cell_id
