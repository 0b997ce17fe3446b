"""What the server rests on goes away under load and comes back: what was lost, who wrote, how soon all is well."""

import fcntl
import os
import signal
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from harness import Row
from kill_load import CELL, Sent, send
from kill_server import ServerProcess
from sqlalchemy import text

from calib_core.errors import ConflictError
from server.settings import Settings
from server.store.engine import engine_of
from server.store.store_lock import store_lock
from tests.server.live_server import simulated_session
from tests.server.outages import gated, start_scheduler, start_worker, until_there
from tests.server.postgres import lasting_port, new_database, restartable_postgres
from tests.server.s3 import running_s3, s3_client

_UPLOADERS = 3
_AWAY_S = (0.2, 2.5)  # the server looks every two seconds what is there
_HEALED_S = 10.0


@dataclass
class Found:
    """What came of the outages of one kind."""

    outages: int = 0
    sent: list[Sent] = field(default_factory=list[Sent])
    refused: int = 0
    jobs: list[str] = field(default_factory=list[str])
    wrong: list[str] = field(default_factory=list[str])
    lost: list[str] = field(default_factory=list[str])
    done: int = 0
    by_two: int = 0
    healed_s: list[float] = field(default_factory=list[float])


@dataclass
class Part:
    """Something that goes away: the server's settings with it, how it goes, and how it comes back."""

    environment: dict[str, str]
    away: Callable[[], None]
    back: Callable[[], None]
    solves: bool = False
    by_two: Callable[[], int] = int
    log: int | None = None


def run(full: bool) -> Iterator[Row]:
    """Yield a figure a kind; ten outages of each kind with `full`, else two."""
    for name in PARTS:
        yield row(name, 10 if full else 2)


def row(name: str, times: int) -> Row:
    """Return the figure of one kind of outage."""
    with tempfile.TemporaryDirectory(prefix="scancell-outages-") as folder:
        found = outages(name, Path(folder), times, seed=17)
    for line in [*found.lost, *found.wrong][:10]:
        print(f"    {line}", flush=True)
    done = [sent for sent in found.sent if sent.answer is not None]
    healed_s, worst_s = float(np.median(found.healed_s)), max(found.healed_s)
    lost, wrong = len(found.lost), len(found.wrong) + len(found.jobs) - found.done
    measured = f"{lost} of {len(done)}, {found.by_two}, {wrong} of {found.done}; {healed_s:.1f}, {worst_s:.1f} s"
    return Row(
        f"{name}, {found.outages} ×: lost, doubled, unsolved; back",
        f"none; ≤ {_HEALED_S:g} s",
        measured,
        not (lost or found.by_two or wrong) and worst_s <= _HEALED_S,
    )


def outages(name: str, folder: Path, times: int, seed: int) -> Found:
    """Let a part go away and come back under load, and look at all that was acknowledged."""
    random = np.random.default_rng(seed)
    found = Found()
    with PARTS[name](folder) as part:
        quick = {"SCANCELL_RATE_PER_S": "10000", "SCANCELL_RATE_BURST": "10000"}
        server = ServerProcess(folder / "data", {**part.environment, **quick}, forked=True, log=part.log).wait()
        try:
            with server.client() as client, _load(server, client, found, part.solves):
                for _ in range(times):
                    time.sleep(random.uniform(0.2, 1.0))
                    part.away()
                    time.sleep(random.uniform(*_AWAY_S))
                    found.by_two += part.by_two()
                    part.back()
                    found.healed_s.append(_healed_s(client))
                    found.outages += 1
            with server.client() as client:
                _look(client, found)
        finally:
            server.kill()
    return found


def _healed_s(client: httpx.Client) -> float:
    """Return how long it takes until the server says that all is well, and stores something."""
    begun_s = time.monotonic()
    while True:
        with suppress(httpx.TransportError):
            well = client.get("/health").json()["status"] == "ready"
            if well and client.post("/sessions", json={"name": "after", "cell": CELL}).status_code == 201:
                return time.monotonic() - begun_s
        assert time.monotonic() - begun_s < 300, client.get("/health").text
        time.sleep(0.05)


