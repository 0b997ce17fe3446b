"""Time-outs, and what stands between this server and the network: proxies, encryption, names."""

import asyncio
import datetime
import http.client
import json
import socket
import ssl
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Any

import httpx
import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID
from hypothesis import given
from hypothesis import strategies as st

from server.auth.buckets import Buckets
from server.commands.serve import _running
from server.http.address_limit import AddressLimit
from server.http.timeouts import Timeouts
from server.serve import WorkbenchServer
from server.settings import Settings
from tests.server.access import bearer, guarded, make_tokens
from tests.server.live_server import make_session, serving

HEAD = b"GET /api/v1/health HTTP/1.1\r\nHost: 127.0.0.1\r\n"


def connected(client: httpx.Client) -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", client.base_url.port or 0))
    connection.settimeout(10)
    return connection


def seconds_until_closed(connection: socket.socket) -> float:
    start_s = time.monotonic()
    while connection.recv(65536):
        pass
    return time.monotonic() - start_s


def is_answered(connection: socket.socket) -> bool:
    connection.sendall(HEAD + b"\r\n")
    answer = http.client.HTTPResponse(connection)
    answer.begin()
    return answer.status == 200 and bool(answer.read())


@pytest.mark.thorough
def test_heads_that_do_not_come_end_the_connection_and_streams_go_on(start: Any) -> None:
    with start(head_timeout_s=1.0) as client:
        session = make_session(client)
        with client.stream("GET", f"/sessions/{session}/events", timeout=10) as stream:
            lines = stream.iter_lines()
            next(lines)
            with (
                connected(client) as silent,
                connected(client) as slow,
                connected(client) as again,
                connected(client) as resting,
            ):
                assert is_answered(resting)
                slow.sendall(HEAD)
                assert is_answered(again)
                again.sendall(HEAD[:20])
                for connection in (silent, slow, again):
                    assert seconds_until_closed(connection) < 5
                assert is_answered(resting)  # longer than the others, but between two requests
            client.patch(f"/sessions/{session}", json={"name": "still heard"})
            assert any("changed" in line for line in lines)


CHUNKED = b"POST /api/v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n\r\n"
ENDLESS = {
    "header": (HEAD + b"X-Long: ", b"a" * 100_000),
    "headers": (HEAD, b"X: y\r\n" * 20_000),
    "address": (b"GET /", b"a" * 100_000),
    "trailer": (CHUNKED + b"2\r\n{}\r\n0\r\nX-Long: ", b"a" * 100_000),
    "trailers": (CHUNKED + b"2\r\n{}\r\n0\r\n", b"X: y\r\n" * 20_000),
    "size of a chunk": (CHUNKED + b"2;name=", b"a" * 100_000),
}


@pytest.mark.parametrize("what", ENDLESS)
def test_what_is_no_body_has_an_end(client: httpx.Client, what: str) -> None:
    begin, more = ENDLESS[what]
    with connected(client) as connection:
        connection.sendall(begin)
        sent = 0
        try:
            while sent < 20_000_000:
                connection.sendall(more)
                sent += len(more)
            assert connection.recv(65536).startswith(b"HTTP/1.1 400")
        except OSError:  # the other side has closed
            assert sent < 20_000_000
    assert client.get("/health").status_code == 200


def test_a_long_head_is_refused_also_where_it_comes_at_once(client: httpx.Client) -> None:
    with connected(client) as connection:
        connection.sendall(HEAD + b"X-Long: " + b"a" * 66_000 + b"\r\n\r\n")
        assert_refused_as_problem(connection)
    with connected(client) as connection:
        connection.sendall(HEAD + b"X-Long: " + b"a" * 60_000 + b"\r\n\r\n")
        assert connection.recv(65536).startswith(b"HTTP/1.1 200")


@pytest.mark.parametrize(
    "sent", [b"\x16\x03\x01\x02\x00\x01", b"GET / HTTP/1.1\r\nA\x00: b\r\n\r\n", b"BREW / HTTP/9\r\n\r\n"]
)
def test_what_is_no_http_is_refused_as_a_problem(client: httpx.Client, sent: bytes) -> None:
    with connected(client) as connection:
        connection.sendall(sent)
        assert_refused_as_problem(connection)


