"""The same store twice: SQLite with a folder, and PostgreSQL with an S3 bucket. Every test runs on both."""

import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import func, select

from calib_core.errors import ConflictError, DamagedError, InputError, NotFoundError
from server.serve import WorkbenchServer
from server.settings import Settings
from server.store import blob_bucket, blob_folder
from server.store.blob_bucket import BucketBlobs
from server.store.database import Store, record_event
from server.store.engine import engine_of
from server.store.models import Base, EventRow, SessionRow
from server.store.releases import add_release, cell_history, list_cells
from server.store.sessions import create_session, list_sessions, locked_session, session_row
from tests.server.live_server import assert_problem, make_session, serving, simulated_session, upload, wait_for
from tests.server.stores import NewPlace, alter

CELL = {"cell": {"pose_convention": "ur"}}


@pytest.fixture(scope="module")
def start(
    new_place: NewPlace, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., AbstractContextManager[httpx.Client]]:
    """Start a server on the same store each time."""
    place = new_place(tmp_path_factory.mktemp("conformance"))
    return lambda **changes: serving(Settings(**{**place, "port": 0, "warm_up": False, **changes}))


@pytest.fixture(scope="module")
def client(start: Callable[..., AbstractContextManager[httpx.Client]]) -> Iterator[httpx.Client]:
    with start() as client:
        yield client


def test_migrations_make_the_tables_that_the_program_uses(store: Store, settings: Settings) -> None:
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext

    store.migrate()  # a second start changes nothing
    engine = engine_of(settings.sql_url)
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, Base.metadata) == []
        assert len(context.get_current_heads()) == 1
    engine.dispose()


def test_what_fails_half_way_leaves_nothing_and_tells_nobody(store: Store, published: list[EventRow]) -> None:
    made: list[str] = []

    def fail() -> None:
        with store.write() as db:
            made.append(create_session(db, CELL, None).id)
            db.flush()
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert published == []
    with store.read() as db, pytest.raises(NotFoundError):
        session_row(db, made[0])


def test_a_read_sees_one_state_whatever_is_written_meanwhile(store: Store) -> None:
    with store.write() as db:
        session_id = create_session(db, CELL, None).id
    with store.read() as reading:
        assert reading.scalar(select(func.count()).select_from(SessionRow)) == 1
        with store.write() as db:
            create_session(db, CELL, None)
            record_event(db, locked_session(db, session_id), "session", {"action": "changed"})
        assert reading.scalar(select(func.count()).select_from(SessionRow)) == 1
        assert session_row(reading, session_id).last_event == 1
    with store.read() as reading:
        assert reading.scalar(select(func.count()).select_from(SessionRow)) == 2


