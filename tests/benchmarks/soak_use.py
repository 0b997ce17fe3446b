"""Mixed use of a server, in rounds: sessions are made, used as people and programs do, and removed."""

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

import httpx
import numpy as np
import viser
from load_clients import capture_form
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from calib_core.simulation import SimulatedSession, simulate

_READ = ("", "/captures", "/guide", "/check", "/results", "/timeline", "/answer", "/causes", "/clouds")
_PAGES = (
    "/",
    "/docs",
    "/openapi.json",
    "/metrics",
    "/api/v1/stages",
    "/api/v1/exports",
    "/api/v1/cells",
    "/api/v1/sessions",
    "/api/v1/jobs",
)
_AT_ONCE = 12
_FORM = {"Content-Type": "multipart/form-data; boundary=scancell-load"}  # of `capture_form`
_JSON = {"Content-Type": "application/json"}
_ZIP = {"Content-Type": "application/zip"}
_BYTES = {"Content-Type": "application/octet-stream"}


@dataclass
class Use:
    """Everything that was done, and what was not answered as it should be.

    Parameters
    ----------
    address : str
    rest : callable
        Called between two things that are done.
    archive : bytes
        Of a small cell with scans.
    """

    address: str
    rest: Callable[[], None]
    archive: bytes
    done: Counter[str] = field(default_factory=Counter[str])
    wrong: list[str] = field(default_factory=list[str])
    _random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(17))

    def round(self, number: int) -> None:
        """Do everything once, a merge in every eighth round; nothing is left of it."""
        scenario = ("tcp", "turntable", "tcp-sweep", "tcp-clouds")[number % 4]
        with self._client(600) as client:
            session = self._new_session(client, scenario, number)
            with self._listening(session):
                self._upload(client, session, simulate(scenario, 1 + number % 5))
                self._solve(client, session)
                self._cancel(client, session)
                self._read(client, session)
                self._download(client, session)
                self._look(client, session)
                self._change(client, session)
            self._misuse(client, session)
            self._archives(client, session, with_scans=number % 8 == 0)
            self._webhook(client)
            self._expect(client, 204, "DELETE", f"/api/v1/sessions/{session}")

    def many_at_once(self) -> None:
        """Have every process and every connection of the server be needed once: each opens its files then."""
        numbers = range(_AT_ONCE)
        with self._client(600) as client, ThreadPoolExecutor(_AT_ONCE) as threads:
            made = [self._new_session(client, "tcp", number) for number in numbers]
            cell = simulate("tcp", 1)
            for each in [threads.submit(self._one_of_many, session, cell) for session in made]:
                each.result()

    def _one_of_many(self, session: str, cell: SimulatedSession) -> None:
        with self._client(600) as client:
            self._upload(client, session, cell)
            self._solve(client, session)
            for path in _READ:
                self._expect(client, 200, "GET", f"/api/v1/sessions/{session}{path}")
            self._expect(client, 204, "DELETE", f"/api/v1/sessions/{session}")

    def _new_session(self, client: httpx.Client, scenario: str, number: int) -> str:
        cell = simulate(scenario, 1).session.cell.to_json()
        body = {"name": f"soak {number}", "cell": {**cell, "id": "soak"}}
        return self._expect(client, 201, "POST", "/api/v1/sessions", json=body).json()["id"]

    def _upload(self, client: httpx.Client, session: str, cell: SimulatedSession) -> None:
        place = f"/api/v1/sessions/{session}/captures"
        captures = cell.session.captures
        batch = b""
        for number, capture in enumerate(captures):
            record = capture.to_json()
            contents = [cell.files[name] for name in capture.files]
            if number % 3 or len(contents) != 1:
                batch += json.dumps({**record, "sizes": [len(content) for content in contents]}).encode() + b"\n"
                batch += b"".join(contents)
                continue
            headers = {**_FORM, "Idempotency-Key": f"k{number}-{session}"}
            form = capture_form(record, contents[0])
            for _ in range(2 if number == 0 else 1):
                self._expect(client, 201, "POST", place, content=form, headers=headers)
        if batch:
            sent = self._expect(client, 200, "POST", f"{place}/batch", content=batch, headers=_BYTES)
            stored = all(item["status"] == 201 for item in sent.json()["items"])
            self._must(stored, f"batch: {sent.text[:300]}")

    def _solve(self, client: httpx.Client, session: str) -> None:
        job = self._expect(client, 200, "POST", f"/api/v1/sessions/{session}/solve/all?wait=120").json()
        self._must(job["status"] == "done", f"solve: {job}")

    def _cancel(self, client: httpx.Client, session: str) -> None:
        job = self._expect(client, 202, "POST", f"/api/v1/sessions/{session}/solve/tcp").json()["id"]
        time.sleep(float(self._random.uniform(0, 0.3)))
        cancelled = client.post(f"/api/v1/jobs/{job}/cancel")
        self.done["POST /api/v1/jobs/…/cancel"] += 1
        # A solve that was quicker than the wish to cancel it has nothing left to cancel.
        self._must(cancelled.status_code in (200, 409), f"cancel: {cancelled.text[:300]}")
        ended = client.get(f"/api/v1/jobs/{job}").json()
        end_s = time.monotonic() + 30
        while ended["status"] not in ("done", "cancelled") and time.monotonic() < end_s:
            time.sleep(0.2)
            ended = client.get(f"/api/v1/jobs/{job}").json()
        self._must(ended["status"] in ("done", "cancelled"), f"cancel: {ended}")

    def _read(self, client: httpx.Client, session: str) -> None:
        for path in _READ:
            self._expect(client, 200, "GET", f"/api/v1/sessions/{session}{path}")
        tag = self._expect(client, 200, "GET", f"/api/v1/sessions/{session}").headers["etag"]
        self._expect(client, 304, "GET", f"/api/v1/sessions/{session}", headers={"If-None-Match": tag})
        for path in (
            *_PAGES,
            f"/sessions/{session}",
            f"/sessions/{session}/review",
            "/api/v1/sessions",
            "/api/v1/jobs",
        ):
            self._expect(client, 200, "GET", path)

    def _download(self, client: httpx.Client, session: str) -> None:
        for export in self._expect(client, 200, "GET", "/api/v1/exports").json()["items"]:
            answer = client.get(f"/api/v1/sessions/{session}/exports/{export['name']}?allow=stale,fail")
            self.done["export"] += 1
            self._must(answer.status_code in (200, 404, 409, 422), f"export {export['name']}: {answer.text[:200]}")
        self.rest()
        self._expect(client, 200, "GET", f"/api/v1/sessions/{session}/report")

    def _look(self, client: httpx.Client, session: str) -> None:
        """Look at the scene as a page does, at its picture, and take it along."""
        self._expect(client, 200, "GET", f"/scenes/{session}/")
        try:
            with self._scene(session, self.address) as socket:
                received = len(socket.recv(timeout=30))
                self._must(received > 1000, f"scene: {received} bytes")
                self._expect(client, 204, "POST", f"/scenes/{session}/highlight", json={"capture": "p01"})
        except (WebSocketException, OSError) as error:
            self._must(False, f"scene: {error}")
        self.done["scene"] += 1
        self._expect(client, 200, "GET", f"/scenes/{session}/picture")
        self._expect(client, 200, "GET", f"/scenes/{session}/page")

    def _change(self, client: httpx.Client, session: str) -> None:
        captures = client.get(f"/api/v1/sessions/{session}/captures").json()["items"]
        place = f"/api/v1/sessions/{session}/captures/{captures[0]['id']}"
        for excluded in (True, False):
            self._expect(client, 200, "PATCH", place, json={"excluded": excluded})
            self._expect(client, 200, "GET", f"/api/v1/sessions/{session}/results")
        self._expect(client, 204, "DELETE", place)

    def _misuse(self, client: httpx.Client, session: str) -> None:
        """Send what is wrong in many ways, and hang up in the middle."""
        place = f"/api/v1/sessions/{session}"
        record = {"id": "bad", "step": "tcp", "kind": "profile", "pose": [0, 0, 0, 0, 0, 0]}
        noise = capture_form(record, b"\x00\xff" * 5000)
        self._expect(client, 422, "PATCH", place, json={"cel": {}})
        self._expect(client, 422, "PATCH", place, content=b'{"name": NaN}', headers=_JSON)
        self._expect(client, 415, "PATCH", place, content=b"name: soak", headers={"Content-Type": "text/yaml"})
        self._expect(client, 422, "POST", f"{place}/captures", content=noise, headers=_FORM)
        cut = self.archive[:20_000]
        self._expect(client, 422, "POST", "/api/v1/archives", content=cut, headers=_ZIP)
        self._expect(client, 404, "GET", "/api/v1/sessions/none")
        self._expect(client, 405, "DELETE", "/api/v1/stages")
        self._expect(client, 422, "POST", f"{place}/solve/none")

        def half() -> Iterator[bytes]:
            yield capture_form(record, b"0,0\n" * 500)[:1000]
            raise InterruptedError

        with suppress(InterruptedError), self._client() as other:
            other.post(f"{place}/captures", content=half(), headers=_FORM)
        with suppress(WebSocketException), self._scene(session, "http://elsewhere.example") as socket:
            socket.recv(timeout=5)
            self._must(False, "a page from elsewhere sees the scene")
        self.done["misuse"] += 2

    def _archives(self, client: httpx.Client, session: str, with_scans: bool) -> None:
        archive = self._expect(client, 200, "GET", f"/api/v1/sessions/{session}/archive").content
        self._expect(client, 200, "POST", "/api/v1/archives/verify", content=archive, headers=_ZIP)
        content = self.archive if with_scans else archive
        made = self._expect(client, 201, "POST", "/api/v1/archives", content=content, headers=_ZIP).json()["id"]
        if with_scans:
            self._solve(client, made)
            for name in ("merged.ply", "merged.e57"):
                self._expect(client, 200, "GET", f"/api/v1/sessions/{made}/clouds/{name}")
            self._expect(client, 200, "GET", f"/api/v1/sessions/{made}/merged/section?at_mm=20")
            self._look(client, made)
        else:
            job = self._expect(client, 202, "POST", f"/api/v1/sessions/{made}/replay").json()["id"]
            ended = self._expect(client, 200, "GET", f"/api/v1/jobs/{job}?wait=60").json()
            self._must(ended["status"] == "done", f"replay: {ended}")
        self._expect(client, 204, "DELETE", f"/api/v1/sessions/{made}")

    def _webhook(self, client: httpx.Client) -> None:
        """Have a program told that is not there."""
        hook = {"url": "http://127.0.0.1:9/"}
        made = self._expect(client, 201, "POST", "/api/v1/webhooks", json=hook).json()["id"]
        self._expect(client, 202, "POST", f"/api/v1/webhooks/{made}/ping")
        self._expect(client, 204, "DELETE", f"/api/v1/webhooks/{made}")

    @contextmanager
    def _listening(self, session: str) -> Iterator[None]:
        """Follow a session's events as two open pages do, meanwhile."""
        ended = threading.Event()

        def listen() -> None:
            with (
                suppress(httpx.TransportError),
                httpx.Client(base_url=self.address, trust_env=False, timeout=20) as client,
            ):
                while not ended.is_set():
                    with client.stream("GET", f"/api/v1/sessions/{session}/events") as answer:
                        for line in answer.iter_lines():
                            self.done["event"] += line.startswith("data")
                            if ended.is_set():
                                return

        listeners = [threading.Thread(target=listen, daemon=True) for _ in range(2)]
        for listener in listeners:
            listener.start()
        try:
            yield
        finally:
            ended.set()
            with self._client() as client:  # wakes them
                self._expect(client, 200, "PATCH", f"/api/v1/sessions/{session}", json={"name": "soaked"})
            for listener in listeners:
                listener.join(timeout=30)

    def _client(self, timeout_s: float = 10.0) -> httpx.Client:
        return httpx.Client(base_url=self.address, trust_env=False, timeout=timeout_s)

    def _scene(self, session: str, origin: str) -> Any:
        return connect(
            f"ws://{self.address.removeprefix('http://')}/scenes/{session}/",
            subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
            additional_headers={"Origin": origin},
            proxy=None,
            max_size=None,
        )

    def _expect(self, client: httpx.Client, status: int, method: str, path: str, **more: Any) -> httpx.Response:
        answer = client.request(method, path, **more)
        self.done[f"{method}"] += 1
        self._must(
            answer.status_code == status,
            f"{method} {path}: {answer.status_code}, not {status}: {answer.text[:300]}",
        )
        self.rest()
        return answer

    def _must(self, holds: bool, otherwise: str) -> None:
        if not holds:
            self.wrong.append(otherwise)
            print(f"    {otherwise}", flush=True)
