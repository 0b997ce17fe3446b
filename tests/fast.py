"""`make test-fast`: a minute without a browser: tests of what was changed first, then as many others as fit.

Statistics are of what was changed alone: they take longest, and others of the minute's tests look at more.
"""

import subprocess
import time
from pathlib import Path

import pytest

from tests.dealing import dealt, without_thorough

_LAST_BEGINS_S = 34.0
_began_s = time.monotonic()
_always: set[str] = set()
"""Tests of what was changed: run however busy the machine is."""


def _changed() -> set[str]:
    """Return names of modules changed since main was left, or since the last commit where there is no main."""
    root = Path(__file__).resolve().parents[1]
    names: set[str] = set()
    for command in (["git", "diff", "--name-only", "--merge-base", "main"], ["git", "status", "--porcelain"]):
        listed = subprocess.run(command, cwd=root, capture_output=True, text=True, check=False).stdout
        names |= {
            Path(line.split()[-1]).stem.removeprefix("test_") for line in listed.splitlines() if line.strip()
        }
    return names


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    changed = _changed()
    place = {item: _place(item.path, changed) for item in items if item.get_closest_marker("browser") is None}
    brief = set(without_thorough(items))
    fast = [item for item in place if place[item] == 0 or item in brief]
    config.hook.pytest_deselected(items=list(set(items) - set(fast)))
    _always.update(item.nodeid for item in fast if place[item] == 0)
    ordered = sorted(fast, key=place.__getitem__)
    near = sum(number < 2 for number in place.values())
    items[:] = dealt(ordered[:near], ordered[near:])


def _place(test: Path, changed: set[str]) -> int:
    """Return 0 for the test of what was changed, 1 for one alike, 2 for others of the core, which are short."""
    words = test.stem.removeprefix("test_")
    if words in changed:
        return 0
    if any(name and (name in words or words in name) for name in changed):
        return 1
    return 2 if test.parent.name == "core" else 3


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop() -> None:
    global _began_s
    _began_s = time.monotonic()  # collecting takes long on a busy machine: else all would be skipped, and pass


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Pass over a test that begins too late, unreported: to tell thousands that they are skipped takes seconds."""
    if item.nodeid in _always or time.monotonic() - _began_s <= _LAST_BEGINS_S:
        return None
    # What the test before left for this one is taken down.
    item.session._setupstate.teardown_exact(nextitem)  # pyright: ignore[reportPrivateUsage]
    return True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say that there are more tests than are counted."""
    terminalreporter.write_line("Tests for which the minute is too short were not begun, nor counted.")
