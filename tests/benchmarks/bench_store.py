"""A store of many sessions: list, open, search through the real server, p95 of each request."""

import json
import sqlite3
import tempfile
import time
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from harness import Row
from kill_server import ServerProcess

from calib_core.simulation import simulate
from server.measuring import measure
from server.settings import Settings
from server.store.models import folded
from server.store.store_lock import store_lock

_TARGET_MS = 100.0
_CAPTURES = 100  # of each session
_WORDS = ("Zelle", "Roboter", "Linie", "Prüfstand", "Halle", "Schicht")


def run(full: bool) -> list[Row]:
    """Fill a store with 10,000 sessions of 100 captures (300 without --full), and time requests."""
    sessions, rounds = (10_000, 200) if full else (300, 40)
    with tempfile.TemporaryDirectory(prefix="scancell-store-") as folder:
        data = Path(folder)
        start_s = time.perf_counter()
        ids = fill(data, sessions)
        size = (data / "scancell.db").stat().st_size / 1e9
        filled = f"{time.perf_counter() - start_s:.0f} s, {size:.1f} GB"
        server = ServerProcess(data).wait()
        try:
            with server.client() as client:
                times = {name: _times(client, request, rounds) for name, request in _requests(ids).items()}
        finally:
            server.kill()
    rows = [Row(f"{sessions} sessions, {sessions * _CAPTURES} captures", "", filled)]
    for name, taken in times.items():
        p95, median = np.percentile(taken, 95), np.median(taken)
        rows.append(
            Row(
                f"{name}, p95",
                f"< {_TARGET_MS:g} ms",
                f"{p95:.1f} ms (median {median:.1f})",
                bool(p95 < _TARGET_MS),
            )
        )
    return rows


def fill(data: Path, sessions: int) -> list[str]:
    """Fill a data folder with sessions of a simulated cell, each with 100 captures; return their ids."""
    with store_lock(Settings(data=data)):
        pass
    simulated = simulate("tcp", 1)
    record = simulated.session.to_json()
    taken = [record["captures"][n % len(record["captures"])] for n in range(_CAPTURES)]
    measured = [
        json.dumps(measure(simulated.session, capture, simulated.files.__getitem__).to_json())
        for capture in simulated.session.captures
    ]
    captures = [
        json.dumps({**capture, "id": f"p{n}", "files": [f"captures/p{n}.csv"]}) for n, capture in enumerate(taken)
    ]
    del record["captures"]
    ids = [f"{number * 2654435761 % 2**64:016x}" for number in range(sessions)]
    database = sqlite3.connect(data / "scancell.db", isolation_level=None)
    database.execute("PRAGMA synchronous=OFF")
    for first in range(0, sessions, 100):
        database.execute("BEGIN")
        for number in range(first, min(first + 100, sessions)):
            _insert(database, ids[number], number, record, captures, measured)
        database.execute("COMMIT")
    database.close()
    return ids


def _insert(
    database: sqlite3.Connection, session: str, number: int, record: Any, captures: list[str], measured: list[str]
) -> None:
    name = f"{_WORDS[number % len(_WORDS)]} {number}"
    moment = f"2026-{number % 12 + 1:02d}-{number % 28 + 1:02d}T{number % 24:02d}:00:00.000Z"
    database.execute(
        "INSERT INTO sessions (id, name, name_folded, created, updated, revision, last_event, last_position,"
        " record) VALUES (?, ?, ?, ?, ?, 101, 0, 100, ?)",
        (session, name, folded(name), moment, moment, json.dumps({**record, "name": name})),
    )
    database.executemany(
        "INSERT INTO captures (session_id, id, position, revision, created, record, measured)"
        " VALUES (?, ?, ?, 1, ?, ?, ?)",
        [
            (session, f"p{n}", n + 1, moment, capture, measured[n % len(measured)])
            for n, capture in enumerate(captures)
        ],
    )
    database.executemany(
        "INSERT INTO files (session_id, capture_id, name, sha256, size) VALUES (?, ?, ?, ?, 8000)",
        [
            (session, f"p{n}", f"captures/p{n}.csv", sha256(f"{session} {n}".encode()).hexdigest())
            for n in range(len(captures))
        ],
    )


Check = Callable[[Any], bool]
Request = tuple[str, dict[str, Any], Check]


def _requests(ids: list[str]) -> dict[str, Callable[[Any], Request]]:
    """Return what the pages ask, each time for another session; each is given the answer before."""
    random = np.random.default_rng(3)

    def path(end: str = "") -> str:
        return f"/sessions/{ids[random.integers(len(ids))]}{end}"

    def next_page(before: Any) -> Request:
        cursor = {"cursor": before["next"]} if before and before["next"] else {}
        return "/sessions", cursor, lambda page: page["items"][0]["capture_count"] == _CAPTURES

    def search_one(_: Any) -> Request:
        number = int(random.integers(len(ids)))
        words = f"{_WORDS[number % len(_WORDS)].upper()} {number}"
        return "/sessions", {"search": words}, lambda page: 0 < len(page["items"]) <= 50

    def search_none(_: Any) -> Request:
        return "/sessions", {"search": f"nothing {random.integers(10**9)}"}, lambda page: page["items"] == []

    def captures(_: Any) -> Request:
        return path("/captures"), {"limit": _CAPTURES}, lambda page: len(page["items"]) == _CAPTURES

    return {
        "list: the newest 50": lambda _: ("/sessions", {}, lambda page: len(page["items"]) == 50),
        "list: the next 50, through them all": next_page,
        "search: one of many": search_one,
        "search: a word of a sixth of all": lambda _: ("/sessions", {"search": "prüf"}, bool),
        "search: nothing found": search_none,
        "open: the session": lambda _: (path(), {}, lambda record: len(record["captures"]) == _CAPTURES),
        "open: its captures with what was measured": captures,
        "open: its guide": lambda _: (path("/guide"), {}, bool),
        "open: its results": lambda _: (path("/results"), {}, lambda results: results == {}),
    }


def _times(client: httpx.Client, request: Callable[[Any], Request], rounds: int) -> list[float]:
    """Return how long each of many requests took, in milliseconds, after a first one that imports."""
    taken: list[float] = []
    answer: Any = None
    for _ in range(rounds + 1):
        path, parameters, is_right = request(answer)
        start_s = time.perf_counter()
        got = client.get(path, params=parameters)
        taken.append(1000 * (time.perf_counter() - start_s))
        assert got.status_code == 200, got.text
        answer = got.json()
        assert is_right(answer), path
    return taken[1:]
