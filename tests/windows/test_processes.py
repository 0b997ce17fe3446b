"""Processes, locks, ports and programs as Windows has them."""

import ctypes
import errno
import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from calib_core.errors import ConflictError, InputError
from server.commands import serve
from server.jobs import child_processes
from server.jobs.pools import ProcessPool
from server.render import pdf
from server.settings import Settings
from server.store import blob_folder, file_lock
from server.store.blob_folder import FolderBlobs
from server.store.folder import folder_lock


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
