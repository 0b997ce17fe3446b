"""Running it: health, figures, the log, and an end that loses nothing."""

import json
import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.jobs import worker
from tests.server.forked_commands import ForkedCommand
from tests.server.live_server import make_session, upload
from tests.server.slow_work import ready_once_there
from tests.server.test_captures import arc_csv, record


def site(client: httpx.Client) -> str:
    return str(client.base_url).removesuffix("/api/v1/")


def figures(client: httpx.Client) -> dict[str, float]:
    answer = client.get(site(client) + "/metrics")
    assert answer.headers["content-type"].startswith("text/plain")
    lines = [line for line in answer.text.splitlines() if not line.startswith("#")]
    return {name: float(value) for name, _, value in (line.rpartition(" ") for line in lines)}


def test_health_tells_ready_from_alive(
    start: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "ready", partial(ready_once_there, tmp_path / "warm"))
    with start(warm_up=True) as client:
        early = client.get(site(client) + "/health")
        assert (early.status_code, early.json()["status"]) == (503, "starting")
        assert client.get("/health").json()["status"] == "starting"
        assert client.get(site(client) + "/health/alive").text == "alive"
        (tmp_path / "warm").touch()
        end_s = time.monotonic() + 300
        while (ready := client.get(site(client) + "/health")).status_code == 503 and time.monotonic() < end_s:
            time.sleep(0.05)
        assert (ready.status_code, ready.json()["status"]) == (200, "ready")
        assert client.get("/health").json()["status"] == "ready"
    with start() as client:
        assert client.get(site(client) + "/health").status_code == 200


def test_metrics_count_requests_by_route_and_what_is_stored(start: Callable[..., Any]) -> None:
    with start() as client:
        sessions = [make_session(client) for _ in range(3)]
        for session in sessions:
            upload(client, session, record(), arc_csv())
            client.get(f"/sessions/{session}/nothing")
        client.request("PROPFIND", "/sessions")
        assert client.request("BREW", "/sessions").status_code == 400  # no method that HTTP knows
        found = figures(client)
    route = 'route="/api/v1/sessions/{session_id}/captures"'
    assert found[f'scancell_requests_total{{method="POST",{route},status="201"}}'] == 3
    assert found[f"scancell_request_seconds_count{{{route}}}"] == 3
    assert found['scancell_requests_total{method="GET",route="none",status="404"}'] == 3
    assert any('method="other"' in name for name in found)
    assert found["scancell_sessions"] == 3
    assert found['scancell_jobs{status="running"}'] == 0
    assert found["scancell_disk_free_bytes"] > 0
    assert found["scancell_requests_in_progress"] == 1  # the one that asks
    assert not any(session in name for name in found for session in sessions)


def serve(data: Path, shared_workers: bool = True, **settings: str) -> tuple[ForkedCommand, str]:
    words = ["server.cli", "serve", "--port", "0", "--data", str(data)]
    environment = {"SCANCELL_WARM_UP": "false", "SCANCELL_LOG": "json", **settings}
    process = ForkedCommand(words, environment, own_group=True, shared_workers=shared_workers)
    address = next(word for word in process.stdout.readline().split() if word.startswith("http"))
    return process, address


def slow_upload(address: str, session: str, begun: threading.Event) -> bytes:
    """Send a capture in two halves, the second when the server has been told to stop; return its answer."""
    form = (
        b'--b\r\nContent-Disposition: form-data; name="record"\r\n\r\n'
        + json.dumps({**record(), "files": ["a.csv"]}).encode()
        + b'\r\n--b\r\nContent-Disposition: form-data; name="files"; filename="a.csv"\r\n\r\n'
        + arc_csv()
        + b"\r\n--b--\r\n"
    )
    host, port = address.removeprefix("http://").split(":")
    with socket.create_connection((host, int(port)), timeout=300) as connection:
        head = (
            f"POST /api/v1/sessions/{session}/captures HTTP/1.1\r\nHost: {host}:{port}\r\nConnection: close\r\n"
            f"Content-Type: multipart/form-data; boundary=b\r\nContent-Length: {len(form)}\r\n\r\n"
        )
        connection.sendall(head.encode() + form[:1000])
        begun.set()
        time.sleep(1.5)
        connection.sendall(form[1000:])
        answer = b""
        while piece := connection.recv(65536):
            answer += piece
        return answer


