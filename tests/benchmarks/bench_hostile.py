"""Thousands of altered files and records sent to a real server: what may not happen, and how often it did."""

import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import psutil
from harness import Row
from mutations import altered, altered_archive, clouds, images, profiles, session_record

from tests.server.access import ROLES, bearer, guarded

_POSE = [-195.8, 1363.305, 524.812, -179.924, 0.889, 179.635]
_CELL = {
    "pose_convention": "fanuc",
    "sphere_diameter_mm": 40.0,
    "board": {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 25.0},
}
_PER_SESSION = 40
_THREADS = 4
_HANG_S = 10.0
_MAX_MB = 1000.0


@dataclass
class Trials:
    """What came of them: how many of each kind, the statuses, the worst duration, and what may not be."""

    kinds: Counter[str] = field(default_factory=Counter[str])
    statuses: Counter[int] = field(default_factory=Counter[int])
    longest_s: float = 0.0
    faults: list[str] = field(default_factory=list)

    def note(self, kind: str, answer: httpx.Response, seconds: float) -> None:
        """Take in one answer."""
        self.kinds[kind] += 1
        self.statuses[answer.status_code] += 1
        self.longest_s = max(self.longest_s, seconds)
        if answer.status_code >= 500:
            asked = f"{answer.request.method} {answer.request.url.path}"
            self.faults.append(f"{kind}: {asked}: {answer.status_code} {answer.text[:600]}")
        elif answer.status_code >= 400 and answer.headers["content-type"] != "application/problem+json":
            self.faults.append(f"{kind}: {answer.status_code} without problem details")
        if seconds > _HANG_S:
            self.faults.append(f"{kind}: {seconds:.1f} s")


def _capture(kind: str, step: str, files: Callable[[], Mapping[str, bytes]]) -> Callable[..., httpx.Response]:
    def send(api: httpx.Client, session: str, number: int, chance: random.Random) -> httpx.Response:
        name, content = chance.choice(list(files().items()))
        record: dict[str, object] = {
            "id": f"c{number}",
            "step": step,
            "kind": kind,
            "files": [f"captures/{number}-{name}"],
        }
        parts = {
            "record": (None, json.dumps({**record, "pose": _POSE})),
            "files": (name, altered(content, chance)),
        }
        return api.post(f"/sessions/{session}/captures", files=parts)

    return send


def _record(api: httpx.Client, session: str, number: int, chance: random.Random) -> httpx.Response:
    captures = json.loads(session_record())["captures"]
    data = altered(json.dumps({**chance.choice(captures), "id": f"r{number}"}).encode(), chance)
    content = chance.choice(list(profiles().values()))
    return api.post(f"/sessions/{session}/captures", files={"record": (None, data), "files": ("p.csv", content)})


def _batch(api: httpx.Client, session: str, number: int, chance: random.Random) -> httpx.Response:
    body = b""
    for part in range(chance.randint(1, 4)):
        content = chance.choice(list(profiles().values()))[:2000]
        record = {"id": f"b{number}-{part}", "step": "tcp", "kind": "profile", "files": [f"{number}-{part}.csv"]}
        body += json.dumps({**record, "pose": _POSE, "sizes": [len(content)]}).encode() + b"\n" + content
    return api.post(f"/sessions/{session}/captures/batch", content=altered(body, chance))


def _session(api: httpx.Client, _: str, __: int, chance: random.Random) -> httpx.Response:
    data = json.loads(session_record())
    data["captures"] = data["captures"][: chance.randint(0, 1)]
    content = altered(json.dumps(data).encode(), chance)
    return api.post("/sessions", content=content, headers={"Content-Type": "application/json"})


def _archive(api: httpx.Client, _: str, __: int, chance: random.Random) -> httpx.Response:
    path = chance.choice(("/archives", "/archives/verify"))
    return api.post(path, content=altered_archive(chance), headers={"Content-Type": "application/zip"})


KINDS: dict[str, Callable[..., httpx.Response]] = {
    "profile": _capture("profile", "tcp", profiles),
    "cloud": _capture("cloud", "tcp", clouds),
    "image": _capture("frame", "camera", images),
    "image of the sphere": _capture("frame", "tcp", images),
    "capture record": _record,
    "batch": _batch,
    "session file": _session,
    "archive": _archive,
}