def assert_refused_as_problem(connection: Any) -> None:
    answer = b"".join(iter(lambda: connection.recv(65536), b""))
    head, _, body = answer.partition(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 400"), answer
    assert b"application/problem+json" in head
    assert json.loads(body)["detail"].endswith(json.loads(body)["to_do"])


def test_a_body_in_small_chunks_may_be_long(client: httpx.Client) -> None:
    pieces = [json.dumps({"cell": {"pose_convention": "ur"}}).encode(), *[b" "] * 30_000]
    head = {"Content-Type": "application/json"}
    assert client.post("/sessions", content=iter(pieces), headers=head).status_code == 201


def test_connections_have_an_end(start: Any) -> None:
    with start(max_connections=4) as client:
        held = [connected(client) for _ in range(6)]
        with httpx.Client(base_url=client.base_url, trust_env=False) as late:
            assert late.get("/sessions").status_code == 503
            assert late.get("/health").status_code == 200  # whoever watches is answered
        for connection in held:
            connection.close()
        end_s = time.monotonic() + 300
        while client.get("/health").status_code != 200:
            assert time.monotonic() < end_s


@dataclass
class Held:
    """A connection as the limit sees it."""

    opened_s: float
    waits: bool
    client: tuple[str, int] | None = ("192.0.2.1", 1)
    is_open: bool = True

    def hang_up(self) -> None:
        self.is_open = False


def test_a_connection_that_has_just_come_is_heard_before_it_makes_room() -> None:
    """Beside hundreds of busy ones of its address, the next one hung up on who asks for health."""
    now_s = time.monotonic()
    newcomer, fresh, rested = Held(now_s, True), Held(now_s - 0.1, True), Held(now_s - 5.0, True)
    busy = [Held(now_s - 9.0, waits=False) for _ in range(8)]
    limit = AddressLimit(8)
    limit.make_room(newcomer, [*busy, fresh, newcomer])
    assert fresh.is_open
    assert not limit.has_room(newcomer, [*busy, fresh, newcomer])
    assert limit.has_room(newcomer, [*busy[1:], fresh, newcomer])  # one has ended meanwhile
    limit.make_room(newcomer, [*busy[1:], fresh, rested, newcomer])
    assert (fresh.is_open, rested.is_open) == (True, False)
    flood = [Held(now_s - 0.01 * k, waits=True) for k in range(8)]
    limit.make_room(newcomer, [*busy, *flood, newcomer])
    assert not any(one.is_open for one in flood)
    assert all(one.is_open for one in busy)


def test_one_address_shuts_nobody_out(start: Any) -> None:
    with start(max_connections_per_address=20, max_connections=40) as client:
        slow = [connected(client) for _ in range(100)]
        for connection in slow:
            with suppress(OSError):  # the oldest are closed already
                connection.sendall(HEAD)
        there = httpx.HTTPTransport(local_address="127.0.0.2")
        with httpx.Client(base_url=client.base_url, transport=there, trust_env=False) as other:
            assert other.get("/sessions").status_code == 200
        with httpx.Client(base_url=client.base_url, trust_env=False) as same:
            assert same.get("/sessions").status_code == 200  # the oldest one that waited has made room
        with suppress(ConnectionResetError):
            assert not slow[0].recv(1)
        for connection in slow:
            connection.close()


def test_where_all_connections_of_an_address_are_busy_the_next_is_told(start: Any) -> None:
    with start(max_connections_per_address=2) as client:
        session = make_session(client)
        with (
            client.stream("GET", f"/sessions/{session}/events", timeout=10),
            client.stream("GET", f"/sessions/{session}/events", timeout=10),
            httpx.Client(base_url=client.base_url, trust_env=False) as late,
        ):
            refused = late.get("/sessions")
            assert (refused.status_code, "an address may hold" in refused.text) == (503, True)
            assert late.get("/health").status_code == 200


@pytest.mark.thorough
def test_a_body_that_stops_is_told_so(start: Any) -> None:
    with start(body_timeout_s=0.5) as client, connected(client) as connection:
        connection.sendall(
            b"POST /api/v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
            b"Content-Length: 100\r\n\r\n{"
        )
        answer = connection.recv(65536)
        while b"}" not in answer:
            answer += connection.recv(65536)
        assert answer.startswith(b"HTTP/1.1 408")
        assert b"application/problem+json" in answer
        assert b"whose body stopped" in answer


@pytest.mark.parametrize("begins", [True, False])
def test_an_answer_must_begin_in_time(tmp_path: Path, begins: bool) -> None:
    ended: list[str] = []

    async def slow(scope: Any, receive: Any, send: Any) -> None:
        assert (await receive())["type"] == "http.request"
        if begins:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        await asyncio.sleep(0.3)
        if not begins:
            await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"done"})
        ended.append("ended")

    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    patience = Timeouts(slow, Settings(data=tmp_path, answer_timeout_s=0.1))
    scope = {"type": "http", "path": "/x", "method": "POST"}
    with ThreadPoolExecutor(1) as thread:  # a browser's test before may have left an event loop in this one
        thread.submit(lambda: asyncio.run(patience(scope, receive, send))).result()
    assert ended == ["ended"]  # a route that writes comes to its end, whoever waits for it
    assert sent[0]["status"] == (200 if begins else 504)
    assert len(sent) == 2
    if not begins:
        assert "Idempotency-Key" in json.loads(sent[1]["body"])["detail"]


