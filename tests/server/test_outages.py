"""Outages: what the server rests on goes away and comes back; nothing acknowledged is lost, nothing is a 500."""

import fcntl
import termios
import time
from array import array
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from sqlalchemy import text

from calib_core.errors import InputError
from server.settings import Settings
from server.store import blob_bucket
from server.store.database import Store
from server.store.engine import engine_of
from server.store.store_lock import store_lock
from tests.server.live_server import make_session, serving, simulated_session, upload, wait_for
from tests.server.outages import HEALED_S, gated, start_scheduler, start_worker, until_health, until_there
from tests.server.postgres import lasting_port, new_database, running_postgres
from tests.server.s3 import running_s3, s3_client
from tests.server.test_captures import arc_csv, record
from tests.server.test_operation import serve


@pytest.fixture(scope="module")
def postgres() -> Iterator[str]:
    with running_postgres() as address:
        yield address


@pytest.fixture
def place(postgres: str, tmp_path: Path) -> dict[str, Any]:
    name = f"outage{abs(hash(tmp_path)) % 10**9}"
    return {"data": tmp_path / "data", "database_url": new_database(postgres, name), "port": 0, "warm_up": False}


@pytest.mark.thorough
def test_a_database_that_goes_away_and_comes_back(place: dict[str, Any]) -> None:
    address = place["database_url"]
    with gated(address.partition("@")[2].partition("/")[0]) as gate:
        through = f"postgresql://scancell@127.0.0.1:{gate.port}/{address.rpartition('/')[2]}"
        with serving(Settings(**{**place, "database_url": through})) as client:
            session = make_session(client)
            assert upload(client, session, record(), arc_csv()).status_code == 201
            gate.shut()
            for answer in (
                client.get(f"/sessions/{session}"),
                upload(client, session, {**record(), "id": "p02", "files": ["2.csv"]}, arc_csv()),
            ):
                assert answer.status_code == 503, answer.text
                assert answer.headers["content-type"] == "application/problem+json"
            until_health(client, "degraded", "database")
            site = str(client.base_url).removesuffix("/api/v1/")
            assert client.get(f"{site}/health").status_code == 503
            gate.open()
            until_health(client, "ready")
            assert (
                upload(client, session, {**record(), "id": "p03", "files": ["3.csv"]}, arc_csv()).status_code
                == 201
            )
            assert [c["id"] for c in client.get(f"/sessions/{session}/captures").json()["items"]] == ["p01", "p03"]


@pytest.mark.thorough
def test_a_database_that_hangs_is_seen_and_serves_again(place: dict[str, Any]) -> None:
    """It takes connections and questions, and answers none: no call fails, so that only time tells."""
    address = place["database_url"]
    with gated(address.partition("@")[2].partition("/")[0]) as gate:
        through = f"postgresql://scancell@127.0.0.1:{gate.port}/{address.rpartition('/')[2]}"
        with serving(Settings(**{**place, "database_url": through})) as client:
            session = make_session(client)
            gate.hang()
            assert until_health(client, "degraded")["reasons"].keys() & {"database", "lock"}
            assert client.get(str(client.base_url).removesuffix("/api/v1/") + "/health/alive").text == "alive"
            gate.open()
            until_health(client, "ready")
            assert upload(client, session, record(), arc_csv()).status_code == 201


@pytest.mark.thorough
def test_of_two_servers_only_one_ever_writes(place: dict[str, Any], tmp_path: Path) -> None:
    """The first loses its connections without noticing at once; the second has taken over meanwhile."""
    first = Settings(**place)
    second = Settings(**{**place, "data": tmp_path / "other"})
    with serving(first) as client:
        make_session(client)
        engine = engine_of(place["database_url"])
        with engine.connect() as connection:
            # What a restart of the database does to a server's connections, the lock's among them.
            kill = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database()"
            connection.execute(text(f"{kill} AND pid <> pg_backend_pid()"))
        engine.dispose()
        with store_lock(second) as lock:
            assert lock is not None
            refused = client.post("/sessions", json={"cell": {"pose_convention": "abb"}})
            assert refused.status_code == 503, refused.text
            assert "taken over" in refused.json()["detail"]
            store = Store(second, lambda _: None, lock.require)
            with store.write() as db:
                db.execute(text("SELECT 1"))
            store.close()
            assert "lock" in until_health(client, "degraded")["reasons"]
        until_health(client, "ready")
        assert client.post("/sessions", json={"cell": {"pose_convention": "abb"}}).status_code == 201


@pytest.mark.thorough
def test_a_bucket_that_goes_away_and_comes_back(tmp_path: Path) -> None:
    with running_s3() as s3, gated(s3.removeprefix("http://")) as gate:
        s3_client(s3).create_bucket(Bucket="outage")
        place = {"data": tmp_path, "port": 0, "warm_up": False, "blobs": "s3://outage"}
        with serving(Settings(**place, s3_endpoint=f"http://127.0.0.1:{gate.port}")) as client:
            session = make_session(client)
            assert upload(client, session, record(), arc_csv()).status_code == 201
            gate.shut()
            refused = upload(client, session, {**record(), "id": "p02", "files": ["2.csv"]}, arc_csv() + b"\n")
            assert refused.status_code == 503, refused.text
            assert "S3" in refused.json()["detail"]
            assert "files" in until_health(client, "degraded")["reasons"]
            gate.open()
            until_health(client, "ready")
            there = {**record(), "id": "p02", "files": ["2.csv"]}
            assert upload(client, session, there, arc_csv() + b"\n").status_code == 201
            for capture, name in (("p01", "captures/p01.csv"), ("p02", "2.csv")):
                kept = client.get(f"/sessions/{session}/captures/{capture}")
                name = kept.json()["files"][0]
                assert client.get(f"/sessions/{session}/captures/{capture}/files/{name}").content.startswith(
                    arc_csv()
                )