def attack(api: httpx.Client, count: int, seed: int = 0) -> Trials:
    """Send so many altered things, of all kinds in turn, and then look at everything that was stored."""
    trials = Trials()

    def one(number: int) -> None:
        chance = random.Random(f"{seed} {number}")
        kind = list(KINDS)[number % len(KINDS)]
        began_s = time.perf_counter()
        try:
            answer = KINDS[kind](api, sessions[number // _PER_SESSION], number, chance)
        except httpx.TransportError as error:
            trials.faults.append(f"{kind} {number}: {type(error).__name__} {error}")
            return
        trials.note(kind, answer, time.perf_counter() - began_s)

    sessions = [
        api.post("/sessions", json={"name": "attacked", "cell": _CELL}).json()["id"]
        for _ in range(-(-count // _PER_SESSION))
    ]
    with ThreadPoolExecutor(_THREADS) as threads:
        list(threads.map(one, range(count)))
    for path in _stored(api):
        trials.note("what was stored", api.get(path), 0.0)
    return trials


def _stored(api: httpx.Client) -> Iterator[str]:
    """Yield the addresses of all that is stored."""
    cursor: str | None = ""
    while cursor is not None:
        page = api.get("/sessions", params={"limit": 1000, **({"cursor": cursor} if cursor else {})}).json()
        for session in page["items"]:
            yield from (f"/sessions/{session['id']}{rest}" for rest in ("", "/captures", "/guide", "/results"))
        cursor = page["next"]


@contextmanager
def served_apart(folder: Path) -> Generator[tuple[str, psutil.Process]]:
    """Give a server whose data, working and temporary folders are in `folder`, and its process."""
    (folder / "work").mkdir()
    (folder / "temporary").mkdir()
    root = Path(__file__).resolve().parents[2]
    command = [sys.executable, "-m", "server.cli", "serve", "--port", "0", "--data", str(folder / "data")]
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "TMPDIR": str(folder / "temporary"),
        "SCANCELL_LOG": "text",
    }
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=folder / "work", env=environment
    )
    assert process.stdout is not None
    try:
        address = next(word for word in process.stdout.readline().split() if word.startswith("http"))
        while httpx.get(f"{address}/api/v1/health", trust_env=False).json()["status"] != "ready":
            time.sleep(0.2)
        yield address, psutil.Process(process.pid)
    finally:
        process.terminate()
        process.wait(timeout=60)


class MemoryWatch:
    """The most memory that any process of a server has held, in MB; Linux keeps that count itself."""

    def __init__(self, process: psutil.Process) -> None:
        self._process = process

    def peak_mb(self) -> float:
        """Return it for the processes that there are now."""
        processes = [self._process, *self._process.children(recursive=True)]
        return max(_peak_mb(p.pid) for p in processes)


def _peak_mb(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM")) / 1e3


def outside(folder: Path) -> list[str]:
    """Return the files below a server's folder that are not in its data folder, nor the decoy that was there."""
    found = [p for p in folder.rglob("*") if p.is_file() and folder / "data" not in p.parents]
    decoy = folder / "decoy"
    return [str(p) for p in found if p != decoy] + ([] if decoy.read_text() == "untouched" else ["decoy"])


def fuzzed_by_role(examples: int) -> int:
    """Ask a server that requires a login for everything, as nobody and with each role; return how often."""
    from tests.server.test_schema_fuzzing import fuzzed

    sent = 0
    with tempfile.TemporaryDirectory() as folder, guarded(Path(folder)) as (admin, tokens):
        admin.headers.update(bearer(tokens["admin"]))
        for headers in ({}, *(bearer(tokens[role]) for role in ROLES)):
            with httpx.Client(base_url=admin.base_url, trust_env=False, timeout=60, headers=headers) as api:
                sent += sum(fuzzed(api, examples, admin).values())
    return sent


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` sends the 10,000 of the target."""
    from tests.server.test_schema_fuzzing import fuzzed

    count, examples = (10_000, 60) if full else (800, 5)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "decoy").write_text("untouched")
        with served_apart(folder) as (address, process):
            watch = MemoryWatch(process)
            with httpx.Client(base_url=f"{address}/api/v1", trust_env=False, timeout=60) as api:
                trials = attack(api, count)
                requests = fuzzed(api, examples)
            peak_mb = watch.peak_mb()
        left = outside(folder)
    by_role = fuzzed_by_role(examples // 4)
    for fault in trials.faults[:10]:
        print(f"  {fault}")
    print(f"  {dict(trials.kinds)}, statuses {dict(sorted(trials.statuses.items()))}")
    what = f"{count} altered files and records"
    sent = sum(requests.values())
    return [
        Row(f"{what}: 500s, hangs", "none", f"{len(trials.faults)}", not trials.faults),
        Row(f"{what}: longest answer", "≤ 10 s", f"{trials.longest_s:.2f} s", trials.longest_s <= _HANG_S),
        Row("most memory of one process", "≤ 1 GB", f"{peak_mb:.0f} MB", peak_mb <= _MAX_MB),
        Row("touched outside the data folder", "nothing", f"{len(left)} files", not left),
        Row(f"schemathesis, {len(requests)} operations", "no 500", f"{sent} requests, none", True),
        Row("the same as nobody and with each role, login required", "no 500", f"{by_role} requests, none", True),
    ]
