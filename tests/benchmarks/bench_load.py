"""The workbench under load: fifty machines that send two captures a second each, beside an open page."""

import json
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Generator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil
from harness import Row

from calib_core.simulation import simulate

CLIENTS, PER_S = 50, 2.0
_STARTS_S = 120.0


@contextmanager
def served(data: Path) -> Generator[tuple[str, psutil.Process]]:
    """Give the address of a server in a process of its own, warm, and that process."""
    command = [sys.executable, "-m", "server.cli", "serve", "--port", "0", "--data", str(data)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    assert process.stdout is not None
    try:
        address = next(word for word in process.stdout.readline().split() if word.startswith("http"))
        with httpx.Client(base_url=f"{address}/api/v1", trust_env=False, timeout=_STARTS_S) as client:
            while client.get("/health").json()["status"] != "ready":
                time.sleep(0.2)
        yield address, psutil.Process(process.pid)
    finally:
        process.terminate()
        with suppress(subprocess.TimeoutExpired):  # a busy machine: what went wrong before is what is told
            process.wait(timeout=_STARTS_S)
        process.kill()


class Watch(threading.Thread):
    """Notes each second how much memory a process and its children hold, and how much processor they use."""

    def __init__(self, process: psutil.Process) -> None:
        super().__init__(daemon=True)
        self._process = process
        self._end = threading.Event()
        self.memory_mb: list[float] = []
        self.service_s = self.others_s = 0.0

    def run(self) -> None:
        before_s = self._cpu_s()
        while not self._end.wait(1.0):
            self.memory_mb.append(sum(p.memory_info().rss for p in self._all()) / 1e6)
        now_s = self._cpu_s()
        self.service_s, self.others_s = now_s[0] - before_s[0], now_s[1] - before_s[1]

    def stop(self) -> None:
        self._end.set()
        self.join()

    def growth_mb(self) -> float:
        """Return how much more is held in the last quarter than in the second one."""
        quarter = max(1, len(self.memory_mb) // 4)
        return statistics.median(self.memory_mb[-quarter:]) - statistics.median(
            self.memory_mb[quarter : 2 * quarter]
        )

    def _all(self) -> list[psutil.Process]:
        return [self._process, *self._process.children(recursive=True)]

    def _cpu_s(self) -> tuple[float, float]:
        """Return what the service itself has used, and what its other processes have."""
        used_s = [times.user + times.system for times in (p.cpu_times() for p in self._all())]
        return used_s[0], sum(used_s[1:])


@contextmanager
def open_page(address: str, session: str, with_scene: bool) -> Generator[list[str]]:
    """Have a browser look at a session meanwhile; gives what its page complains about."""
    from playwright.sync_api import sync_playwright

    from tests.web.browsing import CHROMIUM, Watched, leave_out_the_scene

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        context = browser.new_context()
        if not with_scene:
            leave_out_the_scene(context)
        page = context.new_page()
        watched = Watched(page)
        page.goto(f"{address}/sessions/{session}")
        page.wait_for_timeout(2000)
        yield watched.complaints
        browser.close()


def new_sessions(address: str, count: int) -> list[str]:
    """Make sessions of the simulated cell's cell and return their ids."""
    with httpx.Client(base_url=f"{address}/api/v1", trust_env=False, timeout=30) as api:
        cell = simulate("tcp", 1).session.cell.to_json()
        return [api.post("/sessions", json={"cell": cell}).json()["id"] for _ in range(count)]


def clients(address: str, **arguments: Any) -> dict[str, Any]:
    """Let clients send from a process of their own, and return what became of it."""
    host, port = address.removeprefix("http://").split(":")
    command = [sys.executable, str(Path(__file__).with_name("load_clients.py"))]
    arguments = {"host": host, "port": int(port), **arguments}
    out = subprocess.run([*command, json.dumps(arguments)], stdout=subprocess.PIPE, check=True).stdout
    return json.loads(out)


def loaded(address: str, process: psutil.Process, seconds: float, page: bool, scene: bool) -> dict[str, Any]:
    """Send captures for so many seconds and return what came of it."""
    sessions = new_sessions(address, CLIENTS)
    with open_page(address, sessions[0], scene) if page else nullcontext([]) as complaints:
        watch = Watch(process)
        watch.start()
        found = clients(address, sessions=sessions, per_s=PER_S, seconds=seconds)
        watch.stop()
    with httpx.Client(base_url=f"{address}/api/v1", trust_env=False, timeout=30) as api:
        stored = sum(len(api.get(f"/sessions/{session}").json()["captures"]) for session in sessions)
    return {**found, "complaints": complaints, "watch": watch, "stored": stored}


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` takes the two minutes of the target."""
    seconds = 120.0 if full else 12.0
    with tempfile.TemporaryDirectory() as folder, served(Path(folder) / "data") as (address, process):
        rows = capture_rows(loaded(address, process, seconds, page=True, scene=False), seconds)
        return [*rows, batch_row(address, 5000 if full else 1000)]


def batch_row(address: str, captures: int) -> Row:
    """Return how many profiles a second one request brings in, each on the disk when it is answered."""
    (session,) = new_sessions(address, 1)
    found = clients(address, session=session, captures=captures)
    (seconds,) = found["durations_s"]
    for error in found["errors"]:
        print(f"  {error}")
    rate = captures / seconds
    holds = rate >= 1000 and not found["errors"]
    return Row(f"one batch of {captures} profiles", "≥ 1,000 a second", f"{rate:.0f} a second", holds)


def capture_rows(found: dict[str, Any], seconds: float) -> list[Row]:
    """Return the figures of the captures."""
    durations_ms = sorted(1e3 * s for s in found["durations_s"])
    errors = [*found["errors"], *found["complaints"]]
    expected = int(CLIENTS * PER_S * seconds)
    p99_ms = durations_ms[int(0.99 * len(durations_ms))]
    p50_ms = statistics.median(durations_ms)
    watch: Watch = found["watch"]
    service_ms, others_ms, clients_ms = (
        1e3 * used_s / expected for used_s in (watch.service_s, watch.others_s, found["processor_s"])
    )
    peak_mb, growth_mb = max(watch.memory_mb), watch.growth_mb()
    what = f"{CLIENTS} clients × {PER_S:g} captures/s, {seconds:g} s"
    print(f"  longest {durations_ms[-1]:.0f} ms, clients late by at most {1e3 * found['late_s']:.0f} ms")
    for error in errors[:5]:
        print(f"  {error}")
    whole = not errors and found["stored"] == expected
    return [
        Row(f"{what}: errors", "none", f"{len(errors)}, {found['stored']} stored of {expected}", whole),
        Row(f"{what}: p99", "< 250 ms", f"{p99_ms:.0f} ms, median {p50_ms:.0f} ms", p99_ms < 250),
        Row(
            "processor, a capture",
            "",
            f"{service_ms:.1f} ms, {others_ms:.1f} ms measuring; {clients_ms:.1f} ms sending",
        ),
        Row("memory", "flat", f"{peak_mb:.0f} MB, {growth_mb:+.0f} MB over the run", growth_mb < 40),
    ]
