"""Lines of code of calib_core, server and web: as they are, as they were, and what moving the house alone did."""

import ast
import io
import re
import subprocess
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import PurePosixPath

from harness import Row

BEFORE = "ae2ee4b"  # the last commit before the house was rearranged
MOVED = {
    "27ef985": "every module moves into its room",
    "0771a00": "registries",
    "b6fb9f0": "the service's words",
    "36f766b": "one way in for captures",
    "a58cf38": "zip files in one place",
    "c685e66": "results carry blocks",
    "c0118f7": "results told in blocks",
    "a91c99c": "blocks made with the result",
    "3789293": "one renderer of blocks each, hand-written summaries gone",
    "d3db662": "stages as folders with keys of one graph",
    "fc491aa": "an open step is worked on",
    "0148d45": "what nobody recalls is gone",
}
"""The commits that moved and merged; `verify` came as a stage with the folders, and plots with the blocks."""
_NO_TOKEN = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
_WHERE = ("calib_core", "server", "web")
_KINDS = {".py", ".js", ".css", ".html"}


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    before, now = lines(BEFORE), lines("HEAD")
    bare = now.total() - now["texts"]
    moved = sum(change(commit) for commit in MOVED)
    parts = ", ".join(f"{name} {count:,}" for name, count in now.items())
    return [
        Row(f"lines of code before ({BEFORE})", "", f"{before.total():,}"),
        Row("lines of code now", "", f"{now.total():,}: {parts}"),
        Row(
            "without the page's texts in three languages, beside before",
            "≤ 0.88 ×",
            f"{bare / (before.total() - before['texts']):.2f} ×",
            bare <= 0.88 * (before.total() - before["texts"]),
        ),
        Row(
            f"the {len(MOVED)} commits that moved and merged",
            "≤ −12 %",
            f"{moved:+,}",
            moved < -0.12 * before.total(),
        ),
        _messages(),
    ]


def _messages() -> Row:
    """Return how many texts are translated; the pages of codes are documentation and stand beside them."""
    count = {
        file: _git("show", f"HEAD:{file}").count("\nmsgid ") - 1 for file in _git("ls-files", "*de*.po").split()
    }
    page = count["web/texts/de.po"]
    codes = count["calib_core/findings/locale/de/pages.po"]
    rest = sum(count.values()) - page - codes
    return Row(
        "messages to translate: the page's; all others (and texts of the codes' pages)",
        "≤ 1,800",
        f"{page:,}; {rest:,} ({codes:,})",
        page + rest <= 1_800,
    )


def lines(revision: str) -> Counter[str]:
    """Return the lines of code at a revision by where they stand."""
    found: Counter[str] = Counter()
    for name in _git("ls-tree", "-r", "--name-only", revision).splitlines():
        if _counts(name):
            found[_where(name)] += code_lines(_git("show", f"{revision}:{name}"), PurePosixPath(name).suffix)
    return found


def change(commit: str) -> int:
    """Return how many lines of code a commit added."""
    added = 0
    for line in _git("diff", "--no-renames", "--name-status", f"{commit}^", commit).splitlines():
        status, name = line.split("\t")
        if _counts(name):
            kind = PurePosixPath(name).suffix
            added += code_lines(_git("show", f"{commit}:{name}"), kind) if status != "D" else 0
            added -= code_lines(_git("show", f"{commit}^:{name}"), kind) if status != "A" else 0
    return added


def code_lines(text: str, kind: str) -> int:
    """Return how many lines are more than comment, docstring and blank."""
    if kind == ".py":
        return len(_python(text))
    bare = re.sub(r"/\*.*?\*/|<!--.*?-->", "", text, flags=re.DOTALL)
    return sum(1 for line in bare.splitlines() if line.strip() and not line.strip().startswith("//"))


def _python(text: str) -> set[int]:
    code: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in _NO_TOKEN:
            code.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                code.difference_update(range(node.lineno, (node.end_lineno or 0) + 1))
            case _:
                pass
    return code


def _counts(name: str) -> bool:
    path = PurePosixPath(name)
    return path.parts[0] in _WHERE and path.suffix in _KINDS and "vendor" not in path.parts


def _where(name: str) -> str:
    parts: Iterable[str] = PurePosixPath(name).parts
    return "texts" if "texts" in parts else next(iter(parts))


def _git(*words: str) -> str:
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout
