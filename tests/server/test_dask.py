"""Jobs on a Dask cluster of several processes: the same work, and the same ends."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import server.jobs.ends
import server.jobs.jobs
import server.jobs.worker
from calib_core.errors import InputError
from server.jobs.measuring_processes import Measuring
from server.settings import Settings
from server.store.blob_places import open_blobs
from tests.server.forked_commands import fork_from_one
from tests.server.live_server import make_session, simulated_session, wait_for
from tests.server.slow_work import slow_solve
from tests.server.test_batches import one, send, wait_until_measured
from tests.server.test_captures import arc_csv
from tests.server.test_jobs import until_elsewhere, wait_until_it_runs
from tests.vase import vase_session

pytestmark = pytest.mark.filterwarnings("ignore")  # of the cluster's own parts, when it ends


@pytest.fixture(scope="module")
def local() -> Iterator[Any]:
    import dask.config  # a second, for these tests alone
    from distributed import LocalCluster

    fork_from_one()
    dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"})
    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        host="127.0.0.1",
        protocol="tcp://",
    ) as local:
        yield local


@pytest.fixture(scope="module")
def cluster(local: Any) -> str:
    return local.scheduler_address


@pytest.mark.thorough
def test_a_session_is_solved_by_the_cluster(start: Callable[..., Any], cluster: str) -> None:
    with start(dask=cluster) as client:
        session = simulated_session(client, captures=14)
        jobs = [client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(2)]
        for job in jobs:
            ended = wait_for(client, job)
            assert (ended["status"], ended["progress"]) == ("done", 1.0), ended
        result = client.get(f"/sessions/{session}/results/tcp").json()
        assert result["verdict"] == "pass"
        short = simulated_session(client, captures=2)
        failed = wait_for(client, client.post(f"/sessions/{short}/solve/tcp").json()["id"])
        assert failed["status"] == "failed"
        assert failed["error"]["status"] == 422  # the solver's own words


@pytest.mark.thorough
def test_captures_of_a_batch_are_measured_by_the_cluster(
    start: Callable[..., Any], cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Measuring, "measure", None)  # not here
    with start(dask=cluster) as client:
        session = make_session(client)
        names = [f"p{number:02d}" for number in range(20)]
        contents = [b"# %d\n" % number + (arc_csv() if number % 4 else b"0,0\n1,1\n") for number in range(20)]
        body = b"".join(one(name, content) for name, content in zip(names, contents, strict=True))
        assert send(client, session, body).json()["stored"] == 20
        listed = wait_until_measured(client, session)
        assert [item["id"] for item in listed] == names
        assert [item["measured"]["verdict"] for item in listed] == ["fail", "pass", "pass", "pass"] * 5
        assert listed[1]["measured"]["radius_mm"] == pytest.approx(15.0, abs=0.05)


@pytest.mark.thorough
@pytest.mark.parametrize("memory_mb", [1000.0, 1.0])
def test_a_merge_goes_over_the_workers_and_is_the_same_byte_for_byte(
    tmp_path: Path, cluster: str, memory_mb: float
) -> None:
    from server.jobs.dask_pool import DaskPool

    settings = Settings(data=tmp_path, dask=cluster)
    record, files = vase_session(5, 60)
    record["cell"]["merge"]["memory_mb"] = memory_mb
    record["captures"][3]["table_deg"] = record["captures"][2]["table_deg"]
    blobs = open_blobs(settings.blob_place)
    digests = {name: blobs.put(content) for name, content in files.items()}
    work = partial(server.jobs.worker.solve, "job", record, "merge", digests, {})
    server.jobs.worker.begin(settings, 0, lambda _: None)
    here = work()
    pool = DaskPool(settings, lambda _: None)
    try:
        there = pool.submit(work).result(timeout=300)
    finally:
        pool.close()
    assert there.result == here.result
    assert there.outputs == here.outputs
    assert (here.result["spills"] > 0) == (memory_mb < 10)


@pytest.mark.thorough
def test_jobs_on_the_cluster_are_cancelled_and_begin_anew_when_their_worker_is_killed(
    start: Callable[..., Any], cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = server.jobs.worker.solve
    for module in (server.jobs.jobs, server.jobs.ends):
        monkeypatch.setattr(module, "MOST_ATTEMPTS", 2)
    monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)
    with start(dask=cluster) as client:
        session = make_session(client)
        first, second, waiting = (client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(3))
        cancelled = wait_until_it_runs(client, first)
        killed = wait_until_it_runs(client, second)
        for job in (waiting, first):
            assert client.post(f"/jobs/{job}/cancel").json()["status"] == "cancelled"
        assert_gone(cancelled)
        os.kill(killed, signal.SIGKILL)
        os.kill(until_elsewhere(client, second, killed), signal.SIGKILL)
        job = wait_for(client, second)
        assert job["status"] == "failed"
        assert "ended unexpectedly" in job["error"]["detail"]
        assert job["error"]["status"] == 503
        assert "attempt 2 of 2" in job["error"]["detail"]
        assert client.get(f"/jobs/{first}").json()["status"] == "cancelled"

        monkeypatch.setattr(server.jobs.worker, "solve", solve)
        simulated = simulated_session(client, captures=14)
        again = wait_for(client, client.post(f"/sessions/{simulated}/solve/tcp").json()["id"])
        assert again["status"] == "done", again

        monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)
        last = client.post(f"/sessions/{session}/solve/tcp").json()["id"]
        worker = wait_until_it_runs(client, last)
    assert_gone(worker)
    with start(dask=cluster) as client:
        stopped = client.get(f"/jobs/{last}").json()
        assert (stopped["status"], stopped["error"]["to_do"]) == ("failed", "Run it again.")


@pytest.mark.thorough(keep=1)
def test_a_job_that_the_cluster_itself_gives_up_is_done_all_the_same(
    start: Callable[..., Any], local: Any, cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cluster's client says so in its own thread, which cannot wait for an answer of the cluster."""
    solve = server.jobs.worker.solve
    monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)
    monkeypatch.setattr(local.scheduler, "allowed_failures", 0)
    with start(dask=cluster) as client:
        job = client.post(f"/sessions/{simulated_session(client, captures=14)}/solve/tcp").json()["id"]
        killed = wait_until_it_runs(client, job)
        monkeypatch.setattr(server.jobs.worker, "solve", solve)
        os.kill(killed, signal.SIGKILL)
        ended = wait_for(client, job)
        assert ended["status"] == "done", ended


def assert_gone(process: int) -> None:
    end_s = time.monotonic() + 300
    while time.monotonic() < end_s:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return
        time.sleep(0.05)
    raise AssertionError("the worker goes on")


@pytest.mark.thorough
def test_without_its_cluster_the_server_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from server.jobs.dask_pool import DaskPool

    monkeypatch.setattr("server.jobs.dask_pool._CONNECT_S", 0.5)
    with pytest.raises(InputError, match="SCANCELL_DASK"):
        DaskPool(Settings(dask="tcp://127.0.0.1:9"), print)
    with pytest.raises(InputError, match="SCANCELL_DASK"):
        DaskPool(Settings(dask="nonsense"), print)
