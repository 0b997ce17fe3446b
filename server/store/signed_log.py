"""The signed log: what was solved, released, asked for and acknowledged, numbered, each entry signed with the one
before it.

Entries that somebody takes out leave a gap.  Where the log ends is kept beside the key, in no data folder: so the
last ones are missed too.
"""

from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from typing import Final, Literal

from sqlalchemy import func, select
from sqlalchemy.orm import Session as Transaction

from calib_core.archive.keys import key_file, keys
from calib_core.errors import InputError
from calib_core.formats.shared.writing import write_atomically
from server.store.models import Data, LogRow

Kind = Literal["begun", "result", "release", "policy", "acknowledged", "removed"]
_CHANGED: Final = "signed_log"
_CLOSED: Final = 2**62
_verified: dict[tuple[str, int], int] = {}
"""By the log's id and beginning: up to which entry all were found to hold; a server begins anew."""


def begin(db: Transaction, why: str) -> None:
    """Begin the log, or begin it anew: what is missing before does not count any more."""
    before = _begun(db)
    note(db, "begun", "", {"id": token_hex(8), "why": why})
    if why == "accepted" and before is not None:  # nobody goes back behind it
        _keep_end(before.told["id"], _CLOSED)


def note(db: Transaction, kind: Kind, of: str, told: Data) -> LogRow:
    """Add an entry about a session or a cell (`of`)."""
    db.flush()
    last = db.scalars(select(LogRow).order_by(LogRow.number.desc()).limit(1)).first()
    begun = _begun(db)
    ends = [0 if last is None else last.number, 0 if begun is None else _kept_end(begun.told["id"])]
    before = "" if last is None else str((last.seal or {}).get("signature"))
    row = LogRow(number=max(end for end in ends if end < _CLOSED) + 1, kind=kind, of=of, told=told, before=before)
    db.add(row)
    db.flush()
    db.info[_CHANGED] = True
    return row


def entries(db: Transaction, kind: Kind, of: str) -> list[LogRow]:
    """Return the entries of a kind about a session or a cell, the oldest first; whether each holds, it says."""
    query = select(LogRow).where(LogRow.kind == kind, LogRow.of == of)
    return list(db.scalars(query.order_by(LogRow.number)))


def newest(db: Transaction, kind: Kind, of: str) -> LogRow | None:
    """Return the newest of these; None where there is none."""
    query = select(LogRow).where(LogRow.kind == kind, LogRow.of == of)
    return db.scalars(query.order_by(LogRow.number.desc()).limit(1)).first()


def is_whole(db: Transaction) -> bool:
    """Return whether no entry was taken out or changed."""
    if keys().trouble:
        return True
    begun = _begun(db)
    if begun is None:
        return False
    query = select(func.count(), func.max(LogRow.number)).where(LogRow.number >= begun.number)
    count, last = db.execute(query).one()
    if count != last - begun.number + 1 or _kept_end(begun.told["id"]) > last:
        return False
    log = (str(begun.told["id"]), begun.number)
    rows = select(LogRow).where(LogRow.number > _verified.get(log, begun.number - 1)).order_by(LogRow.number)
    if not all(row.holds for row in db.scalars(rows)):
        return False
    _verified[log] = last
    return True


def verify_anew() -> None:
    """Forget which entries were found to hold: they are looked at again when next asked for."""
    _verified.clear()


def end_to_keep(db: Transaction) -> tuple[str, int] | None:
    """Return the log's id and its last number, before a transaction's end that adds to it; None for others."""
    begun = _begun(db) if db.info.pop(_CHANGED, False) else None
    return None if begun is None else (begun.told["id"], db.scalars(select(func.max(LogRow.number))).one())


def keep_end(end: tuple[str, int]) -> None:
    """Keep where the log ends, where this installation can write beside its key."""
    _keep_end(*end)


def _begun(db: Transaction) -> LogRow | None:
    query = select(LogRow).where(LogRow.kind == "begun").order_by(LogRow.number.desc())
    return next((row for row in db.scalars(query) if row.holds), None)


def _keep_end(log: str, number: int) -> None:
    with suppress(OSError, InputError):  # a key that is a secret of the container: then only gaps are noticed
        file = _file(log)
        file.parent.mkdir(mode=0o700, exist_ok=True)
        write_atomically(file, f"{number}\n".encode())


def _kept_end(log: str) -> int:
    try:
        return int(_file(log).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return 0


def _file(log: str) -> Path:
    return key_file().with_name(f"{key_file().stem}-logs") / (log if log.isalnum() else "other")
