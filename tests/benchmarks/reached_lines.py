"""Which tests run which line, and how long each takes: a plugin of pytest beside coverage, and its reader."""

import json
import os
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

_DATA, _TOOK = "reached", "reached-seconds.json"
_seconds: dict[str, float] = {}


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[Any]:
    """Let coverage note the lines of one test under its name."""
    import coverage  # pyright: ignore[reportMissingImports]

    noting = coverage.Coverage.current()
    noting.switch_context(item.nodeid)
    start_s = time.perf_counter()
    try:
        return (yield)
    finally:
        _seconds[item.nodeid] = time.perf_counter() - start_s
        noting.switch_context("")


def pytest_sessionfinish() -> None:
    """Keep how long each test took."""
    Path(os.environ["SCANCELL_REACHED"], _TOOK).write_text(json.dumps(_seconds), encoding="utf-8")


def noted(root: Path, folder: Path) -> Path:
    """Run the core's tests once under coverage, where `folder` holds nothing yet; return it."""
    folder.mkdir(parents=True, exist_ok=True)
    if not (folder / _TOOK).exists():
        here = os.pathsep.join([str(root), str(Path(__file__).parent), *sys.path])
        told = {"COVERAGE_FILE": str(folder / _DATA), "SCANCELL_REACHED": str(folder), "PYTHONPATH": here}
        noting = [sys.executable, "-m", "coverage", "run", "--source=calib_core", "-m"]
        tests = ["pytest", "-q", "-n0", "--brief", "-p", "reached_lines", "-p", "no:cacheprovider", "tests/core"]
        subprocess.run([*noting, *tests], cwd=root, env={**os.environ, **told}, capture_output=True, check=False)
    return folder


def reaching(folder: Path, source: Path, line: int, most_s: float) -> list[str]:
    """Return the tests that run a line, of a constant those that run any of its file.

    Fast ones are taken first, and one of each function before others of it, until they take `most_s`. A statement
    of several lines is known by its first.
    """
    by_line, seconds = _lines(folder, source), _took(folder)
    named = next((by_line[k] for k in range(line, 0, -1) if k in by_line), [])
    tests = {test for test in named if test} or {test for names in by_line.values() for test in names if test}
    seen: Counter[str] = Counter()
    turns: list[tuple[int, str]] = []
    for test in sorted(tests, key=lambda one: (seconds.get(one, most_s), one)):
        function = test.partition("[")[0]
        turns.append((seen[function], test))
        seen[function] += 1
    left_s, taken = most_s, []
    for _, test in sorted(turns, key=lambda turn: turn[0]):
        left_s -= seconds.get(test, most_s)
        if left_s > 0:
            taken.append(test)
    return taken


@cache
def _took(folder: Path) -> dict[str, float]:
    return json.loads((folder / _TOOK).read_text(encoding="utf-8"))


@cache
def _lines(folder: Path, source: Path) -> dict[int, list[str]]:
    from coverage import CoverageData  # pyright: ignore[reportMissingImports]

    data = CoverageData(str(folder / _DATA))
    data.read()
    return data.contexts_by_lineno(str(source))
