"""Every way of Windows' own that the table names has its test."""

import ast
from pathlib import Path

from tests.windows.ways import WAYS

TESTS = Path(__file__).resolve().parents[1]


def test_forty_ways_of_windows_are_held_by_tests_that_are_there() -> None:
    assert len({what for what, _, _ in WAYS}) == len(WAYS) >= 40
    there: dict[str, set[str]] = {}
    for file in [*(TESTS / "windows").glob("test_*.py"), *(TESTS / "package").glob("test_*.py")]:
        parsed = ast.parse(file.read_text(encoding="utf-8"))
        there[file.stem] = {node.name for node in parsed.body if isinstance(node, ast.FunctionDef)}
    assert [way for way in WAYS if way[2] not in there.get(way[1], set())] == []
