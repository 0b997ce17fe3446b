"""Kernels are compiled behind the served page; once all are there, no start does it again."""

import time
from pathlib import Path

import httpx
import pytest

from server.jobs.kernels import KernelCompiler, compiled_for, note_that_all_are_compiled, stamp_file


def test_what_is_compiled_is_noted_where_it_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    file = stamp_file()
    assert file is not None
    assert file.parent == tmp_path
    note_that_all_are_compiled()
    assert file.exists()
    compiler = KernelCompiler()
    compiler.start()
    assert compiler.state == "compiling"  # the process looks
    end_s = time.monotonic() + 60
    while compiler.state == "compiling" and time.monotonic() < end_s:
        time.sleep(0.1)
    assert compiler.state == "ready"
    assert [one.name for one in tmp_path.iterdir()] == [file.name]  # and compiles nothing
    compiler.stop()


def test_what_is_compiled_is_counted() -> None:
    part = "16 bits, E57, depths"
    compiled_for(part)
    assert compiled_for(part) == 0


def test_health_tells_of_kernels(client: httpx.Client) -> None:
    assert client.get("/health").json()["kernels"] == "ready"
