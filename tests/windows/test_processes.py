"""Processes, locks, ports and programs as Windows has them."""

import ctypes
import errno
import importlib.util
import multiprocessing.context
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from calib_core.errors import ConflictError, InputError
from server.commands import serve
from server.jobs import child_processes, worker
from server.jobs.pools import ProcessPool
from server.jobs.processes import Processes
from server.render import pdf
from server.settings import Settings
from server.store import blob_folder, file_lock
from server.store.blob_folder import FolderBlobs
from server.store.folder import folder_lock

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def windows_locks(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Windows' locks of a file's first bytes, which go with the handle; over those of this system."""
    import fcntl

    asked: list[int] = []

    def locking(handle: int, mode: int, count: int) -> None:
        assert mode == 2
        asked.append(count)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise OSError(errno.EACCES, "Permission denied") from None

    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    monkeypatch.setattr(file_lock, "sys", SimpleNamespace(platform="win32"))
    return asked


def test_a_data_folder_is_locked_by_windows_own_locks(tmp_path: Path, windows_locks: list[int]) -> None:
    with folder_lock(tmp_path), pytest.raises(ConflictError, match="no other server uses"), folder_lock(tmp_path):
        pass
    with folder_lock(tmp_path):
        assert windows_locks == [1, 1, 1]


def test_blobs_are_locked_by_windows_own_locks(
    tmp_path: Path, windows_locks: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blob_folder, "WINDOWS", True)
    blobs = FolderBlobs(tmp_path)
    digest = blobs.put(b"a")
    done: list[str] = []
    with file_lock.file_lock(tmp_path / "lock"):
        other = threading.Thread(target=lambda: done.append(FolderBlobs(tmp_path).put(b"a")))
        other.start()
        time.sleep(0.2)
        assert done == []  # it waits with its being made young again
    other.join(20)
    assert done == [digest]
    assert len(windows_locks) > 3


def test_other_errors_of_locks_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def locking(*_: int) -> None:
        raise OSError(errno.EBADF, "Bad file descriptor")

    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    monkeypatch.setattr(file_lock, "sys", SimpleNamespace(platform="win32"))
    with pytest.raises(OSError, match="Bad file"), file_lock.file_lock(tmp_path / "lock"):
        pass


def test_a_port_that_windows_would_share_counts_as_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        serve._require_free("127.0.0.1", port)  # Linux lets it be taken, as nobody listens
        monkeypatch.setattr(serve, "_OWN_ADDRESS", socket.SO_KEEPALIVE)  # not shared, as by Windows' own option
        with pytest.raises(InputError, match="--port"):
            serve._require_free("127.0.0.1", port)


def test_windows_own_option_is_taken_where_it_is() -> None:
    wanted = getattr(socket, "SO_EXCLUSIVEADDRUSE", socket.SO_REUSEADDR)
    assert wanted == serve._OWN_ADDRESS
    assert {signal.SIGINT, signal.SIGTERM} <= set(serve._ENDINGS)


def test_processes_are_started_where_the_console_tells_them_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[Any, ...]] = []
    kernel = SimpleNamespace(SetConsoleCtrlHandler=lambda *words: told.append(words))
    monkeypatch.setattr(ctypes, "WinDLL", lambda *_, **__: kernel, raising=False)
    monkeypatch.delattr(signal, "pthread_sigmask")
    with child_processes.ignoring_interrupts():
        assert told == [(None, True)]
    assert told == [(None, True), (None, False)]
    with pytest.raises(RuntimeError), child_processes.ignoring_interrupts():
        raise RuntimeError
    assert told[-1] == (None, False)


@pytest.mark.thorough
def test_the_server_ends_in_order_by_what_windows_sends(tmp_path: Path) -> None:
    """Closing the window and Ctrl-Break are SIGBREAK there; here another signal has its name."""
    code = """import signal, sys
signal.SIGBREAK = signal.SIGUSR1
from server.cli import main
sys.exit(main(["serve", "--port", "0", "--data", sys.argv[1]]))
"""
    settings = {**os.environ, "SCANCELL_WARM_UP": "false", "PYTHONPATH": str(ROOT), "PYTHONUTF8": "1"}
    command = [sys.executable, "-c", code, str(tmp_path / "data")]
    with subprocess.Popen(command, env=settings, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout is not None
            assert " at http://" in server.stdout.readline()
            server.send_signal(signal.SIGUSR1)
            assert server.wait(60) == 0
            assert "has stopped" in server.stdout.read()
        finally:
            server.kill()
    with folder_lock(tmp_path / "data"):  # let go of
        pass


def test_a_spawned_worker_does_what_a_forked_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = importlib.util.find_spec("server.jobs.child_processes")
    assert spec is not None
    assert spec.loader is not None
    monkeypatch.setattr(sys, "platform", "win32")
    as_on_windows = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(as_on_windows)
    monkeypatch.undo()
    as_on_windows.sys = SimpleNamespace(platform="win32")  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, spec.name, as_on_windows)  # where its classes are found to be sent
    context = as_on_windows.WorkerContext(False)
    assert isinstance(context, multiprocessing.context.SpawnContext)
    settings = Settings(data=tmp_path, warm_up=False)
    processes = Processes(1, context, worker.initialize, settings)
    try:
        context.load()
        assert processes.ask(worker.ready) is True
        assert type(context.started[0]).__mro__[1] is multiprocessing.context.SpawnProcess
    finally:
        processes.stop()


def test_a_worker_that_has_ended_already_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def kill(number: int, _: int) -> None:
        raise OSError(errno.EINVAL, "The parameter is incorrect")

    pool = ProcessPool(Settings(data=tmp_path, warm_up=False), lambda _: None)
    try:
        monkeypatch.setattr(os, "kill", kill)
        pool.end_worker(12345)
    finally:
        monkeypatch.undo()
        pool.close()


def test_a_windows_without_microsofts_runtime_is_told_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Else numba and Open3D fail in a worker, by a library's name that nobody knows."""
    from calib_core import windows_runtime
    from server.cli import main

    def load(name: str) -> None:
        if name != "vcruntime140_1.dll":  # which Windows' own Python brings
            raise OSError(126, "The specified module could not be found", name)

    monkeypatch.setattr(windows_runtime, "WINDOWS", True)
    monkeypatch.setattr(ctypes, "WinDLL", load, raising=False)
    windows_runtime.require_runtime.cache_clear()
    assert main(["serve", "--port", "0", "--data", str(tmp_path / "data")]) == 2
    assert "a Windows without msvcp140.dll, vcomp140.dll" in capsys.readouterr().err
    monkeypatch.setattr(ctypes, "WinDLL", str)
    windows_runtime.require_runtime()
    windows_runtime.require_runtime.cache_clear()


@pytest.mark.parametrize(
    ("variable", "below"),
    [
        ("ProgramFiles", "Microsoft/Edge/Application/msedge.exe"),
        ("ProgramFiles(x86)", "Microsoft/Edge/Application/msedge.exe"),
        ("ProgramFiles", "Google/Chrome/Application/chrome.exe"),
        ("ProgramFiles(x86)", "Google/Chrome/Application/chrome.exe"),
        ("LOCALAPPDATA", "Google/Chrome/Application/chrome.exe"),
        ("LOCALAPPDATA", "Microsoft/Edge/Application/msedge.exe"),
    ],
)
def test_a_browser_is_found_wherever_windows_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, below: str
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path / "nothing"))
    for name in pdf._FOLDERS_OF_WINDOWS:
        monkeypatch.setenv(name, str(tmp_path / "empty"))
    assert pdf.browser() is None
    monkeypatch.setenv(variable, str(tmp_path / "programs"))
    program = tmp_path / "programs" / below
    program.parent.mkdir(parents=True)
    program.touch()
    assert pdf.browser() == str(program)