def test_what_a_proxy_says_counts_only_where_it_is_trusted(tmp_path: Path) -> None:
    forwarded = {"X-Forwarded-Proto": "https", "X-Forwarded-For": "203.0.113.9"}
    with guarded(tmp_path / "a") as (client, tokens):
        answer = client.post("/login", json={"token": tokens["read"]}, headers=forwarded)
        assert "Secure" not in answer.headers["set-cookie"]
    with guarded(tmp_path / "b", trusted_proxies=["127.0.0.1"]) as (client, tokens):
        answer = client.post("/login", json={"token": tokens["read"]}, headers=forwarded)
        cookie = answer.headers["set-cookie"]
        assert cookie.startswith("__Host-scancell-")
        assert "Secure" in cookie
        own = {"Cookie": cookie.split(";")[0], **forwarded}
        assert client.get("/me", headers=own).json()["login"] == "cookie"
        rows = client.get("/audit", headers=bearer(tokens["admin"])).json()["items"]
        assert rows[0]["address"] == "203.0.113.9"


def certificate(folder: Path) -> tuple[Path, Path]:
    """Write a certificate of 127.0.0.1 that signs itself, and its key."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "scancell test")])
    now = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - datetime.timedelta(hours=1))
        .not_valid_after(now + datetime.timedelta(hours=1))
        .add_extension(x509.SubjectAlternativeName([x509.IPAddress(ip_address("127.0.0.1"))]), critical=False)
        .sign(key, hashes.SHA256())
    )
    plain = serialization.NoEncryption()
    pem = serialization.Encoding.PEM
    (folder / "key.pem").write_bytes(key.private_bytes(pem, serialization.PrivateFormat.PKCS8, plain))
    (folder / "certificate.pem").write_bytes(made.public_bytes(pem))
    return folder / "certificate.pem", folder / "key.pem"


def test_beyond_this_machine_with_encryption(tmp_path: Path) -> None:
    """The whole of it: all addresses, https, a login; under every address, under foreign names not."""
    public, private = certificate(tmp_path)
    data, files = tmp_path / "data", {"tls_certificate": public, "tls_key": private}
    tokens = make_tokens(Settings(data=data))
    settings = Settings(host="0.0.0.0", port=0, data=data, warm_up=False, allowed_hosts=["cell4.example"], **files)
    with serving(settings) as plain:
        port = plain.base_url.port
        # Told, and opened, as Windows takes it; a second `serve --open` finds it, whoever signed its certificate.
        assert plain.base_url.host == "127.0.0.1"
        assert _running("0.0.0.0", port) == f"https://127.0.0.1:{port}"
        trusted = ssl.create_default_context(cafile=public)
        with httpx.Client(base_url=f"https://127.0.0.1:{port}/api/v1", verify=trusted, trust_env=False) as client:
            assert client.get("/sessions").status_code == 401
            answer = client.post("/login", json={"token": tokens["read"]})
            cookie = answer.headers["set-cookie"]
            assert cookie.startswith(f"__Host-scancell-{port}=")
            assert "Secure" in cookie
            assert client.get("/sessions").status_code == 200
            for name, status in {
                "10.1.2.3:8000": 200,
                "cell4.example": 200,
                "[fe80::1]:8000": 200,
                "evil.example": 403,
                "10.1.2.3.evil.example": 403,
                "": 403,
            }.items():
                assert client.get("/health", headers={"Host": name}).status_code == status, name


def test_only_files_that_are_there_encrypt(tmp_path: Path) -> None:
    from calib_core.errors import InputError

    for changes in ({"tls_certificate": tmp_path / "no.pem"}, {"tls_key": tmp_path / "no.pem"}):
        with pytest.raises(InputError, match="tls"):
            WorkbenchServer(Settings(data=tmp_path, **changes))


@given(
    steps=st.lists(st.tuples(st.floats(0, 3), st.sampled_from("ab")), max_size=60),
    rate=st.floats(0.1, 10),
    burst=st.integers(1, 5),
)
def test_a_bucket_never_gives_more_than_its_burst_and_its_rate(
    steps: list[tuple[float, str]], rate: float, burst: int
) -> None:
    now_s = 0.0
    buckets = Buckets(rate, burst, lambda: now_s)
    given_to: dict[str, list[float]] = {"a": [], "b": []}
    for pause_s, key in steps:
        now_s += pause_s
        wait_s = buckets.wait_s(key)
        if wait_s == 0:
            given_to[key].append(now_s)
            continue
        assert 0 < wait_s <= 1 / rate
        now_s += wait_s * (1 + 1e-9)
        assert buckets.wait_s(key) == 0
        given_to[key].append(now_s)
    for times in given_to.values():
        for first, start_s in enumerate(times):
            for last in range(first, len(times)):
                assert last - first + 1 <= burst + rate * (times[last] - start_s) + 1e-6
