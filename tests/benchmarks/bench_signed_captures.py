"""What signing costs who captures: twenty captures a second, to a server that signs them and to one that does not.

Both servers are real processes on one disk; they take turns, so that what else the machine does meets both alike.
"""

import sqlite3
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import httpx
import numpy as np
from bench_outages import arc
from harness import Row
from kill_load import CELL, Sent, send
from kill_server import ServerProcess

_EVERY_S = 0.05
_PROGRAMS = {"signed": "server.cli", "not signed": "tests.benchmarks.unsigned_server"}


def run(full: bool) -> list[Row]:
    """Send bursts of twenty captures in turns: 30 to each server with `full`, else 6."""
    took_s: dict[str, list[float]] = {name: [] for name in _PROGRAMS}
    with tempfile.TemporaryDirectory(prefix="scancell-signed-") as folder, ExitStack() as opened:
        clients: dict[str, tuple[httpx.Client, str]] = {}
        for name, program in _PROGRAMS.items():
            server = ServerProcess(Path(folder) / name.replace(" ", "-"), program=(program,)).wait()
            opened.callback(server.kill)
            client = opened.enter_context(server.client())
            clients[name] = client, client.post("/sessions", json={"name": name, "cell": CELL}).json()["id"]
        for burst in range(-1, 30 if full else 6):
            for name, (client, session) in clients.items():
                found = _burst(client, session, burst)
                took_s[name] += found if burst >= 0 else []  # the first warms both up
        for name in _PROGRAMS:
            with sqlite3.connect(Path(folder) / name.replace(" ", "-") / "scancell.db") as db:
                (seals,) = db.execute("SELECT count(seal) FROM captures").fetchone()
            db.close()
            assert bool(seals) == (name == "signed"), (name, seals)
    signed, unsigned = (1000 * np.array(took_s[name]) for name in _PROGRAMS)
    (p50, p95), (without_50, without_95) = (np.percentile(one, [50, 95]) for one in (signed, unsigned))
    more = float(np.median(signed - unsigned))
    what = f"{len(signed)} captures at 20 a second, signed; not signed: answered after, median and p95"
    told = f"{p50:.1f}, {p95:.1f}; {without_50:.1f}, {without_95:.1f} ms; in pairs {more:+.1f} ms"
    return [Row(what, "≤ 5 ms more", told, more <= 5.0)]


def _burst(client: httpx.Client, session: str, burst: int) -> list[float]:
    """Send twenty captures, one each 50 ms, and return how long each took until it was acknowledged."""
    took_s: list[float] = []
    for k in range(20):
        number = 20 * (burst + 1) + k
        begun_s = time.monotonic()
        answer = send(client, Sent(f"{session}-{number}", session, f"p{number}", arc(number)))
        took_s.append(time.monotonic() - begun_s)
        assert answer.status_code == 201, answer.text
        time.sleep(max(0.0, _EVERY_S - took_s[-1]))
    return took_s
