"""Which tests run which line, and how long each takes: a plugin of pytest beside coverage, and its reader."""

import ast
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
    """Return the tests that run a line; outside functions those that run any line of its file within one.

    Fast ones are taken first, and one of each function before others of it, until they take `most_s`; after them
    the others of their files, which may ask of what one computed for all. A statement of several lines is known by
    its first.
    """
    by_line, seconds = _lines(folder, source), _took(folder)
    tree = ast.parse(source.read_text(encoding="utf-8"))
    bodies = [node.body for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    inside = {k for body in bodies for k in range(body[0].lineno, (body[-1].end_lineno or 0) + 1)}
    firsts = [n.lineno for n in ast.walk(tree) if isinstance(n, ast.stmt) and line in range(n.lineno, _end(n))]
    some = {max(firsts, default=line)} if line in inside else inside  # what is outside runs with the first import
    tests = {test for k in some for test in by_line.get(k, ()) if test}
    files = {_file(test) for test in tests}
    beside = {test for test in seconds if _file(test) in files} - tests
    left_s, taken = most_s, []
    for test in [*_in_turns(tests, seconds), *_in_turns(beside, seconds)]:
        took_s = seconds.get(test, most_s)
        if took_s < left_s:
            left_s -= took_s
            taken.append(test)
    return taken


def _in_turns(tests: set[str], seconds: dict[str, float]) -> list[str]:
    """Return tests, fast ones first, and one of each function before others of it."""
    seen: Counter[str] = Counter()
    turns: list[tuple[int, str]] = []
    for test in sorted(tests, key=lambda one: (seconds.get(one, float("inf")), one)):
        function = test.partition("[")[0]
        turns.append((seen[function], test))
        seen[function] += 1
    return [test for _, test in sorted(turns, key=lambda turn: turn[0])]


def _file(test: str) -> str:
    return test.partition("::")[0]


def _end(node: ast.stmt) -> int:
    return (node.end_lineno or node.lineno) + 1


@cache
def _took(folder: Path) -> dict[str, float]:
    return json.loads((folder / _TOOK).read_text(encoding="utf-8"))


@cache
def _lines(folder: Path, source: Path) -> dict[int, list[str]]:
    from coverage import CoverageData  # pyright: ignore[reportMissingImports]

    data = CoverageData(str(folder / _DATA))
    data.read()
    return data.contexts_by_lineno(str(source))