@contextmanager
def _load(server: ServerProcess, client: httpx.Client, found: Found, solves: bool) -> Iterator[None]:
    """Upload (and solve) until told to stop; who is refused sends the same again, as programs do."""
    stop = threading.Event()
    sessions = [
        client.post("/sessions", json={"name": "load", "cell": CELL}).json()["id"] for _ in range(_UPLOADERS)
    ]
    work: list[Callable[[httpx.Client], None]] = [partial(_upload, found, session, stop) for session in sessions]
    if solves:
        solvable = simulated_session(client, captures=14)
        work.append(partial(_solve, found, solvable, stop))
    threads = [threading.Thread(target=_with_client, args=(server, job)) for job in work]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        stop.set()
        for thread in threads:
            thread.join()


def _with_client(server: ServerProcess, work: Callable[[httpx.Client], None]) -> None:
    with server.client() as client:
        work(client)


def _upload(found: Found, session: str, stop: threading.Event, client: httpx.Client) -> None:
    number = 0
    while not stop.is_set():
        number += 1
        sent = Sent(f"{session}-{number}", session, f"p{number}", f"# {session}\n".encode() + arc(number))
        found.sent.append(sent)
        while not stop.is_set():
            answer = _tried(found, lambda sent=sent: send(client, sent))
            if answer is not None and answer.status_code == 201:
                sent.answer = answer.json()
                break
            time.sleep(0.1)


def arc(number: int) -> bytes:
    x = np.linspace(-12.0, 12.0, 60)
    z = 200.0 - np.sqrt(20.0**2 - x**2) + 1e-4 * number
    return "".join(f"{a:.4f},{b:.4f}\n" for a, b in zip(x, z, strict=True)).encode()


def _solve(found: Found, session: str, stop: threading.Event, client: httpx.Client) -> None:
    while not stop.is_set():
        answer = _tried(found, lambda: client.post(f"/sessions/{session}/solve/tcp"))
        if answer is not None and answer.status_code == 202:
            found.jobs.append(answer.json()["id"])
        time.sleep(1.0)


def _tried(found: Found, ask: Callable[[], httpx.Response]) -> httpx.Response | None:
    """Return an answer, None where none came; what is neither done nor refused as an outage is wrong."""
    try:
        answer = ask()
    except httpx.TransportError:
        found.refused += 1
        return None
    if answer.status_code == 503:
        found.refused += 1
    elif answer.status_code >= 400:
        found.wrong.append(f"{answer.status_code} {answer.text[:300]}")
    return answer


def _look(client: httpx.Client, found: Found) -> None:
    for sent in found.sent:
        if sent.answer is None:
            continue
        place = f"/sessions/{sent.session}/captures/{sent.capture}"
        answer = client.get(place)
        same = answer.status_code == 200 and answer.json() == sent.answer
        if not same or client.get(f"{place}/files/{answer.json()['files'][0]}").content != sent.content:
            found.lost.append(f"{sent.session}/{sent.capture}: {answer.status_code} {answer.text[:200]}")
    end_s = time.monotonic() + 300
    for job in found.jobs:
        while (ended := client.get(f"/jobs/{job}").json())["status"] in ("queued", "running"):
            if time.monotonic() > end_s:
                break
            time.sleep(0.1)
        found.done += ended["status"] == "done"
        if ended["status"] != "done":
            found.wrong.append(f"job {job}: {ended}")


@contextmanager
def _database(folder: Path) -> Iterator[Part]:
    """PostgreSQL crashes, or is restarted, by turns."""
    with restartable_postgres() as postgres:
        environment = {"SCANCELL_DATABASE_URL": new_database(postgres.address, "outages")}
        signals = iter([signal.SIGINT, signal.SIGQUIT] * 1000)
        yield Part(environment, lambda: postgres.end(next(signals)), postgres.start, solves=True)


