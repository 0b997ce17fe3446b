"""A request that may be sent again after its answer got lost: its Idempotency-Key, and what was answered to it."""

import json
from collections.abc import Callable
from hashlib import sha256
from typing import Any

from fastapi import Response
from fastapi.responses import JSONResponse
from pydantic_core import to_json
from sqlalchemy.orm import Session as Transaction

from server.store.answers import remember_answer, stored_answer
from server.store.database import Store
from server.store.json_text import JsonText
from server.store.models import AnswerRow, Data


class Idempotency:
    """The request's Idempotency-Key: the same key with the same content is answered once and then repeated."""

    def __init__(self, scope: str, key: str | None) -> None:
        self._scope = scope
        self._key = key

    def answered(self, store: Store, content: Any) -> JSONResponse | None:
        """Return the answer that was given to this key and content, if there is one; raises ConflictError."""
        if self._key is None:
            return None
        with store.read() as db:
            return self._answered(db, _fingerprint(content))

    def known(self, store: Store) -> bool:
        """Return whether this key was answered before, whatever the content."""
        if self._key is None:
            return False
        with store.read() as db:
            return db.get(AnswerRow, (self._scope, self._key)) is not None

    def run(
        self, store: Store, content: Any, status: int, act: Callable[[Transaction], Data | JsonText]
    ) -> tuple[Response, bool]:
        """Act within one transaction and return the answer, and whether this was the first time.

        Raises
        ------
        ConflictError
            If the key came with other content before.
        """
        with store.write() as db:
            return self.within(db, content, status, act)

    def within(
        self, db: Transaction, content: Any, status: int, act: Callable[[Transaction], Data | JsonText]
    ) -> tuple[Response, bool]:
        """Act as `run` does, within a transaction that others may share."""
        fingerprint = _fingerprint(content) if self._key is not None else ""
        stored = self._answered(db, fingerprint)
        if stored is not None:
            return stored, False
        body = act(db)
        if self._key is not None:
            remember_answer(db, self._scope, self._key, fingerprint, status, body)
        text = body.encode() if isinstance(body, JsonText) else to_json(body)
        return Response(text, status, media_type="application/json"), True

    @property
    def has_key(self) -> bool:
        """Whether the request may be one that is repeated."""
        return self._key is not None

    def _answered(self, db: Transaction, fingerprint: str) -> JSONResponse | None:
        if self._key is None:
            return None
        row = stored_answer(db, self._scope, self._key, fingerprint)
        return None if row is None else JSONResponse(row.body, row.status, {"Idempotency-Replayed": "true"})


NO_KEY = Idempotency("", None)
"""Of what comes from elsewhere than a request, or may not be repeated."""


def _fingerprint(content: Any) -> str:
    return sha256(json.dumps(content, sort_keys=True, ensure_ascii=False).encode()).hexdigest()
