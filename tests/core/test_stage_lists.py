"""Which stages there are is asked of the registry: no other place lists their names by hand."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from calib_core.stages.registry import stage_names, step_names, table_stages, tool_stages

ROOT = Path(__file__).resolve().parents[2]
NAMES = {*stage_names(), *step_names()}
WEB_LIST = re.compile(r"""\[\s*(?:["'][^"']*["']\s*,\s*)+["'][^"']*["']\s*,?\s*\]""")


def lists_of_names(file: Path) -> Iterator[str]:
    """Give where a literal list, tuple, set, table or choice of types holds two names of stages or steps."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        table = isinstance(node, ast.Dict) and all(isinstance(value, ast.Constant) for value in node.values)
        if table or isinstance(node, ast.List | ast.Tuple | ast.Set):
            parts = node.keys if isinstance(node, ast.Dict) else node.elts
            names = [part.value for part in parts if isinstance(part, ast.Constant)]
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


def test_no_list_of_stages_stands_in_the_page() -> None:
    """What a stage or a language says of them lies in folders of its own."""
    own = ("web/stages/", "web/texts/", "web/vendor/")
    names = [f.relative_to(ROOT).as_posix() for f in (ROOT / "web").rglob("*.js")]
    files = [name for name in names if not name.startswith(own)]
    assert len(files) > 100
    found = [
        f"{name}: {listed}"
        for name in files
        for listed in WEB_LIST.findall((ROOT / name).read_text(encoding="utf-8"))
        if len(NAMES.intersection(re.split(r"""["']""", listed))) > 1
    ]
    assert found == []
    assert WEB_LIST.findall('of = ["chain", "tcp"]')


def test_stages_say_what_they_give() -> None:
    assert tool_stages() == ("chain", "tcp")
    assert table_stages() == ("chain", "turntable")