@pytest.mark.thorough
@pytest.mark.parametrize("how", ["refuse", "hang"])
def test_a_solve_waits_for_a_bucket_and_is_done_by_itself(
    tmp_path: Path, how: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blob_bucket, "_TIMEOUT_S", 2)
    with running_s3() as s3, gated(s3.removeprefix("http://")) as gate:
        s3_client(s3).create_bucket(Bucket="outage")
        place = {"data": tmp_path, "port": 0, "warm_up": False, "blobs": "s3://outage"}
        with serving(Settings(**place, s3_endpoint=f"http://127.0.0.1:{gate.port}")) as client:
            other, session = make_session(client), simulated_session(client, captures=14)
            getattr(gate, how)()
            until_health(client, "degraded", "files")
            asked = client.post(f"/sessions/{session}/solve/tcp")
            assert asked.status_code == 202, asked.text
            until_waiting(client, asked.json()["id"], "S3")
            refused = upload(client, other, record(), arc_csv())
            assert (refused.status_code, refused.json()["type"]) == (503, "urn:scancell:problem:unavailable")
            assert int(refused.headers["retry-after"]) > 0
            gate.open()
            done = wait_for(client, asked.json()["id"])
            assert (done["status"], done["error"]) == ("done", None)
            assert client.get(f"/sessions/{session}/results/tcp").json()["verdict"] == "pass"


def until_waiting(client: httpx.Client, job: str, said: str) -> None:
    end_s = time.monotonic() + HEALED_S
    while not (
        (found := client.get(f"/jobs/{job}").json())["status"] == "queued"
        and found["message"].startswith("waits")
        and said in found["message"]
    ):
        assert found["status"] in ("queued", "running"), found
        assert time.monotonic() < end_s, found
        time.sleep(0.1)


@pytest.mark.thorough
def test_what_a_job_found_is_stored_once_the_database_is_back(place: dict[str, Any]) -> None:
    address = place["database_url"]
    with gated(address.partition("@")[2].partition("/")[0]) as gate:
        through = f"postgresql://scancell@127.0.0.1:{gate.port}/{address.rpartition('/')[2]}"
        with serving(Settings(**{**place, "database_url": through})) as client:
            session = simulated_session(client, captures=14)
            jobs = [client.post(f"/sessions/{session}/solve/{stage}").json()["id"] for stage in ("tcp", "all")]
            gate.shut()
            time.sleep(5)  # they are solved meanwhile, as far as they can
            gate.open()
            until_health(client, "ready")
            assert [wait_for(client, job)["status"] for job in jobs] == ["done", "done"]


@pytest.mark.parametrize("lacking", [{"database_url": "postgresql://x@127.0.0.1:1/y"}, {"blobs": "s3://nowhere"}])
def test_a_start_without_database_or_bucket_is_refused_in_words(lacking: dict[str, str], tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, s3_endpoint="http://127.0.0.1:1", **lacking)  # type: ignore[arg-type]
    with pytest.raises(InputError) as refused, store_lock(settings):
        pass
    assert refused.value.to_do


@pytest.mark.thorough
def test_a_scheduler_that_is_restarted(start: Callable[..., Any]) -> None:
    port = lasting_port()
    scheduler = start_scheduler(port)
    address = f"tcp://127.0.0.1:{port}"
    worker = start_worker(address)
    try:
        until_there(port)
        with start(dask=address) as client:
            session = simulated_session(client, captures=14)
            assert _solved(client, session)["status"] == "done"
            for process in (scheduler, worker):
                process.kill()
                process.join()
            assert "Dask" in until_health(client, "degraded")["reasons"]["jobs"]
            asked = client.post(f"/sessions/{session}/solve/tcp")
            assert asked.status_code == 202, asked.text
            until_waiting(client, asked.json()["id"], "Dask")
            scheduler = start_scheduler(port)
            worker = start_worker(address)
            until_health(client, "ready")
            assert wait_for(client, asked.json()["id"])["status"] == "done"
    finally:
        for process in (scheduler, worker):
            process.kill()
            process.join()


@pytest.mark.thorough
def test_a_job_that_waits_long_for_workers_of_a_cluster_is_solved_here(start: Callable[..., Any]) -> None:
    port = lasting_port()
    scheduler = start_scheduler(port)
    try:
        until_there(port)
        with start(dask=f"tcp://127.0.0.1:{port}", cluster_patience_s=1) as client:
            session = simulated_session(client, captures=14)
            assert _solved(client, session)["status"] == "done"  # it has no worker
            scheduler.kill()
            scheduler.join()
            until_health(client, "degraded", "jobs")
            assert _solved(client, session)["status"] == "done"  # it is gone
    finally:
        scheduler.kill()
        scheduler.join()


def _solved(client: httpx.Client, session: str) -> dict[str, Any]:
    return wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])


@pytest.mark.thorough
def test_a_reader_of_the_log_that_hangs_holds_up_nobody(tmp_path: Path) -> None:
    process, address = serve(tmp_path / "data", SCANCELL_RATE_PER_S="100000", SCANCELL_RATE_BURST="100000")
    assert process.stderr is not None
    fcntl.fcntl(process.stderr, fcntl.F_SETPIPE_SZ, 4096)  # some 20 of its lines, which nobody reads
    try:
        with httpx.Client(base_url=f"{address}/api/v1", timeout=20, trust_env=False) as client:
            for _ in range(100):
                assert client.get("/me").status_code == 200
        held = array("i", [0])
        fcntl.ioctl(process.stderr, termios.FIONREAD, held)
        assert held[0] > 3500  # it was full, and no line had room any more
    finally:
        process.kill()
        process.communicate()
