"""Answers to POSTs that carried an Idempotency-Key, so that a repeated request does nothing twice."""

from datetime import timedelta

from sqlalchemy import delete, insert
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError
from calib_core.moment import from_now, now
from server.store.json_text import JsonText
from server.store.models import AnswerRow, Data

_KEPT = timedelta(days=7)
_ADD = insert(AnswerRow)


def stored_answer(db: Transaction, scope: str, key: str, fingerprint: str) -> AnswerRow | None:
    """Return the answer that was given to a key within a scope (method and path), or None.

    Raises
    ------
    ConflictError
        If the key was used there with another content.
    """
    row = db.get(AnswerRow, (scope, key))
    if row is not None and row.fingerprint != fingerprint:
        got = "'{key}', which was sent with other content before"
        to_do = "Send a fresh key with each new request; repeat a key only with the very same content."
        raise ConflictError("a new Idempotency-Key for new content", got, to_do, "Idempotency-Key", key=key)
    return row


def remember_answer(
    db: Transaction, scope: str, key: str, fingerprint: str, status: int, body: Data | JsonText
) -> None:
    """Store an answer in the transaction that makes it true."""
    row = {"scope": scope, "key": key, "fingerprint": fingerprint, "status": status, "body": body}
    db.connection().execute(_ADD, {**row, "created": now()})


def forget_old_answers(db: Transaction) -> None:
    """Remove answers of more than a week ago."""
    db.execute(delete(AnswerRow).where(AnswerRow.created < from_now(-_KEPT)))
