"""What no foreign page may do, and what every answer says to browsers."""

import socket
from pathlib import Path

import httpx
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin

from calib_core.errors import InputError
from server.settings import Settings
from tests.server.live_server import assert_problem, make_session

BODY = {"cell": {"pose_convention": "ur"}}


@pytest.mark.parametrize(
    "host", ["evil.example", "127.0.0.1.evil.example", "evil.example:80", "", "[::2]", "a:b:c"]
)
def test_foreign_names_are_refused(client: httpx.Client, host: str) -> None:
    assert_problem(client.get("/health", headers={"Host": host}), 403, "Host")


@pytest.mark.parametrize("host", ["localhost", "localhost:1234", "127.0.0.1:80", "[::1]:8000"])
def test_own_names_are_answered(client: httpx.Client, host: str) -> None:
    assert client.get("/health", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://localhost:1"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_other_pages_may_change_nothing(client: httpx.Client, headers: dict[str, str]) -> None:
    session = make_session(client)
    for method, path in (
        ("POST", "/sessions"),
        ("PATCH", f"/sessions/{session}"),
        ("DELETE", f"/sessions/{session}"),
    ):
        assert_problem(client.request(method, path, json=BODY, headers=headers), 403, "own pages")
    assert client.get(f"/sessions/{session}").status_code == 200


def test_own_pages_may(client: httpx.Client) -> None:
    own = str(client.base_url).removesuffix("/api/v1/")
    headers = {"Origin": own, "Sec-Fetch-Site": "same-origin"}
    assert client.post("/sessions", json=BODY, headers=headers).status_code == 201


def test_answers_tell_browsers_to_be_strict(client: httpx.Client) -> None:
    for answer in (client.get("/health"), client.get("/nothing"), client.get("/health", headers={"Host": "x"})):
        policy = answer.headers["content-security-policy"]
        assert policy.startswith("default-src 'none'")
        assert "unsafe" not in policy.split("style-src")[0]
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert answer.headers["x-frame-options"] == "SAMEORIGIN"
        assert answer.headers["cache-control"] == "no-store"


@pytest.mark.parametrize("path", ["/nothing", "/api/v1/nothing", "/api/v1/sessions/none", "/web/../server/app.py"])
def test_what_is_not_there_is_a_problem_with_a_way_out(client: httpx.Client, path: str) -> None:
    own = str(client.base_url).removesuffix("/api/v1/")
    assert_problem(client.get(own + path), 404)


def test_a_wrong_method_names_the_right_ones(client: httpx.Client) -> None:
    answer = client.put("/sessions")
    assert_problem(answer, 405, "PUT")
    assert "POST" in answer.headers["allow"] or "GET" in answer.headers["allow"]


@pytest.mark.parametrize(("name", "origin"), [("evil.example", None), ("127.0.0.1", "https://evil.example")])
def test_foreign_pages_open_no_websocket(client: httpx.Client, name: str, origin: Origin | None) -> None:
    path = f"/scenes/{make_session(client)}/"
    with (
        socket.create_connection((client.base_url.host, client.base_url.port or 0)) as connection,
        pytest.raises(InvalidStatus) as refused,
    ):
        connect(f"ws://{name}:{client.base_url.port}{path}", sock=connection, origin=origin, proxy=None)
    assert refused.value.response.status_code == 403


def test_settings_from_the_environment_are_checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SCANCELL_WORKERS", "3")
    assert Settings(data=tmp_path).workers == 3
    monkeypatch.setenv("SCANCELL_WORKERS", "many")
    with pytest.raises(InputError, match="workers"):
        Settings(data=tmp_path)


@pytest.mark.parametrize(
    ("host", "required"),
    [("127.0.0.1", False), ("::1", False), ("localhost", False), ("0.0.0.0", True), ("::", True), ("a.b", True)],
)
def test_beyond_this_machine_a_login_is_required(tmp_path: Path, host: str, required: bool) -> None:
    assert Settings(host=host, data=tmp_path).login_required is required
    assert Settings(host=host, data=tmp_path, require_login=True).login_required


def test_a_second_host_is_refused(client: httpx.Client) -> None:
    own = client.base_url.netloc
    for hosts in ((own, own), (own, b"evil.example"), (b"evil.example", own)):
        with socket.create_connection(
            (client.base_url.host, client.base_url.port or 80), timeout=20
        ) as connection:
            lines = b"".join(b"Host: " + host + b"\r\n" for host in hosts)
            connection.sendall(b"GET /api/v1/me HTTP/1.1\r\n" + lines + b"Connection: close\r\n\r\n")
            answer = b"".join(iter(lambda c=connection: c.recv(65536), b""))
        assert answer.startswith(b"HTTP/1.1 403"), answer
        assert b"one Host header" in answer
