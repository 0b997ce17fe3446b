"""Commands in processes of their own that are forked from one which has imported what they need.

Such a process is the command with its arguments, environment, streams, signals and exit, and shares no memory with
the test; only the imports, some seconds of each start, are done once. Its workers are forked from one process too.
"""

import json
import os
import runpy
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from multiprocessing import forkserver, resource_tracker
from pathlib import Path
from typing import IO, Any

from server.jobs.child_processes import WorkerContext

ROOT = Path(__file__).resolve().parents[2]


@cache
def fork_from_one() -> str:
    """Have all servers fork their workers from one process, which loads what they need; returns its address."""
    WorkerContext(warm=True).load()
    own: Any = forkserver._forkserver  # pyright: ignore[reportAttributeAccessIssue]
    return own._forkserver_address


def run_quietly(module: str, *arguments: str) -> None:
    """Run a module as `python -m` does in this process, which says nothing any more."""
    with Path(os.devnull).open("wb") as nothing:
        for fd in (1, 2):
            os.dup2(nothing.fileno(), fd)
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


class ForkedCommand:
    """`python -m MODULE ARGUMENTS…` in a process of its own; looks like `subprocess.Popen`.

    Parameters
    ----------
    words : sequence of str
        The module and its arguments.
    environment : mapping of str to str
        Beside this process's own.
    stderr : file, optional
        Where to write; a pipe without.
    own_group : bool
        Whether it leads a group of processes, as a command of a terminal does.
    shared_workers : bool
        Whether its workers are forked from one that serves all tests, or from one that it starts itself.
    """

    def __init__(
        self,
        words: Sequence[str],
        environment: Mapping[str, str] | None = None,
        stderr: IO[Any] | None = None,
        own_group: bool = False,
        shared_workers: bool = True,
    ) -> None:
        out, its_out = os.pipe()
        error, its_error = os.pipe() if stderr is None else (None, os.dup(stderr.fileno()))
        self._end, its_end = socket.socketpair()
        wanted = {
            "words": list(words),
            "environment": {**os.environ, **(environment or {})},
            "own_group": own_group,
            "forkserver": fork_from_one() if shared_workers else None,
        }
        self.pid = _forker().fork(wanted, [its_out, its_error, its_end.fileno()])
        for fd in (its_out, its_error):
            os.close(fd)
        its_end.close()
        self.stdout = os.fdopen(out, encoding="utf-8")
        self.stderr = None if error is None else os.fdopen(error, encoding="utf-8")
        self.returncode: int | None = None

    def send_signal(self, number: int) -> None:
        """Send a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)

    def poll(self) -> int | None:
        """Return the exit status, None while it runs."""
        try:
            return self.wait(timeout=0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit status once it has ended; raises TimeoutExpired."""
        if self.returncode is None:
            self._end.settimeout(timeout)
            try:
                self.returncode = int(self._end.recv(20))
            except (BlockingIOError, TimeoutError):
                raise subprocess.TimeoutExpired("forked command", timeout or 0) from None
            self._end.close()
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Return what is still to be read of its output and errors, once it has ended; raises TimeoutExpired."""
        said = ["", ""]

        def read(number: int, stream: IO[str]) -> None:
            with stream:
                said[number] = stream.read()

        streams = [stream for stream in (self.stdout, self.stderr) if stream is not None and not stream.closed]
        readers = [
            threading.Thread(target=read, args=(number, stream), daemon=True)
            for number, stream in enumerate(streams)
        ]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
        return said[0], said[1]


class _Forker:
    """The process that others are forked from, as a test sees it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ours, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(its.fileno())],
                pass_fds=[its.fileno()],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": str(ROOT)},
                cwd=ROOT,
            )

    def fork(self, wanted: dict[str, Any], fds: list[int]) -> int:
        """Have a process forked that writes to these; returns its number."""
        with self._lock:
            socket.send_fds(self._ours, [json.dumps(wanted).encode()], fds)
            answer = self._ours.recv(20)
        assert answer, "the process that commands are forked from has ended"
        return int(answer)


@cache
def _forker() -> _Forker:
    return _Forker()


def _serve(control: socket.socket) -> dict[str, Any] | None:
    """Fork what is wanted until the tests hang up; returns in a forked process, with what it shall be."""
    import server.app
    import server.serve  # noqa: F401

    resource_tracker.ensure_running()
    woken, wake = os.pipe()
    os.set_blocking(wake, False)
    signal.signal(signal.SIGCHLD, lambda *_: None)
    signal.set_wakeup_fd(wake)
    ends: dict[int, int] = {}
    while True:
        ready, _, _ = select.select([control, woken], [], [])
        if woken in ready:
            os.read(woken, 1000)
            _tell_who_ended(ends)
        if control not in ready:
            continue
        message, fds, _, _ = socket.recv_fds(control, 1 << 20, 3)
        if not message:
            return None
        wanted = json.loads(message)
        pid = os.fork()
        if pid == 0:
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            for fd, to in zip(fds[:2], (1, 2), strict=True):
                os.dup2(fd, to)
            for fd in (*fds, *ends.values(), woken, wake):
                os.close(fd)
            control.close()
            return wanted
        for fd in fds[:2]:
            os.close(fd)
        ends[pid] = fds[2]
        control.send(str(pid).encode())


def _tell_who_ended(ends: dict[int, int]) -> None:
    while ends:
        pid, status = os.waitpid(-1, os.WNOHANG)
        if not pid:
            return
        end = ends.pop(pid, None)
        if end is not None:
            with suppress(BrokenPipeError):
                os.write(end, str(os.waitstatus_to_exitcode(status)).encode())
            os.close(end)


def _become(wanted: dict[str, Any]) -> None:
    """Run the command that is wanted; ends with SystemExit, as it does."""
    if wanted["forkserver"] is not None:
        own: Any = forkserver._forkserver  # pyright: ignore[reportAttributeAccessIssue]
        own._forkserver_address = wanted["forkserver"]
        own._forkserver_alive_fd = os.open(os.devnull, os.O_RDONLY)
        own.ensure_running = int
    if wanted["own_group"]:
        os.setsid()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    os.environ.clear()
    os.environ.update(wanted["environment"])
    module, *arguments = wanted["words"]
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    found = _serve(socket.socket(fileno=int(sys.argv[1])))
    if found is not None:
        _become(found)
