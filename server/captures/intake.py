"""The one way in for captures: their bytes are stored, they are measured, and the caller is answered.

Uploads small and large, batches, watched folders and the simulated cell all hand their captures over here.  Who
waits is answered with what was measured; who does not, once the captures are on the disk: the queue measures them
then.  Either way files come first and the rows that refer to them after, in a transaction shared with others.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from fastapi import Response
from sqlalchemy.orm import Session as Transaction
from starlette.concurrency import run_in_threadpool

from calib_core.errors import CalibrationError
from calib_core.moment import now
from calib_core.records import Capture, Measured, parse_session
from server.captures.batch_body import CaptureInBody
from server.captures.changes import corrected_capture
from server.captures.measurer import Measurer
from server.captures.measuring_queue import to_wait
from server.http.idempotency import NO_KEY, Idempotency
from server.http.uploads import digests_of
from server.jobs.measuring_processes import Measuring
from server.store.audit import note_captures
from server.store.calibrations import calibrated_session, needs_calibration
from server.store.capture_writes import Arrival, add_captures, is_stored, session_record
from server.store.database import Store
from server.store.group_commit import GroupCommit
from server.store.json_text import JsonText
from server.store.models import Data
from server.store.sessions import empty_session

_SESSIONS_REMEMBERED = 500
_LARGE_BYTES = 256 * 1024
"""Files of more in all are written before their transaction: those of others do not wait for them."""

_Answer = TypeVar("_Answer")


@dataclass(frozen=True)
class _Known:
    """A session's record as it was read, and the same as processes that measure take it."""

    record: Data
    cell: Data


