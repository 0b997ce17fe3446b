"""A real PostgreSQL for the tests: Debian's, on a free port of loopback, in a folder that goes with them."""

import os
import pwd
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psycopg

_UNPRIVILEGED = ("postgres", "nobody")  # it refuses to run as root


class Postgres:
    """A server in a folder of its own, which can be ended and started again.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._programs = _programs()
        user = _user()
        if user:
            shutil.chown(folder, user)
        self._run: dict[str, Any] = {"cwd": folder, **({"user": user} if user else {})}
        words = ["-D", folder / "data", "-U", "scancell", "-A", "trust", "-E", "UTF8", "--locale=C.UTF-8", "-N"]
        subprocess.run([self._programs / "initdb", *words], check=True, capture_output=True, **self._run)
        self._port = lasting_port()
        self.address = f"postgresql://scancell@127.0.0.1:{self._port}/postgres"
        """Of its first database, to which others may be added."""

    def start(self) -> None:
        """Start it, and wait until it answers."""
        settings = ("listen_addresses=127.0.0.1", "unix_socket_directories=", "fsync=off", "max_connections=60")
        options = [part for setting in settings for part in ("-c", setting)]
        command = [self._programs / "postgres", "-D", self._folder / "data", "-p", str(self._port), *options]
        with (self._folder / "log").open("ab") as log:
            self._process = subprocess.Popen(command, stdout=log, stderr=log, **self._run)
        _wait(self._process, self.address, self._folder / "log")

    def end(self, number: int = signal.SIGTERM) -> None:
        """End it by a signal: SIGTERM waits for connections, SIGINT cuts them, SIGQUIT is a crash."""
        self._process.send_signal(number)
        self._process.wait(timeout=300)


@contextmanager
def running_postgres() -> Generator[str]:
    """Run a server; gives the address of its first database, to which others may be added."""
    with restartable_postgres() as server:
        yield server.address


@contextmanager
def restartable_postgres() -> Generator[Postgres]:
    """Run a server."""
    folder = Path(tempfile.mkdtemp(prefix="scancell-pg-"))
    try:
        server = Postgres(folder)
        server.start()
        try:
            yield server
        finally:
            server.end(signal.SIGINT)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def new_database(address: str, name: str) -> str:
    """Make an empty database beside the first one and return its address."""
    with psycopg.connect(address, autocommit=True) as connection:
        connection.execute(f'CREATE DATABASE "{name}" TEMPLATE template0')
    return f"{address.rpartition('/')[0]}/{name}"


def free_port() -> int:
    with socket.socket() as trial:
        trial.bind(("127.0.0.1", 0))
        return trial.getsockname()[1]


def lasting_port() -> int:
    """Return a free port that the system gives to nobody, for what goes away and comes back at its own."""
    lowest = Path("/proc/sys/net/ipv4/ip_local_port_range")
    end = int(lowest.read_text().split()[0]) if lowest.exists() else 32768
    while True:
        with socket.socket() as trial, suppress(OSError):
            trial.bind(("127.0.0.1", port := random.randrange(end - 12_000, end)))
            return port


def _programs() -> Path:
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin/postgres"))
    elsewhere = shutil.which("postgres")
    program = found[-1] if found else elsewhere
    assert program, "the tests need PostgreSQL: apt-get install postgresql, as `make test` does where it may"
    return Path(program).resolve().parent


def _user() -> str | None:
    if os.geteuid() != 0:
        return None
    names = {entry.pw_name for entry in pwd.getpwall()}
    return next(name for name in _UNPRIVILEGED if name in names)


def _wait(process: "subprocess.Popen[bytes]", address: str, log: Path) -> None:
    end_s = time.monotonic() + 300
    while True:
        try:
            psycopg.connect(address).close()
            return
        except psycopg.OperationalError:
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < end_s, log.read_text()
            time.sleep(0.05)
