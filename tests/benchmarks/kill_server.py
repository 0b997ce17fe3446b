"""The real command as a process that can be killed, and data folders of an older form for it to migrate."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import httpx

from tests.server.forked_commands import ForkedCommand


class ServerProcess:
    """`scancell serve` on a data folder and any free port.

    Parameters
    ----------
    data : Path
    environment : mapping, optional
        Further settings.
    program : sequence of str
        What is run in place of `scancell`.
    forked : bool
        Whether it is forked from a process that has imported what it needs, which saves seconds.
    log : int, optional
        A descriptor that its log goes to; a file without.
    port : int
        Where it listens, any free port without.
    """

    def __init__(
        self,
        data: Path,
        environment: dict[str, str] | None = None,
        program: Sequence[str] = ("server.cli",),
        forked: bool = False,
        log: int | None = None,
        port: int = 0,
    ) -> None:
        words = [*program, "serve", "--port", str(port), "--data", str(data)]
        root = str(Path(__file__).resolve().parents[2])
        environment = {"PYTHONPATH": root, "SCANCELL_WARM_UP": "false", **(environment or {})}
        # Not a pipe: one that nobody reads stops the server when it is full.
        self._said = tempfile.TemporaryFile("w+") if log is None else os.fdopen(log, "w")  # noqa: SIM115
        if forked:
            self.process = ForkedCommand(words, environment, self._said)
        else:
            self.process = subprocess.Popen(
                [sys.executable, "-m", *words],
                stdout=subprocess.PIPE,
                stderr=self._said,
                text=True,
                env={**os.environ, **environment},
                cwd=root,
            )
        self.address = ""

    def wait(self) -> "ServerProcess":
        """Wait until it serves; raises AssertionError with what it said where it ends instead."""
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if "http://" not in line:
            self.process.communicate()
            said = "see its log"
            if self._said.seekable():
                self._said.seek(0)
                said = self._said.read()
            self._said.close()
            raise AssertionError(f"the server did not start: {said[-2000:]}")
        self.address = "http://" + line.split("http://")[1].split()[0]
        return self

    def client(self, timeout_s: float = 30.0) -> httpx.Client:
        """Return a client of its API."""
        return httpx.Client(base_url=f"{self.address}/api/v1", timeout=timeout_s, trust_env=False)

    def kill(self) -> None:
        """End it as a power cut would: without a chance to say anything."""
        self.process.send_signal(signal.SIGKILL)
        self.process.communicate()
        self._said.close()

    def stop(self) -> int:
        """End it as an administrator would; returns the exit status."""
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=30)
        self._said.close()
        return self.process.returncode


OLD_CONTENT = b"0.0,200.0\n0.1,200.1\n"


def old_store(data: Path, sessions: int) -> list[str]:
    """Fill a data folder as the first version of the tables had it; returns the sessions' ids.

    Each has one capture, p1, with the content `OLD_CONTENT`.
    """
    from alembic import command
    from alembic.config import Config

    import server.store
    from server.settings import Settings
    from server.store.blob_places import open_blobs
    from server.store.engine import engine_of

    settings = Settings(data=data)
    blobs = open_blobs(settings.blob_place)
    digest = blobs.put(OLD_CONTENT)
    engine = engine_of(settings.sql_url)
    config = Config()
    config.set_main_option("script_location", str(Path(server.store.__file__).parent / "migrations"))
    with engine.execution_options(writing=True).begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        rows = [_session_row(number) for number in range(sessions)]
        _insert(connection, "sessions", rows)
        _insert(connection, "captures", [_capture_row(row["id"]) for row in rows])
        _insert(connection, "files", [_file_row(row["id"], digest, len(OLD_CONTENT)) for row in rows])
    engine.dispose()
    return [row["id"] for row in rows]


def _insert(connection: Any, table: str, rows: list[dict[str, Any]]) -> None:
    names = list(rows[0])
    values = ", ".join("?" for _ in names)
    columns = ", ".join(names)
    connection.exec_driver_sql(
        f"INSERT INTO {table} ({columns}) VALUES ({values})", [tuple(row.values()) for row in rows]
    )


def _session_row(number: int) -> dict[str, Any]:
    moment = f"2025-01-{number % 28 + 1:02d}T00:00:{number % 60:02d}.000Z"
    record = {"format": "scancell-session/1", "name": f"Zelle {number}", "cell": {"pose_convention": "ur"}}
    return {
        "id": f"{number:016x}",
        "name": f"Zelle {number}",
        "created": moment,
        "updated": moment,
        "revision": 2,
        "last_event": 0,
        "last_position": 1,
        "record": json.dumps(record),
    }


def _capture_row(session: str) -> dict[str, Any]:
    record = (
        '{"id": "p1", "step": "tcp", "kind": "profile", "files": ["captures/p1.csv"], "pose": [0, 0, 0, 0, 0, 0]}'
    )
    measured = '{"capture": "p1", "kind": "profile", "verdict": "fail", "reason": "none", "to_do": "none"}'
    moment = "2025-01-01T00:00:00.000Z"
    row = {"session_id": session, "id": "p1", "position": 1, "revision": 1, "created": moment}
    return {**row, "record": record, "measured": measured}


def _file_row(session: str, digest: str, size: int) -> dict[str, Any]:
    return {"session_id": session, "capture_id": "p1", "name": "captures/p1.csv", "sha256": digest, "size": size}
