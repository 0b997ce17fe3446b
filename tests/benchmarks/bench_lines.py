"""Lines of code of calib_core, server and web, as they are and as they were; messages to translate."""

import ast
import io
import re
import subprocess
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import PurePosixPath

from harness import Row

BEFORE = "82c57c61"  # where the round of 23 November began
_NO_TOKEN = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
_WHERE = ("calib_core", "server", "web")
_KINDS = {".py", ".js", ".css", ".html"}


def run(full: bool) -> list[Row]:
    """Return the rows of this benchmark; `full` changes nothing."""
    before, now = (lines(revision) for revision in (BEFORE, "HEAD"))
    bare = now.total() - now["texts"]
    parts = ", ".join(f"{name} {count:,}" for name, count in now.items() if name != "texts")
    measured = f"{bare:,} ({before.total() - before['texts']:,}): {parts}"
    return [
        Row("lines of code without texts (and where the round began)", "≤ 70,000", measured, bare <= 70_000),
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
