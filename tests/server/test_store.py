"""The store: migrations, transactions, blobs."""

import errno
import os
import threading
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from sqlalchemy import create_engine

from calib_core.causes.apply import merge_patch
from calib_core.errors import NotFoundError
from server.settings import Settings
from server.store.blob_folder import FolderBlobs
from server.store.database import Store, record_event
from server.store.models import Base, EventRow
from server.store.sessions import create_session, locked_session, session_row
from tests.server.live_server import assert_problem, simulated_session

CELL = {"cell": {"pose_convention": "ur"}}


@pytest.fixture
def published() -> list[EventRow]:
    return []


@pytest.fixture
def store(tmp_path: Path, published: list[EventRow]) -> Iterator[Store]:
    store = Store(Settings(data=tmp_path), published.append)
    store.migrate()
    yield store
    store.close()


def test_migrations_make_the_tables_that_the_program_uses(tmp_path: Path, store: Store) -> None:
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext

    store.migrate()  # a second start changes nothing
    engine = create_engine(f"sqlite:///{tmp_path / 'scancell.db'}")
    with engine.connect() as connection:
        assert connection.exec_driver_sql("PRAGMA journal_mode").scalar() == "wal"
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
    engine.dispose()


def test_what_fails_half_way_leaves_nothing_and_tells_nobody(store: Store, published: list[EventRow]) -> None:
    session_id = ""

    def fail() -> None:
        nonlocal session_id
        with store.write() as db:
            session_id = create_session(db, CELL, None).id
            db.flush()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert published == []
    with store.read() as db, pytest.raises(NotFoundError):
        session_row(db, session_id)


def test_events_are_numbered_without_gaps_however_many_write(store: Store, published: list[EventRow]) -> None:
    with store.write() as db:
        session_id = create_session(db, CELL, None).id

    def note(kind: str) -> None:
        for _ in range(20):
            with store.write() as db:
                record_event(db, locked_session(db, session_id), kind, {})

    threads = [threading.Thread(target=note, args=(f"kind{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [event.id for event in published] == list(range(1, 82))


def test_a_blob_is_whole_or_not_there(tmp_path: Path) -> None:
    blobs = FolderBlobs(tmp_path / "blobs")
    digest = blobs.put(b"points")
    assert blobs.put(b"points") == digest
    assert blobs.read(digest) == b"points"
    assert [path.read_bytes() for path in (tmp_path / "blobs").rglob("*") if path.is_file()] == [b"points"]
    (tmp_path / "blobs" / "arriving" / "cut-off").write_bytes(b"poi")
    blobs.clean()
    assert list((tmp_path / "blobs" / "arriving").iterdir()) == []
    with pytest.raises(NotFoundError, match="backup"):
        blobs.read("0" * 64)


def test_young_blobs_are_not_removed(tmp_path: Path) -> None:
    blobs = FolderBlobs(tmp_path / "blobs")
    old, young = blobs.put(b"old"), blobs.put(b"young")
    os.utime(blobs.path(old), (0, 0))
    blobs.remove([old, young, "0" * 64])
    assert not blobs.path(old).exists()
    assert blobs.read(young) == b"young"
    os.utime(blobs.path(young), (0, 0))
    blobs.put(b"young")  # came again: young again
    blobs.remove([young])
    assert blobs.read(young) == b"young"


@pytest.mark.parametrize(  # the examples of RFC 7396, appendix A
    ("data", "changes", "merged"),
    [
        ({"a": "b"}, {"a": "c"}, {"a": "c"}),
        ({"a": "b"}, {"b": "c"}, {"a": "b", "b": "c"}),
        ({"a": "b", "b": "c"}, {"a": None}, {"b": "c"}),
        ({"a": ["b"]}, {"a": "c"}, {"a": "c"}),
        ({"a": {"b": "c"}}, {"a": {"b": "d", "c": None}}, {"a": {"b": "d"}}),
        ({"a": [{"b": "c"}]}, {"a": [1]}, {"a": [1]}),
        ({"e": None}, {"a": 1}, {"e": None, "a": 1}),
        ({}, {"a": {"bb": {"ccc": None}}}, {"a": {"bb": {}}}),
    ],
)
def test_merge_patch(data: object, changes: object, merged: object) -> None:
    assert merge_patch(data, changes) == merged


@pytest.mark.parametrize(
    ("error", "status", "word"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), 507, "full"),
        (OSError(errno.EROFS, "Read-only file system"), 503, "Read-only"),
    ],
)
def test_a_disk_that_fails_is_named_and_nothing_is_half_stored(
    client: httpx.Client, monkeypatch: pytest.MonkeyPatch, error: OSError, status: int, word: str
) -> None:
    session = simulated_session(client)

    def fail(*_: object) -> str:
        raise error

    with monkeypatch.context() as patched:
        patched.setattr(FolderBlobs, "put", fail)
        assert_problem(client.post(f"/sessions/{session}/sources/simulated/capture"), status, word)
    assert client.get(f"/sessions/{session}/captures").json()["items"] == []
    assert client.post(f"/sessions/{session}/sources/simulated/capture").status_code == 201
