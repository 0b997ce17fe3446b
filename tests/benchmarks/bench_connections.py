"""One address holds hundreds of connections and sends byte by byte: how soon others and health are answered."""

import selectors
import socket
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import numpy as np
from bench_load import served
from harness import Row

SLOW = 900
_OF_ALL = "127.0.0.2"  # whose connections are slow; others come from 127.0.0.1
_HEAD = b"GET /api/v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: "
_BODY = (
    b"POST /api/v1/sessions HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    b"Content-Length: 60000\r\n\r\n"
)
_MOST_S, _ANEW_PER_S = 1.0, 50


def run(full: bool) -> Iterator[Row]:
    """Yield how long others wait: alone, then beside slow heads and bodies; 1,000 requests each with `full`."""
    count = 1000 if full else 200
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "data") as (address, _):
        alone = asked(address, "127.0.0.1", "/sessions", count)
        yield Row("sessions asked for, no other connection: p50, p99", "", _shown(alone))
        for what, begins in (("heads", _HEAD), ("bodies", _BODY)):
            with_slow = Slow(address, begins)
            try:
                for who, source, path in (
                    ("others", "127.0.0.1", "/sessions"),
                    ("health, same address", _OF_ALL, "/health"),
                ):
                    waits_s = asked(address, source, path, count)
                    name = f"{SLOW} connections of one address with slow {what} ({with_slow.held()} held): {who}"
                    holds = len(waits_s) == count and float(np.percentile(waits_s, 99)) <= _MOST_S
                    yield Row(f"{name}: p50, p99", f"≤ {_MOST_S:g} s", _shown(waits_s, count), holds)
            finally:
                with_slow.stop()


def asked(address: str, source: str, path: str, count: int) -> list[float]:
    """Return how long each request took that was answered as it should be."""
    waits_s: list[float] = []
    for _ in range(count):
        transport = httpx.HTTPTransport(local_address=source)
        begun_s = time.perf_counter()
        with (
            suppress(httpx.TransportError),
            httpx.Client(base_url=f"{address}/api/v1", transport=transport, trust_env=False, timeout=10) as client,
        ):
            if client.get(path).status_code == 200:
                waits_s.append(time.perf_counter() - begun_s)
        time.sleep(0.02)
    return waits_s


def _shown(waits_s: list[float], count: int = 0) -> str:
    p50_s, p99_s = np.percentile(waits_s or [np.inf], [50, 99])
    lost = f"; {count - len(waits_s)} not answered" if len(waits_s) < count else ""
    return f"{1000 * p50_s:.0f}, {1000 * p99_s:.0f} ms{lost}"


class Slow(threading.Thread):
    """Holds connections open from one address, a byte a second on each; fifty a second come anew."""

    def __init__(self, address: str, begins: bytes) -> None:
        super().__init__(daemon=True)
        parts = urlsplit(address)
        self._place = str(parts.hostname), int(parts.port or 80)
        self._begins = begins
        self._open: list[socket.socket] = []
        self._end, self._began = threading.Event(), threading.Event()
        self.start()
        self._began.wait()

    def held(self) -> int:
        """Return how many the server has not closed."""
        with selectors.DefaultSelector() as selector:
            for one in list(self._open):
                with suppress(ValueError, OSError):
                    selector.register(one, selectors.EVENT_READ)
            return len(self._open) - len(selector.select(0))

    def run(self) -> None:
        while not self._end.is_set():
            self._open = [one for one in self._open if self._goes_on(one)]
            for _ in range(_ANEW_PER_S if self._began.is_set() else SLOW):
                if len(self._open) >= SLOW:
                    break
                with suppress(OSError):
                    one = socket.create_connection(self._place, timeout=5, source_address=(_OF_ALL, 0))
                    one.sendall(self._begins)
                    one.setblocking(False)
                    self._open.append(one)
            self._began.set()
            self._end.wait(1.0)

    def _goes_on(self, one: socket.socket) -> bool:
        try:
            one.send(b"a")
            return bool(one.recv(1))
        except BlockingIOError:
            return True
        except OSError:
            pass
        one.close()
        return False

    def stop(self) -> None:
        """Close them all."""
        self._end.set()
        self.join()
        for one in self._open:
            one.close()
