"""How many changed lines of the estimating rooms the tests notice: mutants drawn by seed, made by cosmic-ray.

First the tests that run the changed line are asked, two minutes of them, fast ones first; of a line that none runs
those that stand nearest to its file (of its name or its folder's, then those that import it or what imports it).
What lives here may still be noticed by the whole suite, so the share is a lower bound.

Not drawn is what cannot change an outcome, by a rule that looks at the changed expression alone: `<` for `<=`
between real numbers (one has a unit in its name, or a point), a product for a quotient of which the sign alone is
asked, `is` for `==` (beside a literal for any comparison: Python itself warns of it, as an error), `strict=` of a
zip, how a record is declared, what joins types, and a number that moves by a hundredth of itself or less.
"""

import ast
import importlib.util
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

from harness import Row, kept
from reached_lines import noted, reaching

ROOT = Path(__file__).resolve().parents[2]
ROOMS = [
    "arms",
    "cell",
    "causes",
    "chain",
    "evidence",
    "fusion",
    "graph",
    "guidance",
    "optics",
    "review",
    "sphere",
    "stages",
]
FILES = ("estimation.py", "frames.py", "frame_graph.py")
MOST_TEST_FILES = 6
PATIENCE_S = 2400.0
REACHING_S = 120.0
FIRST = 12
SEED = 20261201
_UNITS = ("_mm", "_mm2", "_rad", "_deg", "_px", "_s", "_share", "_percent", "sigma", "chance")
_EDGES = ({ast.Lt, ast.LtE}, {ast.Gt, ast.GtE})
_SAME = ({ast.Eq, ast.Is}, {ast.NotEq, ast.IsNot})
_TYPES_ALONE = "BitOr"
"""In a source of this project `|` joins types, which nothing evaluates."""


def run(full: bool) -> Iterator[Row]:
    """Draw 20 mutants, or 200, and tell each survivor."""
    count = 200 if full else 20
    what, target = f"changed lines that the tests nearest to them, or that run them, notice, of {count}", "≥ 85 %"
    if not all(importlib.util.find_spec(name) for name in ("cosmic_ray", "coverage")):
        yield Row(what, target, "not tried: cosmic-ray and coverage are not installed here")
        return
    draw = random.Random(SEED)
    noticed = tried = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = _copied(Path(folder) / "tree")
        reached = noted(ROOT, Path(os.environ.get("SCANCELL_BENCH_KEPT") or folder) / "reached")
        while tried < count:
            mutant = _mutant(draw)
            if mutant is None:
                continue
            source, line, changed = mutant
            asked = reaching(reached, source, line, REACHING_S)
            nearest = [] if asked else [str(test.relative_to(ROOT)) for test in _nearest(source)]
            lives = kept(
                f"mutant-{tried}",
                lambda s=source, c=changed, a=asked, n=nearest: all(
                    _passes(tree, s, c, some) for some in (a[:FIRST], a[FIRST:], n) if some
                ),
            )
            tried, noticed = tried + 1, noticed + (not lives)
            if lives:
                print(f"  lives: {source.relative_to(ROOT)}:{line} ({len(asked)} tests run it)", flush=True)
    yield Row(what, target, f"{noticed} ({noticed / tried:.0%})", noticed >= 0.85 * tried)


def sources() -> list[Path]:
    """Return the sources that estimate."""
    core = ROOT / "calib_core"
    return sorted(
        [*(file for room in ROOMS for file in (core / room).rglob("*.py")), *(core / one for one in FILES)]
    )


def _mutant(draw: random.Random) -> tuple[Path, int, str] | None:
    """Return a drawn source, the line that is changed and the changed text; None where there is no such place."""
    from cosmic_ray.mutating import mutate_code  # pyright: ignore[reportMissingImports]
    from cosmic_ray.plugins import get_operator, operator_names  # pyright: ignore[reportMissingImports]

    files = sources()
    source = draw.choices(files, [file.stat().st_size for file in files])[0]
    names = [
        name for name in operator_names() if not re.search(f"{_TYPES_ALONE}|Variable|Decorator|Exception", name)
    ]
    text = source.read_text(encoding="utf-8")
    changed = mutate_code(text, get_operator(draw.choice(names))(), draw.randrange(12))
    if changed is None or changed == text:
        return None
    lines = zip(text.splitlines(), changed.splitlines(), strict=False)
    number, line = next((k, a) for k, (a, b) in enumerate(lines, 1) if a != b)
    # A record that is not frozen, or has no slots, computes the same.
    harmless = line.startswith("@dataclass") or _changes_nothing(text, changed)
    return None if harmless else (source, number, changed)


