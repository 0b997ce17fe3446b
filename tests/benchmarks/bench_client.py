"""Our client while the server is killed and started again: no capture fails, none is lost, none is there twice."""

import tempfile
import threading
import time
from collections.abc import Sized
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from bench_outages import arc
from harness import Row
from kill_load import CELL
from kill_server import ServerProcess

from scancell_client import Scancell

_CLIENTS, _LONGEST_S = 30, 120.0


def run(full: bool) -> list[Row]:
    """Kill the server twenty times (twice without `full`) under thirty captures at once."""
    times = 20 if full else 2
    stop, failed, added = threading.Event(), list[str](), dict[str, bytes]()

    def add(api: Scancell, session: str, of: int) -> None:
        number = 0
        while not stop.is_set():
            number += 1
            name, content = f"c{of:02d}-{number:04d}", arc(1000 * of + number)
            record = {"id": name, "step": "tcp", "kind": "profile", "pose": [600, 0, 500, 180, 0, 0]}
            try:
                api.captures_add(session, {**record, "files": [f"{name}.csv"]}, {f"{name}.csv": content})
            except Exception as error:
                failed.append(f"{name}: {error!r}")
            else:
                added[name] = content

    random = np.random.default_rng(23)
    with tempfile.TemporaryDirectory(prefix="scancell-killed-") as folder:
        data = Path(folder) / "data"
        server = ServerProcess(data, forked=True).wait()
        port = int(server.address.rsplit(":", 1)[1])
        with Scancell(server.address, trust_env=False) as api, ThreadPoolExecutor(_CLIENTS) as pool:
            session = api.sessions_create({"name": "killed", "cell": CELL})["id"]
            ended = [pool.submit(add, api, session, of) for of in range(_CLIENTS)]
            for _ in range(times):
                _until_more(added, failed)
                time.sleep(random.uniform(0.0, 1.0))
                server.kill()
                time.sleep(random.uniform(0.0, 2.0))
                server = ServerProcess(data, forked=True, port=port).wait()
            stop.set()
            for one in ended:
                one.result()
            lost = [
                name
                for name, content in added.items()
                if api.captures_get_file(session, name, f"{name}.csv") != content
            ]
            listed, cursor = list[str](), None
            while cursor != "":
                page = api.captures_list_all(session, limit=200, cursor=cursor)
                listed += [one["id"] for one in page["items"]]
                cursor = page.get("next") or ""
        server.kill()
    for line in [*failed, *lost][:10]:
        print(f"    {line}", flush=True)
    what = f"server killed {times} times under {_CLIENTS} parallel captures of our client"
    twice = len(listed) - len(set(listed)) + len(set(listed) ^ set(added))
    measured = f"{len(failed)} failed, {len(lost)} lost, {twice} twice or unasked for, of {len(added):,}"
    return [Row(what, "0 failed, 0 lost", measured, not (failed or lost or twice))]


def _until_more(*counted: Sized) -> None:
    """Wait until the clients have got on since the last kill."""
    before, end_s = sum(map(len, counted)), time.monotonic() + _LONGEST_S
    while sum(map(len, counted)) < before + _CLIENTS and time.monotonic() < end_s:
        time.sleep(0.05)
