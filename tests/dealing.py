"""Which tests a run has, and which of its processes gets them."""

import os
from collections import Counter

import pytest


def dealt(first: list[pytest.Item], others: list[pytest.Item]) -> list[pytest.Item]:
    """Return tests in an order in which each process begins with its share of the first, in whole files.

    `--dist worksteal` gives each process a run of the tests in this order, and takes from the runs' ends later.
    """
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    files = {path: number for number, path in enumerate(dict.fromkeys(item.path for item in first))}
    left, total = others.copy(), len(first) + len(others)
    ordered: list[pytest.Item] = []
    for process in range(processes):
        own = [item for item in first if files[item.path] % processes == process]
        size = max((total - len(ordered)) // (processes - process) - len(own), 0)
        ordered += [*own, *left[:size]]
        del left[:size]
    return [*ordered, *left]


def without_thorough(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the tests of a brief run: of those marked `thorough(keep=n)` a function's first n, or none."""
    seen: Counter[tuple[object, str]] = Counter()
    brief: list[pytest.Item] = []
    for item in items:
        mark = item.get_closest_marker("thorough")
        if mark is not None:
            function = (item.path, item.nodeid.partition("[")[0])
            seen[function] += 1
            if seen[function] > mark.kwargs.get("keep", 0):
                continue
        brief.append(item)
    return brief
