"""Kernels are compiled behind the served page; once all are there, no start does it again."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import httpx
import pytest
from llvmlite.binding import get_host_cpu_features

from calib_core.compiled import (
    BASELINE,
    all_are_compiled,
    note_that_all_are_compiled,
    stamp_files,
    take_brought_along,
)
from server.jobs.kernels import KernelCompiler, compiled_for


@pytest.mark.thorough
def test_what_is_compiled_is_noted_where_it_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    (file,) = stamp_files()
    assert file.parent == tmp_path
    note_that_all_are_compiled()
    assert file.exists()
    compiler = KernelCompiler()
    compiler.start()
    assert compiler.state == "ready"  # while the process looks
    compiler.wait()
    assert [one.name for one in tmp_path.iterdir()] == [file.name]  # and compiles nothing
    compiler.stop()


def test_kernels_that_are_brought_along_serve_until_the_processors_own_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))

    def taken() -> str | None:
        config = SimpleNamespace(CPU_NAME=None, CPU_FEATURES=None)
        take_brought_along(config)
        return config.CPU_NAME

    assert taken() is None
    assert not all_are_compiled()
    note_that_all_are_compiled(BASELINE)
    able = all(get_host_cpu_features().get(name) for name in ("avx2", "fma"))
    assert (taken() == BASELINE) == able == all_are_compiled()
    note_that_all_are_compiled()
    assert taken() is None
    assert all_are_compiled()


@pytest.mark.thorough
def test_processes_take_faster_kernels_once_they_are_there(tmp_path: Path) -> None:
    """One that is busy answers first, or is ended as ever; then none is left that has what was brought along."""
    command = [sys.executable, "-m", "tests.server.replaced_processes", str(tmp_path)]
    found = json.loads(subprocess.run(command, capture_output=True, check=True, timeout=300).stdout)
    able = all(get_host_cpu_features().get(name) for name in ("avx2", "fma"))
    assert found["taken"] == [BASELINE if able else None, None]
    assert found["answers"] == ["done", "ProcessEndedError"]
    assert not found["kept"]
    assert found["ended"]


@pytest.mark.thorough
def test_what_is_compiled_is_counted() -> None:
    part = "16 bits, E57, depths"
    compiled_for(part)
    assert compiled_for(part) == 0


@pytest.mark.thorough
def test_ctrl_c_ends_all_that_compile_without_a_word_of_theirs(tmp_path: Path) -> None:
    command, place = [sys.executable, "-m", "server.cli", "warm"], os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    with subprocess.Popen(
        command, env=place, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as compiling:
        while compiling.poll() is None and not any(tmp_path.iterdir()):
            time.sleep(0.1)
        os.killpg(compiling.pid, signal.SIGINT)  # as a terminal sends it, to every one of them
        _, told = compiling.communicate(timeout=120)  # until none is left that could say something
    assert compiling.returncode == 130
    assert told == "scancell: stopped\n"


def test_health_tells_of_kernels(client: httpx.Client) -> None:
    assert client.get("/health").json()["kernels"] == "ready"