def _changes_nothing(text: str, changed: str) -> bool:
    """Return whether a change is one of those that no outcome tells, as the module says."""
    try:
        tree = ast.parse(changed)
    except SyntaxError:  # a `*` among arguments
        return True
    for was, now in zip(ast.walk(ast.parse(text)), ast.walk(tree), strict=False):
        if type(was) is not type(now):
            return False
        if isinstance(was, ast.keyword) and was.arg == "strict" and ast.dump(was) != ast.dump(now):
            return True
        if isinstance(was, ast.Compare) and isinstance(now, ast.Compare):
            edges = [{type(a), type(b)} for a, b in zip(was.ops, now.ops, strict=True) if type(a) is not type(b)]
            if edges:
                return _is_same_comparison(was, edges[0])
            if {_operator(was.left), _operator(now.left)} == {ast.Mult, ast.Div} and 0 in _literals(was):
                return True
        if isinstance(was, ast.Constant) and isinstance(now, ast.Constant) and was.value != now.value:
            both = isinstance(was.value, int | float) and isinstance(now.value, int | float)
            return both and abs(now.value - was.value) <= 0.01 * abs(was.value)
    return False


def _is_same_comparison(was: ast.Compare, kinds: set[type[ast.cmpop]]) -> bool:
    """Return whether one kind of comparison for another tells no outcome, or is what Python warns of."""
    warned = bool(kinds & {ast.Is, ast.IsNot} and _literals(was))
    return warned or kinds in _SAME or (kinds in _EDGES and any(map(_is_real, ast.walk(was))))


def _literals(node: ast.Compare) -> list[object]:
    sides = [node.left, *node.comparators]
    return [side.value for side in sides if isinstance(side, ast.Constant) and side.value is not None]


def _operator(node: ast.AST) -> type[ast.operator] | None:
    return type(node.op) if isinstance(node, ast.BinOp) else None


def _is_real(node: ast.AST) -> bool:
    """Return whether part of a comparison is a real number: with a unit in its name, or a point, but zero."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, float) and node.value != 0
    name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
    return name.lower().endswith(_UNITS)


def _copied(tree: Path) -> Path:
    """Return a copy of the project in which sources may be changed."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        if (ROOT / name).is_file():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, tree / name)
    compiled = Path("calib_core") / "kernels" / "__pycache__"
    shutil.copytree(ROOT / compiled, tree / compiled, dirs_exist_ok=True)
    return tree


def _passes(tree: Path, source: Path, changed: str, tests: list[str]) -> bool:
    """Return whether the tests pass with the changed source; what fails must pass with the source as it is."""
    place = tree / source.relative_to(ROOT)
    place.write_text(changed, encoding="utf-8")
    try:
        failed = _failing(tree, tests)
    finally:
        shutil.copy2(source, place)
    return failed is None or bool(failed and _failing(tree, [failed]) is not None)


def _failing(tree: Path, tests: list[str]) -> str | None:
    """Return the first test that fails, None where all pass; empty where none was collected, or in time."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", "-rf", "-p", "no:cacheprovider", *tests]
    try:
        done = subprocess.run(
            command,
            cwd=tree,
            capture_output=True,
            text=True,
            timeout=PATIENCE_S,
            env=_environment(tree),
            check=False,
        )
    except subprocess.TimeoutExpired:
        return ""
    found = re.search(r"^FAILED (\S+)", done.stdout, re.MULTILINE)
    return None if not done.returncode else found[1] if found else ""


def _environment(tree: Path) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": str(tree), "OPENBLAS_NUM_THREADS": "1"}


@cache
def _importers() -> Callable[[Path], list[Path]]:
    """Return what lists the files, tests among them, that import from a source."""
    named = re.compile(r"^\s*from (calib_core[\w.]*) import", re.MULTILINE)
    of: dict[str, list[Path]] = {}
    for file in [*(ROOT / "calib_core").rglob("*.py"), *(ROOT / "tests" / "core").glob("test_*.py")]:
        for module in set(named.findall(file.read_text(encoding="utf-8"))):
            of.setdefault(module, []).append(file)
    return lambda source: of.get(".".join(source.relative_to(ROOT).with_suffix("").parts), [])


def _nearest(source: Path) -> list[Path]:
    """Return the test files that stand nearest to a source: by its name, by its folder's, then by imports."""
    everywhere = sorted((ROOT / "tests" / "core").glob("test_*.py"))
    tests = [test for name in (source.stem, source.parent.name) for test in everywhere if name in test.stem]
    seen, level = {source}, [source]
    while level and len(tests) < MOST_TEST_FILES:
        following = sorted({file for one in level for file in _importers()(one)} - seen)
        seen |= set(following)
        tests += [file for file in following if file.name.startswith("test_")]
        level = [file for file in following if not file.name.startswith("test_")]
    return list(dict.fromkeys(tests))[:MOST_TEST_FILES]
