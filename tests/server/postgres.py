"""A real PostgreSQL for the tests: Debian's, on a free port of loopback, in a folder that goes with them."""

import os
import pwd
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import psycopg

_UNPRIVILEGED = ("postgres", "nobody")  # it refuses to run as root


@contextmanager
def running_postgres() -> Generator[str]:
    """Run a server; gives the address of its first database, to which others may be added."""
    programs = _programs()
    user = _user()
    folder = Path(tempfile.mkdtemp(prefix="scancell-pg-"))
    data = folder / "data"
    if user:
        shutil.chown(folder, user)
    run = {"user": user} if user else {}
    try:
        subprocess.run(
            [
                programs / "initdb",
                "-D",
                data,
                "-U",
                "scancell",
                "-A",
                "trust",
                "-E",
                "UTF8",
                "--locale=C.UTF-8",
                "-N",
            ],
            check=True,
            capture_output=True,
            cwd=folder,
            **run,
        )
        port = free_port()
        settings = ("listen_addresses=127.0.0.1", "unix_socket_directories=", "fsync=off", "max_connections=60")
        options = [part for setting in settings for part in ("-c", setting)]
        log = (folder / "log").open("wb")
        with log:
            process = subprocess.Popen(
                [programs / "postgres", "-D", data, "-p", str(port), *options],
                stdout=log,
                stderr=log,
                cwd=folder,
                **run,
            )
        try:
            address = f"postgresql://scancell@127.0.0.1:{port}/postgres"
            _wait(process, address, folder / "log")
            yield address
        finally:
            process.terminate()
            process.wait(timeout=20)
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
    end_s = time.monotonic() + 30
    while True:
        try:
            psycopg.connect(address).close()
            return
        except psycopg.OperationalError:
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < end_s, log.read_text()
            time.sleep(0.05)
