"""Which stages there are is asked of the registry: no other place lists their names by hand."""

import ast
from collections.abc import Iterator
from pathlib import Path

from calib_core.stages.registry import stage_names, step_names, table_stages, tool_stages

ROOT = Path(__file__).resolve().parents[2]
NAMES = {*stage_names(), *step_names()}


def lists_of_names(file: Path) -> Iterator[str]:
    """Give where a literal list, tuple, set or choice of types holds two names of stages or steps."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.List | ast.Tuple | ast.Set):
            names = [part.value for part in node.elts if isinstance(part, ast.Constant)]
            if "base" in names:  # frames, some of which are called as stages are
                continue
            if len(NAMES.intersection(n for n in names if isinstance(n, str))) > 1:
                yield f"{file.relative_to(ROOT)}:{node.lineno}: {names}"


def test_no_list_of_stages_stands_outside_their_folders() -> None:
    folders = [
        ROOT / "calib_core" / "stages",
        ROOT / "calib_core" / "simulation",
    ]  # it shares no code with solvers
    sources = [f for top in ("calib_core", "server", "scancell_client") for f in (ROOT / top).rglob("*.py")]
    outside = [f for f in sources if not any(f.is_relative_to(folder) for folder in folders)]
    assert len(outside) > 300
    found = [line for file in outside for line in lists_of_names(file)]
    assert found == []


def test_stages_say_what_they_give() -> None:
    assert tool_stages() == ("chain", "tcp")
    assert table_stages() == ("chain", "turntable")
