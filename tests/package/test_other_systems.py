"""Windows, as far as it can be tried here: nothing imports what its Python lacks; texts name their encoding."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

_LACKING = ("fcntl", "pwd", "grp", "resource", "termios", "tty", "pty", "posix_ipc", "syslog")
_SCRIPT = """
import importlib, pkgutil, signal, sys
# Others have their own ways on Windows, and choose them when they are imported.
import asyncio, multiprocessing, subprocess, tempfile, uuid, platform, getpass, shutil, tarfile
import numba, scipy, fastapi, uvicorn, sqlalchemy, cv2, viser, websockets, alembic, tifffile, prometheus_client
import distributed
for name in LACKING:
    sys.modules[name] = None
for name in ("SIGKILL", "SIGHUP", "pthread_sigmask", "SIGUSR1"):
    if hasattr(signal, name):
        delattr(signal, name)
wrong = {}
for top in ("calib_core", "server"):
    package = importlib.import_module(top)
    for module in pkgutil.walk_packages(package.__path__, f"{top}."):
        if ".migrations" in module.name:
            continue
        try:
            importlib.import_module(module.name)
        except BaseException as error:
            wrong[module.name] = repr(error)
print(wrong or "")
"""


@pytest.mark.thorough
def test_every_module_is_imported_without_what_only_unix_has() -> None:
    code = _SCRIPT.replace("LACKING", repr(_LACKING))
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_text_is_written_as_it_is() -> None:
    """Text files name their encoding, else Windows writes another one."""
    calls = re.compile(
        r"\.(?:read_text|write_text)\((?!.*(?:encoding=|\"utf-8\"))|(?<![\w.])open\([^)]*\"[rw]t?\"\)"
    )
    files = [f for top in ("calib_core", "server") for f in (ROOT / top).rglob("*.py")]
    assert len(files) > 200
    wrong = [
        f"{file.relative_to(ROOT)}:{number}: {line.strip()}"
        for file in files
        for number, line in enumerate(file.read_text("utf-8").split("\n"), 1)
        if calls.search(line)
    ]
    assert wrong == []


def test_processes_are_spawned_not_forked() -> None:
    files = [f for top in ("calib_core", "server") for f in (ROOT / top).rglob("*.py")]
    forks = re.compile(r"os\.fork\b|get_context\(\"fork\"|set_start_method\(\"fork\"|preexec_fn")
    assert [f.name for f in files if forks.search(f.read_text("utf-8"))] == []


def test_no_two_files_differ_in_case_alone_and_none_has_a_name_that_windows_keeps_for_itself() -> None:
    listed = subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split("\n")
    assert len({name.lower() for name in listed}) == len(listed)
    kept = re.compile(r"(^|/)(con|prn|aux|nul|com\d|lpt\d)(\.|/|$)|[<>:\"|?*\\]|[. ]$", re.IGNORECASE)
    assert [name for name in listed if kept.search(name)] == []
