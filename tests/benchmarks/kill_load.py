"""Load on a server that is about to be killed, and what must hold once it is back."""

import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import httpx
import numpy as np

CELL = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
_UPLOADERS = 3
_TRANSPORT = (httpx.TransportError, httpx.StreamError)


@dataclass
class Sent:
    """One request that stores something: what it was, and the answer, None where the server died over it."""

    key: str
    session: str
    capture: str
    content: bytes
    answer: dict[str, Any] | None = None


@dataclass
class Known:
    """What a client knows when the server has died."""

    sent: list[Sent] = field(default_factory=list[Sent])
    imported: list[str] = field(default_factory=list[str])
    jobs: list[str] = field(default_factory=list[str])
    first: threading.Event = field(default_factory=threading.Event)  # a capture was acknowledged

    @property
    def acknowledged(self) -> list[Sent]:
        """Captures that the server has confirmed."""
        return [sent for sent in self.sent if sent.answer is not None]


@dataclass
class Findings:
    """What was wrong after a kill, in words."""

    lost: list[str] = field(default_factory=list[str])
    half: list[str] = field(default_factory=list[str])

    def merge(self, other: "Findings") -> None:
        """Add another's."""
        self.lost += other.lost
        self.half += other.half


@contextmanager
def load(connect: Callable[[], httpx.Client], number: int, archive: bytes, captures: int) -> Iterator[Known]:
    """Upload, solve, import, until the server dies; then what was acknowledged is known.

    Parameters
    ----------
    connect : callable
        Returns a client of the server.
    number : int
        Of the round: keys and contents are its own.
    archive : bytes
        An archive to import, with a result.
    captures : int
        How many captures the archive has.
    """
    known = Known()
    with connect() as client:
        sessions = [
            client.post("/sessions", json={"name": f"round {number}", "cell": CELL}).json()["id"] for _ in range(3)
        ]
    work: list[Callable[[httpx.Client], None]] = [
        *(_uploads(known, sessions[n], f"{number}-{n}") for n in range(_UPLOADERS)),
        lambda client: _imports(known, client, archive, captures),
        *([lambda client: _solves(known, client, archive)] if number % 3 == 0 else []),
    ]
    threads = [threading.Thread(target=_until_it_dies, args=(connect, job), daemon=True) for job in work]
    for thread in threads:
        thread.start()
    yield known
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive(), "a client hangs though its server is dead"


def _until_it_dies(connect: Callable[[], httpx.Client], work: Callable[[httpx.Client], None]) -> None:
    with connect() as client:
        try:
            while True:
                work(client)
        except _TRANSPORT:
            return


def _uploads(known: Known, session: str, name: str) -> Callable[[httpx.Client], None]:
    count = 0

    def upload(client: httpx.Client) -> None:
        nonlocal count
        count += 1
        x = np.linspace(-12.0, 12.0, 60)
        z = 200.0 - np.sqrt(20.0**2 - x**2) + 1e-4 * count
        rows = "".join(f"{a:.4f},{b:.4f}\n" for a, b in zip(x, z, strict=True))
        sent = Sent(f"{name}-{count}", session, f"p{count}", f"# {name}\n{rows}".encode())
        known.sent.append(sent)
        answer = send(client, sent)
        assert answer.status_code == 201, answer.text
        sent.answer = answer.json()
        known.first.set()

    return upload


def send(client: httpx.Client, sent: Sent) -> httpx.Response:
    """Upload a capture, for the first time or again."""
    record = {"id": sent.capture, "step": "tcp", "kind": "profile", "pose": [500, 0, 500, 180, 0, 0]}
    body = [("record", (None, json.dumps(record))), ("files", ("p.csv", sent.content))]
    return client.post(f"/sessions/{sent.session}/captures", files=body, headers={"Idempotency-Key": sent.key})


def _imports(known: Known, client: httpx.Client, archive: bytes, captures: int) -> None:
    made = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"})
    assert made.status_code == 201, made.text
    assert len(made.json()["captures"]) == captures
    known.imported.append(made.json()["id"])


def _solves(known: Known, client: httpx.Client, archive: bytes) -> None:
    made = client.post("/archives", content=archive, headers={"Content-Type": "application/zip"}).json()["id"]
    known.imported.append(made)
    job = client.post(f"/sessions/{made}/solve/tcp").json()["id"]
    known.jobs.append(job)
    while client.get(f"/jobs/{job}").json()["status"] in ("queued", "running"):
        time.sleep(0.05)


def check(client: httpx.Client, known: Known, number: int, captures: int) -> Findings:
    """Return what is wrong with a server that came back: acknowledged captures lost, half states seen."""
    found = Findings()
    for sent in known.acknowledged:
        _check_capture(client, sent, found)
    for sent in known.sent:
        if sent.answer is None:
            _check_unanswered(client, sent, found)
    _check_sessions(client, number, captures, set(known.imported), found)
    for job in known.jobs:
        answer = client.get(f"/jobs/{job}").json()
        if answer.get("status") not in ("done", "failed", "cancelled"):
            found.half.append(f"job {job}: {answer}")
    return found


def _check_capture(client: httpx.Client, sent: Sent, found: Findings) -> None:
    answer = client.get(f"/sessions/{sent.session}/captures/{sent.capture}")
    if answer.status_code != 200 or answer.json() != sent.answer:
        found.lost.append(f"{sent.session}/{sent.capture}: {answer.status_code} {answer.text[:200]}")
        return
    name = answer.json()["files"][0]
    file = client.get(f"/sessions/{sent.session}/captures/{sent.capture}/files/{name}")
    if file.content != sent.content:
        found.lost.append(f"{sent.session}/{sent.capture}: its file, {file.status_code} {file.text[:200]}")


def _check_unanswered(client: httpx.Client, sent: Sent, found: Findings) -> None:
    """A capture that nobody confirmed is there as a whole or not at all, and may be sent again."""
    before = client.get(f"/sessions/{sent.session}/captures/{sent.capture}").status_code
    again = send(client, sent)
    if again.status_code != 201 or (before == 200) != ("Idempotency-Replayed" in again.headers):
        found.half.append(f"{sent.session}/{sent.capture} again: {before}, {again.status_code} {again.text[:200]}")
        return
    sent.answer = again.json()
    _check_capture(client, sent, found)


def _check_sessions(client: httpx.Client, number: int, captures: int, imported: set[str], found: Findings) -> None:
    """Every session of an import is whole, with its result; those of the round are all there."""
    cursor, seen = None, set[str]()
    while True:
        page = client.get("/sessions", params={"limit": 200, **({"cursor": cursor} if cursor else {})}).json()
        for item in page["items"]:
            seen.add(item["id"])
            made_here = item["name"].startswith("round ")
            if not made_here and (item["capture_count"] != captures or "tcp" not in item["verdicts"]):
                found.half.append(f"import {item['id']}: {item['capture_count']} captures, {item['verdicts']}")
        cursor = page["next"]
        # What is older than the round's own sessions was looked at when its round ended.
        if cursor is None or any(item["name"] == f"round {number}" for item in page["items"]):
            break
    found.lost += [f"import {session}" for session in imported - seen]