@contextmanager
def _lock(folder: Path) -> Iterator[Part]:
    """All connections are cut, and another server takes the lock while it can."""
    with restartable_postgres() as postgres:
        address = new_database(postgres.address, "outages")
        other = Settings(data=folder / "other", database_url=address)
        engine = engine_of(address)
        taken: list[Any] = []
        counted = 0

        def rows_now() -> int:
            with engine.connect() as connection:
                return int(connection.execute(text("SELECT count(*) FROM captures")).scalar_one())

        def away() -> None:
            nonlocal counted
            with engine.connect() as connection:
                kill = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE datname = current_database()"
                connection.execute(text(f"{kill} AND pid <> pg_backend_pid()"))
            lock = store_lock(other)
            with suppress(ConflictError):  # the first was quicker to take it again
                lock.__enter__()
                taken.append(lock)
            counted = rows_now()

        def by_two() -> int:
            return rows_now() - counted if taken else 0

        def back() -> None:
            while taken:
                taken.pop().__exit__(None, None, None)

        yield Part({"SCANCELL_DATABASE_URL": address}, away, back, by_two=by_two)
        engine.dispose()


@contextmanager
def _bucket(how: str, folder: Path) -> Iterator[Part]:
    """The way to the S3 store is cut, hangs, or answers 503."""
    with running_s3() as s3, gated(s3.removeprefix("http://")) as gate:
        s3_client(s3).create_bucket(Bucket="outages")
        endpoint = f"http://127.0.0.1:{gate.port}"
        yield Part(
            {"SCANCELL_BLOBS": "s3://outages", "SCANCELL_S3_ENDPOINT": endpoint},
            getattr(gate, how),
            gate.open,
            solves=True,
        )


@contextmanager
def _scheduler(folder: Path) -> Iterator[Part]:
    """Dask's scheduler and its worker are killed, and started again."""
    port = lasting_port()
    address = f"tcp://127.0.0.1:{port}"
    running: list[Any] = []

    def start() -> None:
        running.append(start_scheduler(port))
        until_there(port, running[-1])
        running.append(start_worker(address))

    def kill() -> None:
        while running:
            process = running.pop()
            process.kill()
            process.join()

    start()
    try:
        yield Part({"SCANCELL_DASK": address}, kill, start, solves=True)
    finally:
        kill()


@contextmanager
def _worker(folder: Path) -> Iterator[Part]:
    """One of two workers of a Dask cluster is killed, and another takes its place."""
    port = lasting_port()
    address = f"tcp://127.0.0.1:{port}"
    scheduler = start_scheduler(port)
    until_there(port, scheduler)
    workers = [start_worker(address) for _ in range(2)]

    def kill() -> None:
        workers[0].kill()
        workers.pop(0).join()

    try:
        yield Part({"SCANCELL_DASK": address}, kill, lambda: workers.append(start_worker(address)), solves=True)
    finally:
        for process in (scheduler, *workers):
            process.kill()
            process.join()


@contextmanager
def _log(folder: Path) -> Iterator[Part]:
    """Who reads the log of every request stops reading, and goes on."""
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)  # a few lines, and whoever writes has to wait
    reads = threading.Event()
    reads.set()

    def read() -> None:
        while reads.wait() and os.read(reading, 1 << 16):
            pass

    threading.Thread(target=read, daemon=True).start()
    try:
        yield Part({"SCANCELL_LOG": "json"}, reads.clear, reads.set, log=writing)
    finally:
        reads.set()


PARTS: dict[str, Callable[[Path], Any]] = {
    "PostgreSQL restarted": _database,
    "the lock's connection cut": _lock,
    "S3 away": partial(_bucket, "shut"),
    "S3 hangs": partial(_bucket, "hang"),
    "S3 answers 503": partial(_bucket, "refuse"),
    "Dask scheduler restarted": _scheduler,
    "Dask worker killed": _worker,
    "reader of the log hangs": _log,
}