class Intake:
    """Takes captures from wherever they come to the disk.

    Sessions' records are remembered: that what was measured for one has changed is noticed when it is stored, and
    it is measured again.
    """

    def __init__(self, store: Store, measuring: Measuring, writes: GroupCommit) -> None:
        self._store, self._measuring, self._writes = store, measuring, writes
        self._known: dict[str, _Known] = {}

    def forget(self, session_id: str) -> None:
        """Let go of what is remembered of a session that was removed."""
        self._known.pop(session_id, None)

    async def take(
        self,
        session_id: str,
        capture: Capture,
        contents: Mapping[str, bytes],
        idempotency: Idempotency = NO_KEY,
        content: Any = None,
    ) -> Response:
        """Measure and store a capture; return the answer to its request.

        Parameters
        ----------
        session_id : str
        capture : Capture
        contents : mapping of str to bytes
            Its files, by name.
        idempotency : Idempotency, optional
        content : JSON data, optional
            What makes another request with the same key the same; left out, record and files.

        Raises
        ------
        CalibrationError
            If it cannot be used at all, its id or a file's name is taken, or the cell never rests.
        """
        if idempotency.has_key:
            if content is None:
                content = [capture.to_json(), await run_in_threadpool(digests_of, contents)]
            answered = await run_in_threadpool(idempotency.answered, self._store, content)
            if answered is not None:
                return answered

        async def measure_and_store(known: _Known) -> Response:
            measured, calibration = await self._measured(session_id, known, capture, contents)

            def store(db: Transaction, digests: Sequence[str]) -> Response:
                arrival = _arrival(capture, measured, contents, iter(digests), calibration=calibration)

                def add(db: Transaction) -> JsonText:
                    (stored,) = add_captures(db, session_id, [arrival], known.record)
                    if isinstance(stored, CalibrationError):
                        raise stored
                    note_captures([capture.id])
                    return stored

                return idempotency.within(db, content, 201, add)[0]

            return await self._write(store, list(contents.values()))

        return await self._with_session(session_id, measure_and_store)

    def leave_out(self, session_id: str, capture_id: str, why: str) -> None:
        """Exclude a capture, and keep why; raises NotFoundError, ConflictError."""
        changes = {"excluded": True, "excluded_because": {"why": why}}
        corrected_capture(self._store, self._measuring.measure, session_id, capture_id, changes, None, "live cell")

    async def take_unmeasured(
        self, session_id: str, came: Sequence[CaptureInBody]
    ) -> list[bool | CalibrationError]:
        """Store captures for the queue to measure; return of each whether it is new, or why it is refused.

        Raises
        ------
        NotFoundError, ConflictError
            If there is no such session, or its cell was changed meanwhile.
        """
        known = await self._read(session_id)
        read = await run_in_threadpool(_parsed, known.cell, session_id, came)
        good = [one for one in read if not isinstance(one, CalibrationError)]

        def store(db: Transaction, digests: Sequence[str]) -> list[bool | CalibrationError]:
            following = iter(digests)
            arrivals = [
                _arrival(capture, to_wait(capture), contents, following, waits=True) for capture, contents in good
            ]
            answers = add_captures(db, session_id, arrivals, known.record)
            pairs = list(zip(arrivals, answers, strict=True))
            note_captures([a.capture.id for a, told in pairs if not isinstance(told, CalibrationError)])
            return [_outcome(db, session_id, *pair) for pair in pairs]

        outcomes = iter(await self._write(store, [part for _, contents in good for part in contents.values()]))
        return [one if isinstance(one, CalibrationError) else next(outcomes) for one in read]

    async def _measured(
        self, session_id: str, known: _Known, capture: Capture, contents: Mapping[str, bytes]
    ) -> tuple[Measured | JsonText, tuple[int, ...] | None]:
        """Return what was measured, and for raw frames the results that it rests on."""
        if not needs_calibration(capture):  # no thread is held while one waits its turn
            return await asyncio.wrap_future(self._measuring.submit(known.cell, capture, contents)), None

        def measure() -> tuple[Measured, tuple[int, ...]]:
            with self._store.read() as db:
                frames = calibrated_session(db, self._store.blobs, session_id)
            measurer = Measurer(self._measuring.measure, frames.session, lambda: frames)
            return measurer.measure(capture, contents.__getitem__), frames.results

        return await run_in_threadpool(measure)

    async def _write(
        self, act: Callable[[Transaction, Sequence[str]], _Answer], contents: Sequence[bytes]
    ) -> _Answer:
        """Return what `act` returned in a transaction, given the SHA-256 of the files, which are stored before."""
        if sum(map(len, contents)) <= _LARGE_BYTES:
            return await asyncio.wrap_future(self._writes.submit(act, contents))
        digests = await run_in_threadpool(self._store.blobs.put_all, contents)
        return await asyncio.wrap_future(self._writes.submit(lambda db, _: act(db, digests), []))

    async def _with_session(self, session_id: str, act: Callable[[_Known], Awaitable[_Answer]]) -> _Answer:
        """Act with a session as it is remembered; where that fails and it has changed since, act again."""
        known = self._known.get(session_id) or await self._read(session_id)
        try:
            return await act(known)
        except CalibrationError:
            fresh = await self._read(session_id)
            if fresh.record["cell"] == known.record["cell"]:
                raise
            return await act(fresh)

    async def _read(self, session_id: str) -> _Known:
        record = await run_in_threadpool(self._record, session_id)
        known = self._known[session_id] = _Known(record, empty_session(record, session_id).to_json())
        while len(self._known) > _SESSIONS_REMEMBERED:
            self._known.pop(next(iter(self._known)), None)
        return known

    def _record(self, session_id: str) -> Data:
        with self._store.read() as db:
            return session_record(db, session_id)


def _arrival(
    capture: Capture,
    measured: Measured | JsonText,
    contents: Mapping[str, bytes],
    digests: Iterator[str],
    **more: Any,
) -> Arrival:
    named = {name: next(digests) for name in contents}
    if capture.taken is None:
        capture = capture.model_copy(update={"taken": now(), "clock": "received"})
    return Arrival(capture, measured, named, {name: len(part) for name, part in contents.items()}, **more)


def _parsed(
    cell: Data, session_id: str, came: Sequence[CaptureInBody]
) -> list[tuple[Capture, Mapping[str, bytes]] | CalibrationError]:
    session = parse_session(cell, session_id)
    return [one.parsed(session) for one in came]


def _outcome(
    db: Transaction, session_id: str, arrival: Arrival, answer: JsonText | CalibrationError
) -> bool | CalibrationError:
    if not isinstance(answer, CalibrationError):
        return True
    return False if is_stored(db, session_id, arrival) else answer
