"""The way in for small captures that come one by one, many at once: no thread is held while one waits its turn."""

import asyncio
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fastapi import Response
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError
from calib_core.records import Capture
from server.http.idempotency import Idempotency
from server.http.json_text import JsonText
from server.http.uploads import digests_of
from server.jobs.measuring_processes import Measuring
from server.store.arrivals import Arrival, add_captures, session_record
from server.store.calibrations import needs_calibration
from server.store.database import Store
from server.store.group_commit import GroupCommit
from server.store.models import Data
from server.store.sessions import empty_session

MOST_BYTES = 256 * 1024
"""What has more has its own way in."""

_REMEMBERED = 500


def is_simple(capture: Capture) -> bool:
    """Return whether a capture is measured without looking into the store."""
    return not needs_calibration(capture)


@dataclass(frozen=True, eq=False)
class _Known:
    """A session's record as it was read, and the same as processes that measure take it."""

    record: Data
    cell: Data


class Intake:
    """Takes captures from their request to the disk: measured in a process, stored in a transaction with others.

    Sessions' records are remembered: what was measured for one that has changed is noticed when it is stored, and
    measured again.
    """

    def __init__(self, store: Store, measuring: Measuring, together: GroupCommit) -> None:
        self._store, self._measuring, self._together = store, measuring, together
        self._known: OrderedDict[str, _Known] = OrderedDict()

    async def take(
        self, idempotency: Idempotency, session_id: str, capture: Capture, contents: Mapping[str, bytes]
    ) -> Response:
        """Measure and store a capture; return the answer to its request.

        Raises
        ------
        CalibrationError
            If it cannot be used at all, its id or a file's name is taken, or the cell never rests.
        """
        content = None
        if idempotency.has_key:
            content = [capture.to_json(), digests_of(contents)]
            answered = await run_in_threadpool(idempotency.answered, self._store, content)
            if answered is not None:
                return answered
        known = self._known.get(session_id) or await self._read(session_id)
        try:
            return await self._taken(idempotency, session_id, capture, contents, known, content)
        except CalibrationError:
            fresh = await self._read(session_id)
            if fresh.record["cell"] == known.record["cell"]:
                raise
            return await self._taken(idempotency, session_id, capture, contents, fresh, content)

    async def _taken(
        self,
        idempotency: Idempotency,
        session_id: str,
        capture: Capture,
        contents: Mapping[str, bytes],
        known: _Known,
        content: Any,
    ) -> Response:
        measured = await asyncio.wrap_future(self._measuring.submit(known.cell, capture, contents))
        sizes = {name: len(part) for name, part in contents.items()}

        def act(db: Transaction, digests: Sequence[str]) -> Response:
            arrival = Arrival(capture, measured, dict(zip(contents, digests, strict=True)), sizes)

            def add(db: Transaction) -> JsonText:
                (stored,) = add_captures(db, session_id, [arrival], known.record)
                if isinstance(stored, CalibrationError):
                    raise stored
                return stored

            return idempotency.within(db, content, 201, add)[0]

        return await asyncio.wrap_future(self._together.submit(act, list(contents.values())))

    async def _read(self, session_id: str) -> _Known:
        record = await run_in_threadpool(self._record, session_id)
        known = _Known(record, empty_session(record, session_id).to_json())
        self._known[session_id] = known
        while len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        return known

    def _record(self, session_id: str) -> Data:
        with self._store.read() as db:
            return session_record(db, session_id)
