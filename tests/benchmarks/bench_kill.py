"""`kill -9` at random moments: no acknowledged capture lost, no half state visible, it starts again each time."""

import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
from harness import Row
from kill_load import Findings, check, load
from kill_server import OLD_CONTENT, ServerProcess, old_store

from calib_core.archive.archive import pack
from calib_core.archive.folder import save_session, write_result
from calib_core.simulation import simulate
from calib_core.stages.pipeline import solve_stage

Serve = Callable[[Path], ServerProcess]
_MIGRATIONS_PER_LOAD = 4  # of five kills, one falls into a start that migrates an old store


@dataclass
class Counts:
    """What happened in all rounds."""

    kills: int = 0
    acknowledged: int = 0
    unanswered: int = 0
    imports: int = 0
    jobs: int = 0
    migrations: int = 0
    starts_failed: int = 0
    start_s: list[float] = field(default_factory=list[float])
    found: Findings = field(default_factory=Findings)


def run(full: bool) -> list[Row]:
    """Kill the server 300 times (8 without --full)."""
    counts = kill_rounds(300 if full else 8, seed=5)
    lost, half = len(counts.found.lost), len(counts.found.half)
    under = f"{counts.acknowledged} captures, {counts.imports} imports, {counts.jobs} solves"
    for said in (counts.found.lost + counts.found.half)[:20]:
        print(f"    {said}", flush=True)
    return [
        Row(f"kill -9, of these {counts.migrations} while migrating", "", f"{counts.kills}"),
        Row("acknowledged meanwhile", "", under),
        Row("acknowledged captures and imports lost", "0", f"{lost}", lost == 0),
        Row("half states seen", "0", f"{half}", half == 0),
        Row("unanswered uploads sent again, each stored once", "", f"{counts.unanswered}"),
        Row("starts that did not succeed by themselves", "0", f"{counts.starts_failed}", not counts.starts_failed),
        Row("start after a kill, median", "", f"{np.median(counts.start_s):.1f} s"),
    ]


def kill_rounds(kills: int, seed: int, longest_s: float = 2.0, forked: bool = False) -> Counts:
    """Kill a server under load, and starts that migrate, at random moments; look at what is left each time.

    Parameters
    ----------
    kills : int
    seed : int
        Of the moments.
    longest_s : float
        Load lasts at most so long.
    forked : bool
        Whether each server is forked from a process that has imported it, which saves seconds a start.
    """
    serve = partial(ServerProcess, forked=forked)
    random = np.random.default_rng(seed)
    counts = Counts()
    archive, captures = _archive()
    with tempfile.TemporaryDirectory(prefix="scancell-kill-") as folder:
        data = Path(folder) / "data"
        server = serve(data).wait()
        try:
            while counts.kills < kills:
                if counts.kills % (_MIGRATIONS_PER_LOAD + 1) == _MIGRATIONS_PER_LOAD:
                    _migration_round(serve, counts, Path(folder) / "old", random)
                else:
                    moment_s = random.uniform(0.05, longest_s)
                    server = _load_round(serve, counts, server, data, archive, captures, moment_s)
                if counts.kills % 20 == 0:
                    wrong = len(counts.found.lost), len(counts.found.half), counts.starts_failed
                    print(f"    {counts.kills} kills, {counts.acknowledged} captures; wrong: {wrong}", flush=True)
        finally:
            server.kill()
        counts.found.half += _leftovers(serve, data)
    return counts


def _load_round(
    serve: Serve, counts: Counts, server: ServerProcess, data: Path, archive: bytes, captures: int, moment_s: float
) -> ServerProcess:
    number = counts.kills
    with load(server.client, number, archive, captures) as known:
        if number % 2:  # every other time once it is in full work, not over its first request
            known.first.wait(timeout=30)
        time.sleep(moment_s)
        server.kill()
    counts.kills += 1
    server = _started(serve, counts, data)
    with server.client() as client:
        counts.acknowledged += len(known.acknowledged)
        counts.unanswered += len(known.sent) - len(known.acknowledged)
        counts.imports += len(known.imported)
        counts.jobs += len(known.jobs)
        counts.found.merge(check(client, known, number, captures))
    return server


def _started(serve: Serve, counts: Counts, data: Path) -> ServerProcess:
    start_s = time.monotonic()
    while True:
        try:
            server = serve(data).wait()
        except AssertionError as error:
            counts.starts_failed += 1
            counts.found.half.append(str(error))
            if counts.starts_failed > 3:
                raise
        else:
            counts.start_s.append(time.monotonic() - start_s)
            return server


def _migration_round(serve: Serve, counts: Counts, data: Path, random: np.random.Generator) -> None:
    sessions = old_store(data, 4000)
    server = serve(data)
    log = data / "scancell.db-wal"
    end_s = time.monotonic() + 30
    while not (log.exists() and log.stat().st_size) and time.monotonic() < end_s:
        time.sleep(0.001)
    time.sleep(random.uniform(0.0, 0.4))
    server.kill()
    counts.kills += 1
    counts.migrations += 1
    server = _started(serve, counts, data)
    try:
        with server.client() as client:
            for session in sessions[:: len(sessions) // 20]:
                file = client.get(f"/sessions/{session}/captures/p1/files/p1.csv")
                if file.content != OLD_CONTENT:
                    counts.found.lost.append(f"after a migration, {session}: {file.status_code} {file.text[:200]}")
            found = client.get("/sessions", params={"search": "ZELLE 39", "limit": 1000}).json()["items"]
            if len(found) != 111:  # 39, 390 to 399, 3900 to 3999
                counts.found.half.append(f"after a migration a search finds {len(found)} of 111")
    finally:
        server.kill()
        shutil.rmtree(data)


def _leftovers(serve: Serve, data: Path) -> list[str]:
    """Return what interrupted uploads left, after one more start has cleaned up."""
    serve(data).wait().kill()
    return [f"left behind: {path.name}" for path in (data / "blobs" / "arriving").iterdir()]


def _archive() -> tuple[bytes, int]:
    """Return the archive of a solved simulated session, and how many captures it has."""
    simulated = simulate("tcp", 3)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "session"
        save_session(folder, simulated.session, simulated.files)
        result = solve_stage(simulated.session, "tcp", simulated.files.__getitem__)
        write_result(folder, "tcp", result, simulated.session)
        pack(folder, Path(name) / "a.zip")
        return (Path(name) / "a.zip").read_bytes(), len(simulated.session.captures)
