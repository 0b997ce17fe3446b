"""Solves in worker processes: their results, and how they end when something goes wrong."""

import os
import queue
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

import server.jobs.ends
import server.jobs.jobs
import server.jobs.worker
from server.jobs.pools import ProcessPool
from server.jobs.processes import ProcessEndedError
from server.jobs.worker import Message
from server.settings import Settings
from tests.server.live_server import assert_problem, make_session, simulated_session, wait_for
from tests.server.slow_work import killed_while_telling, long_result, slow_solve
from tests.server.test_events import listening


def test_a_simulated_session_is_solved_through_rest(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    job = client.post(f"/sessions/{session}/solve/tcp").json()
    assert job["status"] == "queued"
    assert job["stage"] == "tcp"
    ended = wait_for(client, job["id"])
    assert ended["status"] == "done", ended
    assert ended["progress"] == 1.0
    result = client.get(f"/sessions/{session}/results/tcp").json()
    assert result["verdict"] == "pass"
    assert result["stale"] is False
    # The method's cell: 0.25 mm RMS; four times that is beyond chance.
    assert [row[3] for row in result["tool0_from_laser"]][:3] == pytest.approx([35, -120, 140], abs=10)
    assert client.get(f"/sessions/{session}/results").json() == {"tcp": result}
    listed = client.get("/sessions", params={"limit": 1}).json()["items"][0]
    assert listed["verdicts"] == {"tcp": "pass"}
    guide = client.get(f"/sessions/{session}/guide").json()
    assert {step["step"]: step["status"] for step in guide["steps"]}["tcp"] == "done"
    export = client.get(f"/sessions/{session}/exports/json")
    assert export.headers["content-type"] == "application/json"
    assert export.json()["verdict"] == "pass"
    assert_problem(client.get(f"/sessions/{session}/exports/smoke-signals"), 422, "json")

    client.patch(f"/sessions/{session}/captures/p03", json={"excluded": True})
    assert client.get(f"/sessions/{session}/results/tcp").json()["stale"] is True
    guide = client.get(f"/sessions/{session}/guide").json()
    assert {step["step"]: step["status"] for step in guide["steps"]}["tcp"] == "stale"
    client.patch(f"/sessions/{session}/captures/p03", json={"excluded": None})
    assert client.get(f"/sessions/{session}/results/tcp").json()["stale"] is False


def test_a_job_is_followed_to_its_end(client: httpx.Client) -> None:
    session = simulated_session(client, captures=14)
    key = {"Idempotency-Key": "solve-1"}
    job = client.post(f"/sessions/{session}/solve/tcp", headers=key).json()
    assert client.post(f"/sessions/{session}/solve/tcp", headers=key).json() == job
    with listening(client, f"/jobs/{job['id']}/events") as events:
        seen = [event["data"] for event in events]  # ends by itself
    assert [data["id"] for data in seen] == [job["id"]] * len(seen)
    assert seen[0]["status"] == "queued"
    assert seen[-1]["status"] == "done"
    progress = [data["progress"] for data in seen]
    assert progress == sorted(progress)
    assert_problem(client.post(f"/jobs/{job['id']}/cancel"), 409, "done")
    with listening(client, f"/sessions/{session}/events", after=15) as events:
        kinds = [next(events)["event"] for _ in range(len(seen) + 1)]
    assert kinds == ["job"] * len(seen) + ["result"]


def test_a_solve_that_cannot_be_says_what_is_missing(client: httpx.Client) -> None:
    session = simulated_session(client, captures=2)
    job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
    assert job["status"] == "failed"
    assert job["error"]["status"] == 422
    assert job["error"]["detail"].endswith(job["error"]["to_do"])
    assert_problem(client.get(f"/sessions/{session}/results/tcp"), 404, "solve/tcp")
    assert_problem(client.post(f"/sessions/{session}/solve/teapot"), 422, "tcp", "teapot")
    assert_problem(client.post("/sessions/none/solve/tcp"), 404, "none")
    assert_problem(client.get("/jobs/none"), 404, "none")
    assert_problem(client.get("/jobs/none/events"), 404, "none")
    assert_problem(client.post("/jobs/none/cancel"), 404, "none")


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Workers that take a minute over each solve."""
    monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)


def wait_until_it_runs(client: httpx.Client, job: str) -> int:
    end_s = time.monotonic() + 300
    while time.monotonic() < end_s:
        answer = client.get(f"/jobs/{job}").json()
        if answer["message"].startswith("worker "):
            assert (answer["status"], answer["progress"]) == ("running", 0.25)
            return int(answer["message"].split()[1])
        time.sleep(0.02)
    raise AssertionError(f"the job does not run: {answer}")


@pytest.mark.usefixtures("slow")
def test_jobs_are_cancelled_while_they_run_and_while_they_wait(start: Callable[..., Any]) -> None:
    with start() as client:
        session = make_session(client)
        running, waiting, next_one = (client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(3))
        worker = wait_until_it_runs(client, running)
        for job in (waiting, running, running):
            assert client.post(f"/jobs/{job}/cancel").json()["status"] == "cancelled"
        assert wait_until_it_runs(client, next_one) != worker
        assert client.get(f"/jobs/{running}").json()["status"] == "cancelled"
        client.delete(f"/sessions/{session}")  # ends its job too: the next session's runs at once
        other = client.post(f"/sessions/{make_session(client)}/solve/tcp").json()["id"]
        wait_until_it_runs(client, other)


@pytest.mark.usefixtures("slow")
def test_a_job_whose_worker_is_killed_begins_anew_and_after_too_many_says_so(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (server.jobs.jobs, server.jobs.ends):
        monkeypatch.setattr(module, "MOST_ATTEMPTS", 3)
    with start() as client:
        session = make_session(client)
        killed, waiting = (client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(2))
        first = wait_until_it_runs(client, killed)
        os.kill(first, signal.SIGKILL)
        assert wait_until_it_runs(client, waiting) != first  # it does not wait meanwhile
        client.post(f"/jobs/{waiting}/cancel")
        second = wait_until_it_runs(client, killed)
        assert second != first
        begun_s = time.monotonic()
        os.kill(second, signal.SIGKILL)
        os.kill(until_elsewhere(client, killed, second), signal.SIGKILL)
        assert time.monotonic() - begun_s >= 2.0  # each pause is longer
        job = wait_for(client, killed)
        assert job["status"] == "failed"
        assert "ended unexpectedly" in job["error"]["detail"]
        assert "attempt 3 of 3" in job["error"]["detail"]
        assert job["error"]["status"] == 503
        assert "more memory" in job["error"]["to_do"]


def test_a_job_whose_worker_was_killed_is_done_by_itself(
    start: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = server.jobs.worker.solve
    monkeypatch.setattr(server.jobs.worker, "solve", slow_solve)
    with start() as client:
        job = client.post(f"/sessions/{simulated_session(client, captures=14)}/solve/tcp").json()["id"]
        worker = wait_until_it_runs(client, job)
        monkeypatch.setattr(server.jobs.worker, "solve", solve)
        os.kill(worker, signal.SIGKILL)
        assert wait_for(client, job)["status"] == "done"


def until_elsewhere(client: httpx.Client, job: str, before: int) -> int:
    """Wait until a job runs in another process than before, and return that."""
    end_s = time.monotonic() + 300
    while (place := wait_until_it_runs(client, job)) == before:
        assert time.monotonic() < end_s
        time.sleep(0.1)
    return place


@pytest.mark.thorough
@pytest.mark.usefixtures("slow")
def test_a_job_that_takes_too_long_is_ended(start: Callable[..., Any]) -> None:
    with start(job_timeout_s=0.5) as client:
        session = make_session(client)
        job = wait_for(client, client.post(f"/sessions/{session}/solve/tcp").json()["id"])
        assert job["status"] == "failed"
        assert "0.5 s" in job["error"]["detail"]


def require_gone(process: int) -> None:
    """Assert that a process has ended, or does so within seconds (its parent may still have to take note)."""
    end_s = time.monotonic() + 300
    status = Path(f"/proc/{process}/stat")
    while status.exists() and status.read_text().rpartition(")")[2].split()[0] != "Z":
        assert time.monotonic() < end_s
        time.sleep(0.05)


@pytest.mark.usefixtures("slow")
def test_a_restart_says_which_jobs_it_ended(start: Callable[..., Any]) -> None:
    with start() as client:
        session = make_session(client)
        running, waiting = (client.post(f"/sessions/{session}/solve/tcp").json()["id"] for _ in range(2))
        worker = wait_until_it_runs(client, running)
    require_gone(worker)
    with start() as client:
        for job_id in (running, waiting):
            job = client.get(f"/jobs/{job_id}").json()
            assert job["status"] == "failed"
            assert job["error"]["detail"].count("restarted") + job["error"]["detail"].count("stopped") == 1
            assert job["error"]["to_do"] == "Run it again."


@pytest.fixture
def pool(tmp_path: Path) -> Iterator[ProcessPool]:
    processes = ProcessPool(Settings(data=tmp_path, workers=1, warm_up=False), lambda _message: None)
    yield processes
    processes.close()


def only_worker(pool: ProcessPool) -> int:
    (place,) = pool._processes.pids
    return place


@pytest.mark.parametrize("after_s", [0.01, 0.03, 0.09])
def test_a_worker_killed_while_it_sends_a_long_result_ends_its_job_alone(
    pool: ProcessPool, tmp_path: Path, after_s: float
) -> None:
    """Half a message in a pipe that all share kept job, pool and server waiting for ever."""
    work: Any = partial(long_result, tmp_path / "began", 64_000_000)
    job = pool.submit(work)
    end_s = time.monotonic() + 300
    while not (tmp_path / "began").exists():
        assert time.monotonic() < end_s
        time.sleep(0.001)
    time.sleep(after_s)
    pool.end_worker(only_worker(pool))
    wait([job], timeout=300)
    assert job.done()
    other: Any = os.getpid
    assert pool.submit(other).result(timeout=300) != os.getpid()


@pytest.mark.parametrize("told", [b"", b"\0\0\1\0half"])
def test_a_worker_killed_while_it_tells_of_its_job_leaves_nothing_waiting(pool: ProcessPool, told: bytes) -> None:
    work: Any = partial(killed_while_telling, told)
    with pytest.raises(ProcessEndedError):
        pool.submit(work).result(timeout=300)
    other: Any = os.getpid
    assert pool.submit(other).result(timeout=300) != os.getpid()


def test_a_worker_that_ends_takes_no_other_job_along(tmp_path: Path) -> None:
    told: queue.SimpleQueue[Message] = queue.SimpleQueue()
    pool = ProcessPool(Settings(data=tmp_path, workers=1, warm_up=False), told.put)
    work: list[Any] = [partial(slow_solve, "job"), partial(abs, -3), partial(abs, -3)]
    jobs: list[Any] = [pool.submit(one) for one in work]
    assert jobs[-1].cancel()
    pool.end_worker(told.get(timeout=300).value)
    with pytest.raises(ProcessEndedError):
        jobs[0].result(timeout=300)
    assert jobs[1].result(timeout=300) == 3
    assert jobs[2].cancelled()
    pool.close()


def test_a_worker_killed_while_it_waits_costs_no_job(pool: ProcessPool) -> None:
    work: Any = os.getpid
    place: Any = pool.submit(work).result(timeout=300)
    os.kill(place, signal.SIGKILL)
    assert pool.submit(work).result(timeout=300) != place
