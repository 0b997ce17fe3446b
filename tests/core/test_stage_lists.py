"""Which stages there are is asked of the registry: no other place lists their names by hand."""

import ast
import re
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from calib_core.steps import stage_names, step_names, table_stages, tool_stages

ROOT = Path(__file__).resolve().parents[2]
NAMES = {*stage_names(), *step_names()}
WEB_LIST = re.compile(r"""\[\s*(?:["'][^"']*["']\s*,\s*)+["'][^"']*["']\s*,?\s*\]""")
_NAME = f"({'|'.join(sorted(NAMES))})"
WEB_CHOICE = re.compile(
    rf"""[=!]==?\s*["']{_NAME}["']|["']{_NAME}["']\s*[=!]==|\bcase\s+["']{_NAME}["']|\w\[["']{_NAME}["']\]"""
    rf"""|(?:[{{,]|^)\s*["']?{_NAME}["']?:\s""",
    re.MULTILINE,
)
"""Where the page's code asks for a stage or step by name: compared, as a case, as a key of a table."""
NEAR = 300
"""Two names as far apart as this, in letters, belong to one choice."""


@cache
def nodes_of(file: Path) -> list[ast.AST]:
    """Return what a file's code consists of."""
    return list(ast.walk(ast.parse(file.read_text(encoding="utf-8"))))


def lists_of_names(file: Path) -> Iterator[str]:
    """Give where a literal list, tuple, set, table or choice of types holds two names of stages or steps."""
    for node in nodes_of(file):
        table = isinstance(node, ast.Dict) and all(isinstance(value, ast.Constant) for value in node.values)
        if table or isinstance(node, ast.List | ast.Tuple | ast.Set):
            parts = node.keys if isinstance(node, ast.Dict) else node.elts
            names = [part.value for part in parts if isinstance(part, ast.Constant)]
            if "base" in names:  # frames, some of which are called as stages are
                continue
            if len(NAMES.intersection(n for n in names if isinstance(n, str))) > 1:
                yield f"{file.relative_to(ROOT)}:{node.lineno}: {names}"


def choices_of_names(file: Path) -> Iterator[str]:
    """Give where code decides between two stages or steps by their names."""
    for node in nodes_of(file):
        names = _compared(node)
        if len(NAMES.intersection(names)) > 1:
            yield f"{file.relative_to(ROOT)}:{getattr(node, 'lineno', 0)}: {sorted(names)}"


def _compared(node: ast.AST) -> set[str]:
    """Return the texts that one decision compares with: alternatives, members, cases, branches in a row."""
    match node:
        case ast.BoolOp(values=values):
            return {name for value in values for name in _compared_with(value)}
        case ast.Compare(ops=[ast.In() | ast.NotIn()], comparators=[ast.Tuple() | ast.List() | ast.Set() as held]):
            return set(_texts(held.elts))
        case ast.Match(cases=cases):
            return {name for case in cases for part in ast.walk(case.pattern) for name in _texts([part])}
        case ast.If(test=test, orelse=[ast.If(test=other)]):
            return {*_compared_with(test), *_compared_with(other)}
        case ast.IfExp(test=test, orelse=ast.IfExp(test=other)):
            return {*_compared_with(test), *_compared_with(other)}
        case _:
            return set()


def _compared_with(test: ast.expr) -> list[str]:
    match test:
        case ast.Compare(left=left, ops=[ast.Eq() | ast.NotEq()], comparators=[right]):
            return _texts([left, right])
        case _:
            return []


def _texts(nodes: Sequence[ast.AST]) -> list[str]:
    values = (node.value if isinstance(node, ast.MatchValue) else node for node in nodes)
    return [value.value for value in values if isinstance(value, ast.Constant) and isinstance(value.value, str)]


def choices_in_page(code: str) -> Iterator[list[str]]:
    """Give the names of stages and steps that stand near each other as conditions or keys."""
    bare = re.sub(r"/\*[\s\S]*?\*/|^\s*//.*", "", code, flags=re.MULTILINE)
    found = [(match.start(), next(name for name in match.groups() if name)) for match in WEB_CHOICE.finditer(bare)]
    for (start, name), (end, other) in pairwise(found):
        if name != other and end - start < NEAR:
            yield [name, other]


@pytest.mark.thorough
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


def test_no_code_decides_between_stages_by_their_names() -> None:
    """Nor do the stages' own folders: what a stage gives is asked of the registry."""
    own_code = ROOT / "calib_core" / "simulation"
    sources = [f for top in ("calib_core", "server", "scancell_client") for f in (ROOT / top).rglob("*.py")]
    found = [line for file in sources if not file.is_relative_to(own_code) for line in choices_of_names(file)]
    assert found == []


@pytest.mark.parametrize(
    "code",
    [
        "a == 'tcp' or a == 'chain'",
        "a != 'tcp' and 'chain' != a",
        "a in ('tcp', 'chain')",
        "match a:\n    case 'tcp' | 'chain':\n        b",
        "match a:\n    case 'tcp':\n        b\n    case 'chain':\n        c",
        "if a == 'tcp':\n    b\nelif a == 'chain':\n    c",
        "b if a == 'tcp' else c if a == 'chain' else d",
    ],
)
def test_a_choice_between_two_stages_is_found(code: str) -> None:
    assert [names for node in ast.walk(ast.parse(code)) if len(names := _compared(node)) > 1] == [{"tcp", "chain"}]


def test_no_list_of_stages_and_no_choice_between_them_stands_in_the_page() -> None:
    """What a stage or a language says of them lies in folders of its own."""
    own = ("web/stages/", "web/texts/", "web/vendor/")
    names = [f.relative_to(ROOT).as_posix() for f in (ROOT / "web").rglob("*.js")]
    codes = {name: (ROOT / name).read_text(encoding="utf-8") for name in names if not name.startswith(own)}
    assert len(codes) > 100
    listed = [(name, re.split(r"""["']""", one)) for name, code in codes.items() for one in WEB_LIST.findall(code)]
    assert [(name, words) for name, words in listed if len(NAMES.intersection(words)) > 1] == []
    assert [(name, chosen) for name, code in codes.items() for chosen in choices_in_page(code)] == []
    assert WEB_LIST.findall('of = ["chain", "tcp"]')


@pytest.mark.parametrize(
    "code",
    [
        'stage === "tcp" || stage === "chain"',
        'verdicts["tcp"] || verdicts["chain"]',
        'case "tcp":\n    return 1;\n  case "chain":',
        'const WORDS = { tcp: "a", "chain": "b" };',
        'const WORDS = {\n  tcp: "a",\n  chain: "b",\n};',
    ],
)
def test_a_choice_between_two_stages_is_found_in_the_page(code: str) -> None:
    assert [sorted(names) for names in choices_in_page(code)] == [["chain", "tcp"]]


def test_stages_say_what_they_give() -> None:
    assert tool_stages() == ("chain", "tcp")
    assert table_stages() == ("chain", "turntable")
