"""Words that fill a place of a message are messages themselves: English ones would stand in other languages."""

import ast
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from calib_core.findings.catalogues import catalogue
from tests.catalogues import catalogue_names

ROOT = Path(__file__).resolve().parents[2]
WORD = re.compile(r"[a-z]{3,}")
OWN = {
    # names of fields, values and files, written as they are in every language
    "axes_deg", "axes_mm", "joints_deg", "joints_mm", "away", "toward", "report.html", "session.json",
    "manifest-sha256.txt", "timestamps_s", "tool0", "ros", "dask", "postgres", "reasons", "tooldata", "wobjdata",
    "world", "rad", "deg", "--seed", "--out", "tls_certificate", "tls_key",
}  # fmt: skip


def _texts(part: ast.expr, named: dict[str, list[ast.expr]]) -> Iterator[str]:
    """Give the texts that an argument may be, through the names that its function gives them."""
    if isinstance(part, ast.Constant) and isinstance(part.value, str):
        yield part.value
    elif isinstance(part, ast.IfExp):
        yield from _texts(part.body, named)
        yield from _texts(part.orelse, named)
    elif isinstance(part, ast.BoolOp):
        for value in part.values:
            yield from _texts(value, named)
    elif isinstance(part, ast.Name):
        for value in named.get(part.id, []):
            yield from _texts(value, {})


def _named(function: Iterable[ast.AST]) -> dict[str, list[ast.expr]]:
    """Return what names stand for, in assignments and in loops over what is written there."""
    found: dict[str, list[ast.expr]] = {}

    def note(target: ast.expr, value: ast.expr) -> None:
        if isinstance(target, ast.Name):
            found.setdefault(target.id, []).append(value)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
            for one, other in zip(target.elts, value.elts, strict=False):
                note(one, other)
        elif isinstance(target, ast.Tuple) and isinstance(value, ast.IfExp):
            note(target, value.body)
            note(target, value.orelse)

    for node in function:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                note(target, node.value)
        elif isinstance(node, ast.For) and isinstance(node.iter, ast.Tuple | ast.List):
            for value in node.iter.elts:
                note(node.target, value)
    return found


def _words(source: str) -> Iterator[tuple[int, str, str]]:
    """Give line, place and text of what fills places, and of lists that are joined in English."""
    for scope in ast.walk(ast.parse(source)):
        if not isinstance(scope, ast.FunctionDef):
            continue
        nodes = list(ast.walk(scope))
        calls = [(node, _name(node)) for node in nodes if isinstance(node, ast.Call)]
        calls = [(call, name) for call, name in calls if name == "join" or name in catalogue_names()]
        named = _named(nodes) if calls else {}
        for call, name in calls:
            if name == "join" and isinstance(call.func, ast.Attribute):
                if any(text in (" and ", " or ") for text in _texts(call.func.value, {})):
                    yield call.lineno, "join", "a list joined in English"
            elif name in catalogue_names():
                for one in call.keywords:
                    if one.arg and one.arg not in ("by", "need", "got", "to_do", "where"):
                        yield from ((call.lineno, one.arg, text) for text in _texts(one.value, named))


def _name(call: ast.Call) -> str:
    return getattr(call.func, "id", getattr(call.func, "attr", ""))


def _untold(source: str) -> list[str]:
    known = catalogue("zh").texts
    return [
        f"line {line}, {{{place}}}: {text!r}"
        for line, place, text in _words(source)
        if place == "join" or (WORD.search(text) and text not in known and text not in OWN and "{" not in text)
    ]


FILES = sorted(file for top in ("calib_core", "server") for file in (ROOT / top).rglob("*.py"))
ENGLISH_ALONE = {
    "exports/writing.py",
    "evidence/words.py",
}  # what goes to controllers; the report's table of captures


def test_words_in_places_are_known_to_the_catalogues() -> None:
    found = [
        f"{file.relative_to(ROOT)}: {one}"
        for file in FILES
        if "/".join(file.parts[-2:]) not in ENGLISH_ALONE
        for one in _untold(file.read_text(encoding="utf-8"))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "planted",
    [
        'message("not in {unit}", unit="furlongs")',
        'InputError("{count} {unit}", "none", "Go.", unit="furlongs" if x else "miles")',
        'message("{list}", list=" or ".join(parts))',
    ],
)
def test_planted_words_are_found(planted: str) -> None:
    assert _untold(f"def f(x, parts):\n    return {planted}\n")
    assert _untold(f'def f(x, parts):\n    for what, y in (("furlongs", 1), ("miles", 2)):\n        {planted}\n')


def test_a_word_through_a_name_is_found() -> None:
    told = 'for what, y in (("furlongs", 1), ("miles", 2)):\n        message("{what} on {y}", what=what, y=y)'
    assert _untold(f"def f():\n    {told}\n") == ["line 3, {what}: 'furlongs'", "line 3, {what}: 'miles'"]
