"""How many changed lines of the estimating rooms the tests notice: mutants drawn by seed, made by cosmic-ray.

First the tests that stand nearest to the changed file are run (of its name or its folder's, then those that import
it or what imports it), then those that run the changed line, two minutes of them, fast ones first: what lives here
may still be noticed by the whole suite, so the share is a lower bound.
"""

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
_TYPES_ALONE = "BitOr"
"""In a source of this project `|` joins types, which nothing evaluates."""


def run(full: bool) -> Iterator[Row]:
    """Draw 20 mutants, or 200, and tell each survivor."""
    count = 200 if full else 20
    what, target = f"changed lines that the tests nearest to them, or that run them, notice, of {count}", "≥ 85 %"
    if not all(importlib.util.find_spec(name) for name in ("cosmic_ray", "coverage")):
        yield Row(what, target, "not tried: cosmic-ray and coverage are not installed here")
        return
    draw = random.Random(20261126)
    noticed = tried = 0
    with tempfile.TemporaryDirectory() as folder:
        tree = _copied(Path(folder) / "tree")
        reached = noted(ROOT, Path(os.environ.get("SCANCELL_BENCH_KEPT") or folder) / "reached")
        while tried < count:
            mutant = _mutant(draw)
            if mutant is None:
                continue
            source, line, changed = mutant
            tests = [str(test.relative_to(ROOT)) for test in _nearest(source)]
            lives = kept(f"mutant-{tried}", lambda s=source, c=changed, t=tests: not t or _passes(tree, s, c, t))
            if lives:
                others = reaching(reached, source, line, REACHING_S)
                name = f"mutant-{tried}-reached"
                lives = kept(name, lambda s=source, c=changed, t=others: not t or _passes(tree, s, c, t))
            tried, noticed = tried + 1, noticed + (not lives)
            if lives:
                print(f"  lives: {source.relative_to(ROOT)}:{line} ({len(others)} tests run it)", flush=True)
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
    return None if line.startswith("@dataclass") else (source, number, changed)


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
