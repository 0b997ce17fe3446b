"""Our client's patience: a server that is killed and started again under parallel captures fails none of them."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest
from kill_load import CELL
from kill_server import ServerProcess

from scancell_client import ProblemError, Scancell, UnavailableError
from server.settings import Settings
from tests.server.live_server import make_session, serving, upload
from tests.server.test_captures import arc_csv, record

_CAPTURES = 60


def test_a_restart_fails_no_capture(tmp_path: Path) -> None:
    first = ServerProcess(tmp_path / "data", forked=True).wait()
    port = int(first.address.rsplit(":", 1)[1])
    with Scancell(first.address, trust_env=False) as api:
        session = api.sessions_create({"name": "night", "cell": CELL})["id"]
        stored = threading.Semaphore(0)

        def add(number: int) -> str:
            answer = api.captures_add(session, record() | {"id": f"c{number:02}"}, {"p01.csv": arc_csv()})
            stored.release()
            return answer["id"]

        with ThreadPoolExecutor(4) as pool:
            added = [pool.submit(add, number) for number in range(_CAPTURES)]
            for _ in range(5):
                assert stored.acquire(timeout=60)
            first.kill()
            time.sleep(1.0)
            second = ServerProcess(tmp_path / "data", forked=True, port=port).wait()
            names = {one.result() for one in added}
        try:
            listed = api.captures_list_all(session, limit=200)["items"]
        finally:
            second.kill()
    assert sorted(one["id"] for one in listed) == sorted(names)
    assert len(names) == _CAPTURES


def test_patience_ends() -> None:
    started = time.monotonic()
    with Scancell("http://127.0.0.1:9", patience_s=1.0, trust_env=False) as api, pytest.raises(httpx.ConnectError):
        api.sessions_list_all()
    assert 0.2 < time.monotonic() - started < 3


class _Busy(BaseHTTPRequestHandler):
    """Answers 503 with `Retry-After` twice, then what was asked for."""

    asked: list[float]

    def do_PATCH(self) -> None:
        self.asked.append(time.monotonic())
        busy = len(self.asked) < 3
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(503 if busy else 200)
        if busy:
            self.send_header("Retry-After", "1")
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", "2")
        self.end_headers()
        self.wfile.write(b"{}")

    def log_message(self, format: str, *_: object) -> None:  # noqa: A002 (the standard library's name)
        pass


@pytest.mark.thorough
def test_it_comes_again_when_it_was_told_to() -> None:
    busy = type("Busy", (_Busy,), {"asked": []})
    with ThreadingHTTPServer(("127.0.0.1", 0), busy) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with Scancell(f"http://127.0.0.1:{server.server_port}", trust_env=False) as api:
            api.sessions_change("s", {"name": "cell"}, if_match="1")  # nothing was done: it may be sent again
            waits = [later - sooner for sooner, later in zip(busy.asked, busy.asked[1:], strict=False)]
            assert len(waits) == 2
            assert all(1.0 <= wait < 1.75 for wait in waits)
            assert waits[0] != pytest.approx(waits[1], abs=1e-4)  # many do not come at once
        with Scancell(f"http://127.0.0.1:{server.server_port}", patience_s=0, trust_env=False) as api:
            busy.asked.clear()
            with pytest.raises(UnavailableError):
                api.sessions_change("s", {"name": "cell"}, if_match="1")
        server.shutdown()


def test_a_damaged_file_is_told_at_once_and_not_asked_for_again(tmp_path: Path) -> None:
    with serving(Settings(data=tmp_path, port=0, warm_up=False)) as client:
        session = make_session(client)
        assert upload(client, session, record(), arc_csv()).status_code == 201
        (blob,) = [file for file in (tmp_path / "blobs").rglob("*") if len(file.name) == 64]
        blob.write_bytes(b"altered")
        with Scancell(str(client.base_url.copy_with(path="/")), trust_env=False) as api:
            started = time.monotonic()
            with pytest.raises(ProblemError) as refused:
                api.captures_get_file(session, "p01", "p01.csv")
            assert refused.value.details["type"].endswith(":damaged")
            assert not isinstance(refused.value, UnavailableError)
            assert time.monotonic() - started < 30
