"""Other sides that hang up: nothing has failed, so nothing is logged as failed, and nothing is left open."""

import asyncio
import gc
import io
import logging
import socket
import struct
import time
from collections.abc import AsyncIterator, Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi import FastAPI
from fastapi.sse import EventSourceResponse, ServerSentEvent

from server.http.disconnects import Disconnects
from tests.server.live_server import make_session, simulated_session, upload

ABORT = struct.pack("ii", 1, 0)  # a reset instead of a farewell
ZIP = "application/zip"
FORM = "multipart/form-data; boundary=b"
BYTES = "application/octet-stream"
BEGUN = {
    ZIP: b"PK\x03\x04",
    FORM: b'--b\r\nContent-Disposition: form-data; name="file"; filename="a"\r\n\r\nabc',
    BYTES: b'{"id": "p01"',
}


def send_and_hang_up(client: httpx.Client, content: bytes, after_s: float, politely: bool = False) -> None:
    with socket.create_connection(("127.0.0.1", client.base_url.port or 0)) as connection:
        if not politely:
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, ABORT)
        connection.sendall(content)
        time.sleep(after_s)


def handshake(client: httpx.Client, path: str, **changes: str) -> bytes:
    host = client.base_url.netloc.decode()
    headers = {
        "Host": host,
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Protocol": "viser-v1",
        "Origin": f"http://{host}",
        **{name.replace("_", "-"): value for name, value in changes.items()},
    }
    lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    return f"GET {path} HTTP/1.1\r\n{lines}\r\n".encode()


def complaints(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def is_served(client: httpx.Client) -> bool:
    """Return whether the server answers; what came before has been looked at then."""
    time.sleep(0.3)
    return client.get("/health").is_success


@pytest.mark.thorough
def test_a_websocket_that_was_left_is_no_failure(client: httpx.Client, caplog: pytest.LogCaptureFixture) -> None:
    there = f"/scenes/{simulated_session(client, captures=1)}"
    for after_s in (0.0, 0.002, 0.02):
        send_and_hang_up(client, handshake(client, "/scenes/none"), after_s)
        send_and_hang_up(client, handshake(client, there, Origin="http://elsewhere.example"), after_s)
        send_and_hang_up(client, handshake(client, there, Sec_WebSocket_Protocol="other"), after_s)
    for after_s in (0.0, 0.1, 0.5):
        send_and_hang_up(client, handshake(client, there), after_s)
        send_and_hang_up(client, handshake(client, there), after_s, politely=True)
    assert is_served(client)
    assert complaints(caplog) == []


def test_a_refused_websocket_hears_why_and_is_no_failure(
    client: httpx.Client, caplog: pytest.LogCaptureFixture
) -> None:
    with socket.create_connection(("127.0.0.1", client.base_url.port or 0), timeout=10) as connection:
        connection.sendall(handshake(client, "/scenes/none"))
        answer = b""
        while piece := connection.recv(65536):
            answer += piece
    assert answer.startswith(b"HTTP/1.1 404")
    assert b"Take one of those that are listed." in answer
    assert is_served(client)
    assert complaints(caplog) == []


@pytest.mark.parametrize(
    ("path", "kind"),
    [
        ("/archives", ZIP),
        ("/archives", FORM),
        ("/archives/verify", ZIP),
        ("/sessions/{}/captures/batch", BYTES),
        ("/sessions/{}/captures", FORM),
    ],
)
def test_an_upload_that_was_cut_off_stores_nothing_and_is_no_failure(
    client: httpx.Client, caplog: pytest.LogCaptureFixture, path: str, kind: str
) -> None:
    session = make_session(client)
    head = (
        f"POST /api/v1{path.format(session)} HTTP/1.1\r\nHost: {client.base_url.netloc.decode()}\r\n"
        f"Content-Type: {kind}\r\nContent-Length: 100000\r\n\r\n"
    )
    for politely in (False, True):
        send_and_hang_up(client, head.encode() + BEGUN[kind], 0.05, politely)
    assert is_served(client)
    assert client.get(f"/sessions/{session}").json()["captures"] == []
    assert complaints(caplog) == []


def test_a_reader_who_hangs_up_while_events_wait_to_be_sent_is_no_failure() -> None:
    events, full = FastAPI(), asyncio.Event()
    events.add_middleware(Disconnects)

    @events.get("/events", response_class=EventSourceResponse)
    async def many() -> AsyncIterator[ServerSentEvent]:  # pyright: ignore[reportUnusedFunction]
        while True:
            yield ServerSentEvent(data="one more")
            await asyncio.sleep(0)

    async def receive() -> dict[str, Any]:
        await full.wait()
        await asyncio.sleep(0.05)
        return {"type": "http.disconnect"}

    async def send(message: Any) -> None:
        if message["type"] == "http.response.body":
            full.set()
            await asyncio.Event().wait()  # it reads no more

    scope = {"type": "http", "method": "GET", "path": "/events", "query_string": b"", "headers": [], "asgi": {}}
    with ThreadPoolExecutor() as pool:  # here a browser's loop may be running
        pool.submit(lambda: asyncio.run(events(scope, receive, send))).result()  # pyright: ignore[reportArgumentType]
    assert full.is_set()


def open_files(folder: Path) -> list[str]:
    """Return what this process, which is the server, has open below a folder, the database's own files aside."""
    found: list[str] = []
    for handle in Path("/proc/self/fd").iterdir():
        try:
            found.append(str(handle.readlink()))
        except FileNotFoundError:  # the listing itself
            continue
    return [name for name in found if name.startswith(str(folder / "blobs"))]


def came_to(state: Callable[[], bool]) -> bool:
    """Return whether something came to be within some seconds."""
    end_s = time.monotonic() + 10
    while not state() and time.monotonic() < end_s:
        time.sleep(0.05)
    return state()


@pytest.mark.thorough(keep=1)
@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system does not list open files")
@pytest.mark.parametrize("path", ["captures/big/files/big.npy", "archive?scene=false"])
def test_a_download_that_was_broken_off_leaves_no_file_open(
    start: Callable[..., Any], tmp_path: Path, path: str
) -> None:
    content = io.BytesIO()
    np.save(content, np.random.default_rng(1).random((2_000_000, 3)))  # more than the sockets hold
    record = {"id": "big", "step": "scan", "kind": "cloud", "files": ["captures/big.npy"], "table_deg": 0.0}
    with start() as client:
        session = make_session(client)
        assert upload(client, session, record, content.getvalue()).status_code == 201
        assert open_files(tmp_path / "data") == []
        gc.collect()
        gc.disable()  # nothing may rely on it
        try:
            with client.stream("GET", f"/sessions/{session}/{path}") as answer:
                assert answer.status_code == 200
                pieces = answer.iter_bytes()  # to let go of it hangs up
                next(pieces)
                assert open_files(tmp_path / "data")
            assert came_to(lambda: open_files(tmp_path / "data") == [])
        finally:
            gc.enable()