@pytest.mark.thorough
def test_a_server_told_to_stop_finishes_what_it_has_begun(tmp_path: Path) -> None:
    process, address = serve(tmp_path / "data")
    try:
        with httpx.Client(base_url=f"{address}/api/v1", timeout=30, trust_env=False) as client:
            session = make_session(client)
            named = client.get(f"/sessions/{session}", headers={"X-Request-ID": "mine-1"})
            assert named.headers["X-Request-ID"] == "mine-1"
            made_up = client.get(f"/sessions/{session}", headers={"X-Request-ID": "a b\t{}"})
            assert len(made_up.headers["X-Request-ID"]) == 16
            begun, answers = threading.Event(), list[bytes]()
            sender = threading.Thread(target=lambda: answers.append(slow_upload(address, session, begun)))
            with client.stream("GET", f"/sessions/{session}/events") as stream:
                sender.start()
                assert begun.wait(300)
                time.sleep(0.3)
                process.send_signal(signal.SIGTERM)
                for _ in stream.iter_raw():  # ends by itself, whole
                    pass
            sender.join(timeout=300)
        assert process.wait(timeout=300) == 0
    finally:
        process.kill()
        _, said = process.communicate()
    assert answers[0].startswith(b"HTTP/1.1 201"), answers
    lines = [json.loads(line) for line in said.splitlines()]
    requests = {line["request"]: line for line in lines if line["logger"] == "scancell.requests"}
    mine = requests["mine-1"]
    assert (mine["method"], mine["route"], mine["status"]) == ("GET", "/api/v1/sessions/{session_id}", 200)
    assert mine["ms"] > 0
    assert mine["user"]
    assert [line["status"] for line in requests.values()] == [201, 200, 200, 200, 201]
    assert not [line for line in lines if line["level"] == "error"], said


def test_an_upload_that_a_stop_cannot_wait_for_is_refused_as_what_may_come_again(tmp_path: Path) -> None:
    process, address = serve(tmp_path / "data", SCANCELL_SHUTDOWN_GRACE_S="0")
    try:
        with httpx.Client(base_url=f"{address}/api/v1", timeout=30, trust_env=False) as client:
            session = make_session(client)
        host, port = address.removeprefix("http://").split(":")
        with socket.create_connection((host, int(port)), timeout=300) as connection:
            head = (
                f"POST /api/v1/sessions/{session}/captures HTTP/1.1\r\nHost: {host}:{port}\r\n"
                "Content-Type: multipart/form-data; boundary=b\r\nContent-Length: 99999999\r\n"
                "Accept-Language: de\r\n\r\n--b\r\n"
            )
            connection.sendall(head.encode())
            time.sleep(0.5)  # it waits for the rest
            process.send_signal(signal.SIGTERM)
            answer = b""
            while piece := connection.recv(65536):
                answer += piece
        assert process.wait(timeout=300) == 0
    finally:
        process.kill()
        _, said = process.communicate()
    assert answer.startswith(b"HTTP/1.1 503"), answer
    head, _, body = answer.partition(b"\r\n\r\n")
    assert b"retry-after: " in head.lower()
    assert json.loads(body)["type"] == "urn:scancell:problem:unavailable"
    assert "angehalten" in json.loads(body)["detail"]
    assert "Traceback" not in said


@pytest.mark.thorough
@pytest.mark.skipif(os.name == "nt", reason="a terminal's Ctrl-C is another thing there")
@pytest.mark.parametrize("after_s", [0.0, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c_while_processes_get_ready_ends_all_with_one_sentence(
    tmp_path: Path, after_s: float, times: int
) -> None:
    process, _ = serve(tmp_path / "data", shared_workers=False, SCANCELL_WARM_UP="true")
    try:
        time.sleep(after_s)
        for _ in range(times):
            os.killpg(process.pid, signal.SIGINT)  # as a terminal sends it: to every process of the command
            time.sleep(0.2)
        printed, said = process.communicate(timeout=300)
    finally:
        process.kill()
    assert process.returncode == 0, said
    assert printed.splitlines() == ["The workbench has stopped."]
    assert not [line for line in said.splitlines() if '"level": "info"' not in line], said
