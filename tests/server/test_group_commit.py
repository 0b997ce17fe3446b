"""Writes that share a transaction: each succeeds or fails as if it were alone."""

import threading
from collections.abc import Iterator, Sequence
from typing import Any

import pytest
from sqlalchemy import select
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Session as Transaction

from calib_core.errors import ConflictError
from server.store.audit import Act, acting
from server.store.database import Store
from server.store.group_commit import GroupCommit
from server.store.models import AuditRow, EventRow, SessionRow
from server.store.sessions import create_session, session_row

RECORD = {"cell": {"pose_convention": "ur"}}


@pytest.fixture
def together(store: Store) -> Iterator[GroupCommit]:
    together = GroupCommit(store)
    yield together
    together.stop()


def added(db: Transaction, _: Sequence[str]) -> str:
    return create_session(db, RECORD, None).id


def refused(_: Transaction, __: Sequence[str]) -> Any:
    raise ConflictError("room", "none", "Come again.")


def by(name: str) -> Act:
    return Act(name, "admin", None, "127.0.0.1", "POST", f"/{name}")


def test_writes_that_wait_share_a_transaction_and_only_the_refused_one_fails(
    store: Store, together: GroupCommit, published: list[EventRow]
) -> None:
    acting.set(by("first"))
    first = together.submit(added, [b"of the first"])
    acting.set(by("refused"))
    second = together.submit(refused, [])
    acting.set(by("third"))
    third = together.submit(lambda db, digests: (added(db, digests), list(digests)), [b"a", b"b"])
    acting.set(None)
    together.start()
    with pytest.raises(ConflictError, match="Come again"):
        second.result(timeout=300)
    session_id, digests = third.result(timeout=300)
    assert [store.blobs.read(digest) for digest in digests] == [b"a", b"b"]
    with store.read() as db:
        assert {first.result(timeout=300), session_id} == set(db.scalars(select(SessionRow.id)))
        assert list(db.scalars(select(AuditRow.who).order_by(AuditRow.number))) == ["first", "third"]
    assert [event.session_id for event in published] == [first.result(), session_id]


def test_one_that_breaks_the_transaction_leaves_the_others_whole(
    store: Store, together: GroupCommit, published: list[EventRow]
) -> None:
    def broken(db: Transaction, _: Sequence[str]) -> None:
        added(db, ())
        db.add(EventRow(session_id="nowhere", id=1, kind="session", data={}, created=""))

    acting.set(by("whole"))
    first = together.submit(added, [])
    second = together.submit(broken, [])
    third = together.submit(added, [])
    acting.set(None)
    together.start()
    whole = [first.result(timeout=300), third.result(timeout=30)]
    with pytest.raises(IntegrityError):
        second.result(timeout=300)
    with store.read() as db:
        assert set(db.scalars(select(SessionRow.id))) == set(whole)
        assert db.scalar(select(AuditRow.who)) == "whole"
    assert [event.session_id for event in published] == whole


@pytest.mark.thorough
def test_many_threads_write_at_once_and_a_stop_waits_for_what_was_given(
    store: Store, together: GroupCommit
) -> None:
    together.start()
    ids: list[str] = []

    def some() -> None:
        ids.extend(together.submit(added, [b"of all"]).result(timeout=300) for _ in range(10))

    threads = [threading.Thread(target=some) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    last = together.submit(added, [])
    together.stop()
    with store.read() as db:
        assert len(set(ids)) == 80
        for session_id in [*ids, last.result(timeout=0)]:
            assert session_row(db, session_id).id == session_id
