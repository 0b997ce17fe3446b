"""Judgements are findings: nobody else sets a verdict, nobody looks into a sentence."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(
    file for top in ("calib_core", "server", "scancell_client") for file in (ROOT / top).rglob("*.py")
)
HOMES = {"calib_core/findings/judgement.py", "calib_core/records/faults.py"}  # the second has names of faults
WORDS = {"warn", "fail"}
SAID = re.compile(r"\b(\w*warnings?|\w*notes?|sentences?|reasons?|doubts?|causes?\.(title|sentence))$")
ONE_SAID = re.compile(r"\b(warning|note|sentence|reason|doubt)$")
PEEKS = {"startswith", "endswith", "partition", "rpartition", "find", "index", "match", "search", "fullmatch"}


MAY_SET = re.compile(r"""["'](warn|fail)["']""")
MAY_LOOK = re.compile(r"warning|note|sentence|reason|doubt|cause|\.text|\" in |' in |\(\"[a-z]+ [a-z]")


def parents(tree: ast.AST) -> dict[ast.AST, ast.AST]:
    return {child: node for node in ast.walk(tree) for child in ast.iter_child_nodes(node)}


def sets_a_verdict(tree: ast.AST) -> Iterator[int]:
    """Give the lines with a verdict's word that is neither compared with, nor a type, nor a key that is read."""
    above = parents(tree)
    for node in ast.walk(tree):
        if not (isinstance(node, ast.Constant) and node.value in WORDS):
            continue
        chain = [node, *_ancestors(node, above)]
        if any(isinstance(one, ast.Compare | ast.Subscript | ast.match_case) for one in chain[:4]):
            continue
        if any(isinstance(one, ast.Dict) and node in one.keys for one in chain[:2]):
            continue
        yield node.lineno


def _ancestors(node: ast.AST, above: dict[ast.AST, ast.AST]) -> Iterator[ast.AST]:
    while node in above:
        node = above[node]
        yield node


def looks_into_sentences(tree: ast.AST) -> Iterator[int]:
    """Give the lines where a sentence is searched, or taken apart, under whatever name a loop gives it."""
    yield from _searched(tree, frozenset())


def _searched(tree: ast.AST, said: frozenset[str]) -> Iterator[int]:
    """Give the lines where a sentence is searched; `said` are names of loops that sentences have here."""

    def is_said(part: ast.expr) -> bool:
        return bool(SAID.search(ast.unparse(part))) or (isinstance(part, ast.Name) and part.id in said)

    for node in ast.walk(tree):
        if isinstance(node, ast.GeneratorExp | ast.ListComp | ast.SetComp | ast.DictComp | ast.For):
            loops = [node] if isinstance(node, ast.For) else node.generators
            named = {
                loop.target.id
                for loop in loops
                if isinstance(loop.target, ast.Name) and SAID.search(ast.unparse(loop.iter))
            }
            if named - said:
                yield from _searched(node, said | named)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in PEEKS:
            if any(is_said(one) or _is_words(one) for one in [node.func.value, *node.args]):
                yield node.lineno
        elif isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In | ast.NotIn):
            text = (
                isinstance(node.left, ast.Constant) and isinstance(node.left.value, str) and " " in node.left.value
            )
            word = isinstance(node.left, ast.Constant) and isinstance(node.left.value, str)
            within = word and ONE_SAID.search(ast.unparse(node.comparators[0]))
            looped = word and isinstance(node.comparators[0], ast.Name) and node.comparators[0].id in said
            if text or within or looped or re.search(r"\.(sentence|text)$", ast.unparse(node.left)):
                yield node.lineno


def _is_words(part: ast.expr) -> bool:
    return (
        isinstance(part, ast.Constant)
        and isinstance(part.value, str)
        and bool(re.search("[a-z] [a-z]", part.value))
    )


def files_where(rule: Callable[[ast.AST], Iterator[int]], worth_a_look: re.Pattern[str]) -> set[str]:
    texts = {file.relative_to(ROOT).as_posix(): file.read_text(encoding="utf-8") for file in SOURCES}
    some = {name: ast.parse(text) for name, text in texts.items() if worth_a_look.search(text)}
    return {name for name, tree in some.items() if any(True for _ in rule(tree))} - HOMES


def test_a_verdict_is_set_in_one_place() -> None:
    assert files_where(sets_a_verdict, MAY_SET) == set()
    assert list(sets_a_verdict(ast.parse("verdict = 'warn' if doubt else 'pass'"))) == [1]
    assert not list(sets_a_verdict(ast.parse("ok = result.verdict == 'fail'")))


def test_nobody_looks_into_a_sentence() -> None:
    assert files_where(looks_into_sentences, MAY_LOOK) == set()
    assert list(looks_into_sentences(ast.parse("note.startswith('Not checked')"))) == [1]
    assert list(looks_into_sentences(ast.parse("any(one.startswith('A') for one in result.warnings)"))) == [1]
    assert list(looks_into_sentences(ast.parse("for one in notes:\n    found = 'moved' in one"))) == [2]
    assert list(looks_into_sentences(ast.parse("moved = 'moved' in warning"))) == [1]
    assert list(looks_into_sentences(ast.parse("said.startswith('two ways')"))) == [1]
