"""The log of who did what: a row in the very transaction that does it, or for a request that was refused."""

from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from itertools import islice
from typing import cast

from sqlalchemy import insert, select
from sqlalchemy.orm import Session as Transaction

from calib_core.moment import now
from server.store.models import AuditRow, Data
from server.store.paging import Page, after_cursor, page_of

_LONGEST_PATH = 500
_ADD = insert(AuditRow)


@dataclass
class Act:
    """A request or a command on its way, by whom and from where; it is noted once."""

    who: str
    role: str
    token_id: str | None
    address: str
    method: str
    path: str
    noted: bool = field(default=False, compare=False)
    change: Data | None = field(default=None, compare=False)


acting: ContextVar[Act | None] = ContextVar("acting", default=None)
"""What the present task or thread is doing for somebody; None for what the server does by itself."""


@contextmanager
def acting_as(act: Act | None) -> Generator[None]:
    """Let what is done meanwhile be noted as this act."""
    before = acting.set(act)
    try:
        yield
    finally:
        acting.reset(before)


def note_acts(db: Transaction, acts: Iterable[Act | None]) -> None:
    """Add what is being done to the log, with the transaction that does it or not at all."""
    rows: list[Data] = []
    for act in acts:
        if act is not None and not act.noted:
            act.noted = True
            rows.append(_values(act, "done"))
    if rows:
        db.connection().execute(_ADD, rows)  # each request pays for it: no unit of work


def note_change(change: Data) -> None:
    """Keep in the log what is being changed: `before` and `after`; each change of a request is a row."""
    act = acting.get()
    if act is not None:
        act.change, act.noted = change, False


def who_acts() -> str:
    """Return who does what is being done; "" where the server does it by itself."""
    act = acting.get()
    return "" if act is None else act.who


def note_captures(ids: Sequence[str]) -> None:
    """Keep in the log which captures are being added."""
    if ids:
        note_change({"before": None, "after": {"added": list(ids)}})


def note_difference(before: Data, after: Data) -> None:
    """Keep in the log the fields of a record that are being changed, those of its parts by their path."""
    old, new = dict(_fields(before)), dict(_fields(after))
    changed = [name for name in {**old, **new} if old.get(name) != new.get(name)]
    if changed:
        told = ({name: part[name] for name in changed if name in part} for part in (old, new))
        note_change(dict(zip(("before", "after"), told, strict=True)))


def _fields(record: Data, path: str = "") -> Iterator[tuple[str, object]]:
    for name, value in record.items():
        if isinstance(value, dict):
            yield from _fields(cast("Data", value), f"{path}{name}.")
        else:
            yield f"{path}{name}", value


def note_refusal(db: Transaction, act: Act) -> None:
    """Add a request that was refused for want of a right."""
    act.noted = True
    db.connection().execute(_ADD, _values(act, "refused"))


def list_audit(db: Transaction, limit: int, cursor: str | None) -> Page:
    """Return a page of the log, the newest first."""
    query = select(AuditRow).order_by(AuditRow.number.desc()).limit(limit + 1)
    if cursor is not None:
        query = query.where(AuditRow.number < after_cursor(cursor, int)[0])
    return page_of([audit_data(row) for row in db.scalars(query)], limit, lambda item: [item["number"]])


def newest_audit(db: Transaction, limit: int) -> Iterator[Data]:
    """Yield the newest rows of the log, the newest first."""
    query = select(AuditRow).order_by(AuditRow.number.desc()).execution_options(yield_per=500)
    yield from (audit_data(row) for row in islice(db.scalars(query), limit))


def audit_data(row: AuditRow) -> Data:
    """Return a row as REST and the command line show it."""
    told = row.fields("number", "who", "role", "address", "method", "path", "outcome", "change")
    return told | {"at": row.created, "token": row.token_id}


def _values(act: Act, outcome: str) -> Data:
    return {
        "created": now(),
        "who": act.who,
        "role": act.role,
        "token_id": act.token_id,
        "address": act.address[:64],
        "method": act.method[:16],
        "path": "".join(c if c.isprintable() else "?" for c in act.path[:_LONGEST_PATH]),
        "outcome": outcome,
        "change": act.change,
    }