def test_events_are_numbered_without_gaps_however_many_write(store: Store, published: list[EventRow]) -> None:
    with store.write() as db:
        session_id = create_session(db, CELL, None).id

    def note(kind: str) -> None:
        for _ in range(20):
            with store.write() as db:
                record_event(db, locked_session(db, session_id), kind, {"ok": True})

    threads = [threading.Thread(target=note, args=(f"kind{n}",)) for n in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [event.id for event in published] == list(range(1, 82))


def test_blobs_are_what_was_put(store: Store) -> None:
    blobs = store.blobs
    digest = blobs.put(b"points")
    assert blobs.put(b"points") == digest
    large, size = blobs.put_pieces([b"a" * 1_000_000, memoryview(b"b" * 3_000_000)])
    assert size == 4_000_000
    assert blobs.put_pieces(iter([b"poi", b"nts"])) == (digest, 6)
    assert blobs.read(digest) == b"points"
    with blobs.open(large) as file:
        assert file.read() == b"a" * 1_000_000 + b"b" * 3_000_000
        assert file.seek(0) == 0
    assert set(blobs.digests()) == {digest, large}
    with blobs.scratch() as file:
        file.write(b"on its way")
    assert blobs.interrupted() == []
    assert blobs.damage(digest) is None
    for read in (blobs.read, blobs.open):
        with pytest.raises(NotFoundError, match="doctor"):
            read("0" * 64)
    assert blobs.damage("0" * 64) == "missing from the store"


def test_an_altered_blob_is_never_given_out(store: Store, settings: Settings) -> None:
    digest = store.blobs.put(b"points")
    alter(settings, digest, b"pointz")
    for read in (store.blobs.read, store.blobs.open):
        with pytest.raises(DamagedError, match="backup"):
            read(digest)
    assert store.blobs.damage(digest) == "altered since it was stored"


def test_only_old_blobs_are_removed(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    digest = store.blobs.put(b"points")
    store.blobs.remove([digest, "0" * 64])
    assert store.blobs.read(digest) == b"points"
    for module in (blob_folder, blob_bucket):
        monkeypatch.setattr(module, "YOUNG_S", -1.0)  # all are old
    store.blobs.remove([digest, "0" * 64])
    assert store.blobs.damage(digest) == "missing from the store"
    assert store.blobs.put(b"points") == digest
    assert store.blobs.damage(digest) is None


@pytest.mark.parametrize(
    ("search", "found"),
    [
        ("zelle", ["Zelle Ä 100 %"]),
        ("ä 100", ["Zelle Ä 100 %"]),
        ("100 %", ["Zelle Ä 100 %"]),
        ("0%", []),
        ("a_b", ["a_b"]),
        ("STRASSE", ["Straße 1"]),
        ("", ["a_b", "aXb", "Zelle Ä 100 %", "Straße 1"]),
    ],
)
def test_a_search_looks_into_names_whatever_their_case(store: Store, search: str, found: list[str]) -> None:
    with store.write() as db:
        for name in ("a_b", "aXb", "Zelle Ä 100 %", "Straße 1"):
            create_session(db, {**CELL, "name": name}, None)
    with store.read() as db:
        assert sorted(item["name"] for item in list_sessions(db, 50, None, search)["items"]) == sorted(found)


CELL_TO_KEEP = {
    "pose_convention": "fanuc",
    "sphere_diameter_mm": 40.0,
    "scanner": {"kind": "profile", "point_sigma_mm": 1.1e-20},
    "robot": {"brand": "Größe “1” 😀"},
}


def test_a_release_is_told_in_each_session_of_its_cell_by_id_or_name(
    store: Store, published: list[EventRow]
) -> None:
    told = [
        ("Line 7", {"id": "line-7"}),
        ("Line 7", {}),
        ("Line 8", {"id": "line-7"}),
        ("Line 7", {"id": "other"}),
    ]
    with store.write() as db:
        records = [{"name": name, "cell": {**CELL["cell"], **cell}} for name, cell in told]
        first, second, third, _ = (create_session(db, record, None).id for record in records)
    published.clear()
    with store.write() as db:
        add_release(db, first, {"cell": "line-7", "verdict": "pass"}, "Ada", "set up", [])
    assert {event.session_id for event in published} == {first, second, third}
    with store.read() as db:
        assert {session["id"] for session in cell_history(db, "line-7")["sessions"]} == {first, second, third}
        counts = {cell["id"]: (cell["sessions"], cell["released"] is not None) for cell in list_cells(db)}
    assert counts == {"line-7": (3, True), "other": (1, False)}


@pytest.mark.thorough
def test_sessions_come_back_field_for_field_and_in_pages(client: httpx.Client) -> None:
    ids = [make_session(client, name=f"page {n} “é” 😀", cell=CELL_TO_KEEP) for n in range(5)]
    first = client.get("/sessions", params={"limit": 3, "search": "PAGE"}).json()
    second = client.get("/sessions", params={"limit": 3, "search": "PAGE", "cursor": first["next"]}).json()
    assert [item["id"] for item in first["items"] + second["items"]] == ids[::-1]
    assert second["next"] is None
    answer = client.get(f"/sessions/{ids[0]}")
    assert answer.json()["name"] == "page 0 “é” 😀"
    assert answer.json()["cell"] == CELL_TO_KEEP
    patched = client.patch(
        f"/sessions/{ids[0]}", json={"name": "new"}, headers={"If-Match": answer.headers["ETag"]}
    )
    assert patched.status_code == 200
    late = client.patch(f"/sessions/{ids[0]}", json={"name": "x"}, headers={"If-Match": answer.headers["ETag"]})
    assert_problem(late, 412)
    assert client.delete(f"/sessions/{ids[0]}").status_code == 204
    assert_problem(client.get(f"/sessions/{ids[0]}"), 404)


def test_captures_keep_their_bytes_and_go_with_their_session(client: httpx.Client) -> None:
    session = make_session(client)
    rows = "".join(f"{x},{200 + x % 3}\n" for x in range(50)).encode()
    record = {"id": "p1", "step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0]}
    key = {"Idempotency-Key": "once"}
    first = upload(client, session, record, rows, headers=key)
    assert first.status_code == 201, first.text
    again = upload(client, session, record, rows, headers=key)
    assert again.headers["Idempotency-Replayed"] == "true"
    assert again.json() == first.json()
    assert_problem(upload(client, session, record, rows + b"\n"), 409, "p1")
    file = client.get(f"/sessions/{session}/captures/p1/files/p1.csv")
    assert file.content == rows
    assert file.headers["content-length"] == str(len(rows))
    page = client.get(f"/sessions/{session}/captures").json()
    assert [item["id"] for item in page["items"]] == ["p1"]
    assert client.patch(f"/sessions/{session}/captures/p1", json={"excluded": True}).json()["excluded"] is True
    assert client.delete(f"/sessions/{session}").status_code == 204
    assert_problem(client.get(f"/sessions/{session}/captures/p1"), 404)


@pytest.mark.thorough(keep=1)
def test_a_solve_its_archive_and_a_restart(
    start: Callable[..., AbstractContextManager[httpx.Client]], new_place: NewPlace, tmp_path: Path
) -> None:
    place = Settings(**new_place(tmp_path), port=0, warm_up=False)
    with serving(place) as client:
        session = simulated_session(client, captures=14)
        job = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
        assert wait_for(client, job, timeout_s=300)["status"] == "done"
        result = client.get(f"/sessions/{session}/results/tcp").json()
        assert (result["verdict"], result["stale"]) == ("pass", False)
        archive = client.get(f"/sessions/{session}/archive", params={"scene": False}).content
        made = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"})
        assert made.status_code == 201, made.text
    with serving(place) as client:
        for stored in (session, made.json()["id"]):
            assert client.get(f"/sessions/{stored}/results/tcp").json() == result
            again = client.get(f"/sessions/{stored}/archive", params={"scene": False})
            assert again.content == archive


def test_a_store_is_one_servers_alone(settings: Settings, tmp_path: Path) -> None:
    other = settings.model_copy(update={"data": tmp_path / "other"}) if settings.database_url else settings
    with serving(settings), pytest.raises(ConflictError, match="in use"):
        WorkbenchServer(other).run()


def test_what_cannot_be_a_store_is_said(settings: Settings, tmp_path: Path) -> None:
    def refused(**changes: Any) -> str:
        with pytest.raises(InputError) as error:
            WorkbenchServer(settings.model_copy(update=changes)).run()
        return str(error.value)

    assert "postgresql://" in refused(database_url="mysql://root@127.0.0.1/x")
    assert "address of a database" in refused(database_url="nonsense")
    assert "s3://" in refused(blobs="ftp://bucket")
    if settings.database_url:
        assert "does not exist" in refused(database_url=f"{settings.database_url}nowhere")
        assert "bucket" in refused(blobs="s3://nowhere")
        assert isinstance(Store(settings, print).blobs, BucketBlobs)
    else:
        settings.data.mkdir(exist_ok=True)
        (settings.data / "scancell.db").write_bytes(b"no database at all" * 100)
        assert "doctor" in refused()
