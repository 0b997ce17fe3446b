"""What a store need not keep any longer: sessions by age, and the oldest of a cell beyond its room."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import timedelta
from typing import Final

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import InputError
from calib_core.moment import from_now
from server.store.database import Store
from server.store.models import FileRow, OutputRow, SessionRow
from server.store.releases import sessions_in_force
from server.store.sessions import delete_session
from server.store.standing import open_steps
from server.store.unreferenced import remove_unreferenced

_MOST: Final = 1e9  # days, or megabytes


@dataclass(frozen=True)
class Old:
    """A session that may go, and why: `age` or `quota`."""

    id: str
    name: str
    cell: str
    updated: str
    revision: int
    size: int
    why: str


def require_limits(limits: Mapping[str, float | None]) -> None:
    """Refuse limits by their names; raises InputError where none is given, or one is no size or time."""
    if all(limit is None for limit in limits.values()):
        raise InputError("{limits:or}", "neither", "Say what need not be kept.", "retention", limits=list(limits))
    for name, limit in limits.items():
        if limit is not None and not (math.isfinite(limit) and 0 <= limit <= _MOST):
            raise InputError("a number from 0 to {most:g}", f"{limit:g}", "Name another.", name, most=_MOST)


def sessions_beyond(
    db: Transaction, days: float | None = None, cell: str | None = None, quota_bytes: int | None = None
) -> list[Old]:
    """Return the sessions that a rule lets go, the oldest first.

    What is in force for a cell is kept, whatever its age: the session that its answer was released from.  So is
    one with which the cell changed, until somebody has acknowledged it.

    Parameters
    ----------
    db : Transaction
    days : float, optional
        Sessions that nobody has changed for so long go.
    cell : str, optional
        Only sessions of this cell.
    quota_bytes : int, optional
        Of each cell the oldest go, until the files of those that stay need no more than this.
    """
    in_force = sessions_in_force(db)
    sizes = _sizes(db)
    before = None if days is None else from_now(-timedelta(days=days))
    newest_first: dict[str, list[SessionRow]] = {}
    for row in db.scalars(select(SessionRow).order_by(SessionRow.updated.desc(), SessionRow.id)):
        newest_first.setdefault(row.cell_id, []).append(row)
    found: list[Old] = []
    for name, rows in newest_first.items():
        if cell is not None and name != cell:
            continue
        total = sum(sizes.get(row.id, 0) for row in rows if row.id in in_force)
        for row in rows:
            if row.id in in_force:
                continue
            size = sizes.get(row.id, 0)
            old = before is not None and row.updated < before
            too_much = quota_bytes is not None and total + size > quota_bytes
            if (old or too_much) and row.id not in open_steps(db, name):
                found.append(
                    Old(row.id, row.name, name, row.updated, row.revision, size, "age" if old else "quota")
                )
            else:
                total += size
    return sorted(found, key=lambda one: one.updated)


def remove_sessions(store: Store, sessions: Sequence[Old]) -> int:
    """Remove sessions for good, each in a transaction of its own; those that changed meanwhile stay."""
    removed = 0
    for one in sessions:
        with store.write() as db:
            row = db.get(SessionRow, one.id)
            if row is None or row.updated != one.updated:
                continue
            digests = delete_session(db, one.id)
        remove_unreferenced(store, digests)
        removed += 1
    return removed


def _sizes(db: Transaction) -> dict[str, int]:
    """Return the bytes of each session's files; what sessions share counts for each."""
    sizes: dict[str, int] = {}
    for rows in (FileRow, OutputRow):
        query = select(rows.session_id, func.sum(rows.size)).group_by(rows.session_id)
        for session_id, size in db.execute(query):
            sizes[session_id] = sizes.get(session_id, 0) + int(size)
    return sizes
