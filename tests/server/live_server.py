"""The real server, on loopback, in a thread of the test process; its workers are real processes."""

import json
import ssl
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import httpx

from server.serve import WorkbenchServer
from server.settings import Settings
from tests.server.forked_commands import fork_from_one

API = "/api/v1"
_LIMITS = httpx.Limits(keepalive_expiry=2.0)
_NO_TRUST = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # plain HTTP needs no certificates, which take 30 ms to load


@contextmanager
def serving(settings: Settings) -> Generator[httpx.Client]:
    fork_from_one()
    server = WorkbenchServer(settings)
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        while not server.started:
            assert thread.is_alive(), "the server ended at its start"
            time.sleep(0.01)
        options: Any = {"timeout": 300, "trust_env": False, "limits": _LIMITS, "verify": _NO_TRUST}
        with httpx.Client(base_url=server.address + API, **options) as client:
            yield client
    finally:
        server.stop()
        thread.join(timeout=300)
        assert not thread.is_alive(), "the server does not stop"


def make_session(client: httpx.Client, **record: Any) -> str:
    cell = {"pose_convention": "fanuc", "sphere_diameter_mm": 40.0, "scanner": {"kind": "profile"}}
    answer = client.post("/sessions", json={"name": "cell", "cell": cell, **record})
    assert answer.status_code == 201, answer.text
    return answer.json()["id"]


def simulated_session(client: httpx.Client, captures: int = 0, scenario: str = "tcp", seed: int = 7) -> str:
    answer = client.post("/sessions", json={"simulated": {"scenario": scenario, "seed": seed}})
    assert answer.status_code == 201, answer.text
    session = answer.json()["id"]
    for _ in range(captures):
        taken = client.post(f"/sessions/{session}/sources/simulated/capture")
        assert taken.status_code == 201, taken.text
    return session


def upload(
    client: httpx.Client,
    session: str,
    record: dict[str, Any],
    *files: bytes,
    headers: dict[str, str] | None = None,
) -> httpx.Response:
    parts = [("files", (f"{number}.csv", content)) for number, content in enumerate(files)]
    # Without files httpx would send a form of another kind.
    body = [("record", (None, json.dumps(record))), *parts]
    return client.post(f"/sessions/{session}/captures", files=body, headers=headers)


def wait_for(client: httpx.Client, job: str, timeout_s: float = 300) -> dict[str, Any]:
    end_s = time.monotonic() + timeout_s
    while time.monotonic() < end_s:
        answer = client.get(f"/jobs/{job}").json()
        if answer["status"] not in ("queued", "running"):
            return answer
        time.sleep(0.05)
    raise AssertionError(f"the job has not ended: {answer}")


def assert_problem(answer: httpx.Response, status: int, *words: str) -> dict[str, Any]:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert {"type", "title", "status", "detail", "need", "got", "to_do", "where"} <= set(problem)
    assert problem["status"] == status
    assert problem["detail"].endswith(problem["to_do"])
    for word in words:
        assert word in problem["detail"], problem["detail"]
    return problem
